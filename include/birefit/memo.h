#pragma once
// What physics worked out once and will be asked for again. Physics itself remembers nothing between calls: whoever
// asks for many pictures keeps a Memo and passes it in (Demand::memo).

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <type_traits>
#include <typeindex>
#include <utility>

namespace birefit {

/// The latest `most` values by their key. Several threads may ask at once.
template <class Key, class Value>
class Recent {
 public:
  /// Keeps at most `most` values; beyond that the one goes that was kept first.
  explicit Recent(std::size_t most) : most_(most) {}
  /// Null where it is not, or no longer, known.
  std::shared_ptr<const Value> find(const Key& key) const {
    const std::lock_guard lock(guard_);
    const auto found = known_.find(key);
    return found == known_.end() ? nullptr : found->second;
  }
  /// What is known by the key from now on: of two threads that worked out the same, the first one's.
  std::shared_ptr<const Value> keep(const Key& key, std::shared_ptr<const Value> value) {
    const std::lock_guard lock(guard_);
    const auto [place, is_new] = known_.emplace(key, std::move(value));
    const std::shared_ptr<const Value> kept = place->second;
    if (is_new) order_.push_back(key);
    if (order_.size() > most_) {
      known_.erase(order_.front());
      order_.pop_front();
    }
    return kept;
  }

 private:
  std::size_t most_;
  mutable std::mutex guard_;
  std::map<Key, std::shared_ptr<const Value>> known_;
  std::deque<Key> order_;
};

/// Stores of whatever kind, each made when first asked for. What they hold is what would be worked out anew: pictures
/// have the same bits with any Memo and without, whatever was asked before. Several threads may ask at once.
class Memo {
 public:
  Memo() = default;
  Memo(const Memo&) = delete;
  Memo& operator=(const Memo&) = delete;

  /// The one store of this type, made by its default constructor when it is first asked for; lives as long as the Memo.
  template <class Store>
  Store& of() {
    const std::lock_guard lock(guard_);
    std::shared_ptr<void>& store = stores_[typeid(Store)];
    if (!store) store = std::make_shared<Store>();
    return *static_cast<Store*>(store.get());
  }

 private:
  std::mutex guard_;
  std::map<std::type_index, std::shared_ptr<void>> stores_;
};

/// What Store, a Recent, knows by the key, or what make() returns, a shared pointer; without a memo always the latter.
template <class Store, class Key, class Make>
auto remembered(Memo* memo, const Key& key, const Make& make) {
  using Known = std::remove_cvref_t<decltype(std::declval<Store&>().find(key))>;
  if (!memo) return Known(make());
  Store& store = memo->of<Store>();
  if (Known known = store.find(key)) return known;
  return store.keep(key, make());
}

}  // namespace birefit
