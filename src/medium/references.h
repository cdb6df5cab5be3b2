#pragma once
// Which entries of the parameter table a scene reads.

#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "birefit/scene.h"

namespace birefit {

/// The keys that lead to a number, as configs write them, put together when they are asked for.
struct KeyPath {
  const KeyPath* above = nullptr;
  const char* key = "";
  std::string text() const { return above && *above->key ? above->text() + "." + key : key; }
};

/// Visits what structs describe for their references, what those may be and where they stand. What f.skips() is left
/// out with all below it.
template <class F>
struct ReferenceVisitor {
  F& f;
  const KeyPath* above;
  template <class Ref>
  void number(const char* key, Ref& ref, const NumberSpec& spec, const char* /*words*/) {
    f(ref, spec, KeyPath{above, key});
  }
  template <class Refs>
  void vector(const char* key, Refs& refs, const NumberSpec& spec, const char* words) {
    list(key, refs, spec, words);
  }
  template <class Refs>
  void list(const char* key, Refs& refs, const NumberSpec& spec, const char* /*words*/) {
    for (auto& ref : refs) f(ref, spec, KeyPath{above, key});
  }
  template <class Part>
  void inside(const char* key, Part& part) {
    using Plain = std::remove_const_t<Part>;
    if constexpr (requires { f.skips(part); })
      if (f.skips(part)) return;
    if constexpr (requires { Plain::describe(part, *this); }) {
      const KeyPath here{above, key};
      Plain::describe(part, ReferenceVisitor{f, &here});
    } else if constexpr (requires { part.has_value(); }) {
      part ? inside(key, *part) : void();
    } else if constexpr (requires { part.begin(); }) {
      for (auto& one : part) inside(key, one);
    } else if constexpr (!std::is_same_v<Plain, std::monostate>) {
      std::visit([&](auto& one) { inside(key, one); }, part);
    }
  }
};

/// Calls f(ParameterRef&, const NumberSpec&, const KeyPath&), of a const scene f(const ParameterRef&, ..), for every
/// reference of the scene, the empty ones included.
template <class SceneOrConst, class F>
void for_each_placed(SceneOrConst& scene, F&& f) {
  const KeyPath top;
  Scene::describe(scene, ReferenceVisitor<std::remove_reference_t<F>>{f, &top});
}
/// The same without where they stand.
template <class SceneOrConst, class F>
void for_each_number(SceneOrConst& scene, F&& f) {
  for_each_placed(scene, [&](auto& ref, const NumberSpec& spec, const KeyPath&) { f(ref, spec); });
}
/// The same without what they may be.
template <class SceneOrConst, class F>
void for_each_ref(SceneOrConst& scene, F&& f) {
  for_each_number(scene, [&](auto& ref, const NumberSpec&) { f(ref); });
}

}  // namespace birefit
