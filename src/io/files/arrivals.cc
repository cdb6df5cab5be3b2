#include "io/files/arrivals.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <chrono>
#include <cstring>
#include <optional>
#include <set>
#include <utility>

#include <poll.h>
#include <sys/inotify.h>
#include <sys/stat.h>
#include <unistd.h>

#include "birefit/error.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

/// Without word from the kernel (shared folders of other machines) a file that has not changed for so long is whole; if
/// it is not, it cannot be read, and is put off.
constexpr double kStandsStill = 0.3;
constexpr int kLookEvery = 100;  // ms

double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

bool is_image_name(const std::string& name) {
  static const std::set<std::string> endings = {".tif",  ".tiff", ".png", ".exr", ".jpg", ".jpeg", ".bmp",
                                                ".webp", ".gif",  ".dng", ".cr2", ".nef", ".npy"};
  std::string ending = fs::path(name).extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return name.front() != '.' && endings.contains(ending);
}

std::optional<FileState> state_of(const fs::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0 || !S_ISREG(found.st_mode) || found.st_size == 0) return std::nullopt;
  return FileState{static_cast<std::uint64_t>(found.st_dev), static_cast<std::uint64_t>(found.st_ino),
                   static_cast<std::uint64_t>(found.st_size),
                   static_cast<std::int64_t>(found.st_mtim.tv_sec) * 1'000'000'000 + found.st_mtim.tv_nsec};
}

}  // namespace

Arrivals::Arrivals(fs::path folder, double patience) : folder_(std::move(folder)), patience_(patience) {
  std::error_code code;
  if (!fs::is_directory(folder_, code))
    throw UserError({folder_.string()}, "is no folder", "--folder names the one that images are written to");
  listener_ = ::inotify_init1(IN_NONBLOCK | IN_CLOEXEC);
  if (listener_ < 0) return;
  if (::inotify_add_watch(listener_, folder_.c_str(), IN_MODIFY | IN_CLOSE_WRITE | IN_MOVED_TO) < 0) {
    ::close(listener_);
    listener_ = -1;
  }
}

Arrivals::~Arrivals() {
  if (listener_ >= 0) ::close(listener_);
}

/// Which files are written to, and which their writers have closed, or renamed to what they are called now.
void Arrivals::hear() {
  alignas(inotify_event) std::array<char, 1 << 16> buffer{};
  for (ssize_t n; listener_ >= 0 && (n = ::read(listener_, buffer.data(), buffer.size())) > 0;) {
    for (ssize_t at = 0; at < n;) {
      inotify_event event{};
      std::memcpy(&event, buffer.data() + at, sizeof event);
      const std::string name = event.len > 0 ? buffer.data() + at + sizeof event : "";
      at += static_cast<ssize_t>(sizeof event) + event.len;
      if (event.mask & IN_Q_OVERFLOW)  // who closed what is not known any more
        for (auto& [other, seen] : seen_) seen.open = false;
      if (name.empty() || !is_image_name(name)) continue;
      if (const auto state = state_of(folder_ / name)) {
        const bool open = (event.mask & IN_MODIFY) != 0;
        seen_[name] = {*state, seconds_now(), !open, false, open};
      }
    }
  }
}

void Arrivals::look(double now) {
  std::set<std::string> there;
  std::error_code code;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_, code)) {
    const std::string name = entry.path().filename().string();
    const auto state = is_image_name(name) ? state_of(entry.path()) : std::nullopt;
    if (!state) continue;
    there.insert(name);
    if (const auto [at, fresh] = seen_.try_emplace(name, Seen{*state, now}); !fresh && at->second.state != *state)
      at->second = {*state, now, false, false, at->second.open};
  }
  std::erase_if(seen_, [&](const auto& one) { return !there.contains(one.first); });
}

std::vector<Arrival> Arrivals::next(double seconds) {
  const double end = seconds_now() + seconds;
  for (;;) {
    hear();
    const double now = seconds_now();
    look(now);
    std::vector<Arrival> ready;
    for (const auto& [name, seen] : seen_) {
      if (const auto known = taken_.find(name); known != taken_.end() && known->second == seen.state) continue;
      const double still = now - seen.since;
      if (const bool wait = seen.put_off || seen.open; wait ? still < patience_ : !seen.closed && still < kStandsStill)
        continue;
      Arrival arrival{name, seen.state, {}, seen.put_off};
      for (const auto& [other, state] : taken_)
        if (state == seen.state && !seen_.contains(other)) arrival.renamed_from = other;
      ready.push_back(std::move(arrival));
    }
    std::sort(ready.begin(), ready.end(), [](const Arrival& a, const Arrival& b) {
      return std::pair(a.state.changed_ns, a.name) < std::pair(b.state.changed_ns, b.name);
    });
    if (!ready.empty() || now >= end) return ready;
    pollfd wait{listener_, POLLIN, 0};
    ::poll(&wait, listener_ >= 0 ? 1 : 0, kLookEvery);
  }
}

void Arrivals::take(const std::string& name, const FileState& state) {
  // What it was called before is another file from now on. (Another name that still leads to it, a link, stays taken.)
  std::erase_if(taken_, [&](const auto& one) {
    return one.first != name && one.second == state && state_of(folder_ / one.first) != state;
  });
  taken_[name] = state;
}

void Arrivals::put_off(const Arrival& arrival) {
  if (const auto at = seen_.find(arrival.name); at != seen_.end() && at->second.state == arrival.state)
    at->second.put_off = true;
}

bool Arrivals::is_still(const Arrival& arrival) const { return state_of(folder_ / arrival.name) == arrival.state; }

}  // namespace birefit
