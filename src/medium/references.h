#pragma once
// Which entries of the parameter table a scene reads.

#include <optional>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "birefit/scene.h"

namespace birefit {

/// Visits what structs describe for their references and what those may be.
template <class F>
struct ReferenceVisitor {
  F& f;
  template <class Ref>
  void number(const char* /*key*/, Ref& ref, const NumberSpec& spec, const char* /*words*/) {
    f(ref, spec);
  }
  template <class Refs>
  void vector(const char* /*key*/, Refs& refs, const NumberSpec& spec, const char* /*words*/) {
    for (auto& ref : refs) f(ref, spec);
  }
  template <class Refs>
  void list(const char* /*key*/, Refs& refs, const NumberSpec& spec, const char* /*words*/) {
    for (auto& ref : refs) f(ref, spec);
  }
  template <class Part>
  void inside(const char* key, Part& part) {
    using Plain = std::remove_const_t<Part>;
    if constexpr (requires { Plain::describe(part, *this); })
      Plain::describe(part, *this);
    else if constexpr (requires { part.has_value(); })
      part ? inside(key, *part) : void();
    else if constexpr (requires { part.begin(); })
      for (auto& one : part) inside(key, one);
    else if constexpr (!std::is_same_v<Plain, std::monostate>)
      std::visit([&](auto& one) { inside(key, one); }, part);
  }
};

/// Calls f(ParameterRef&, const NumberSpec&), of a const scene f(const ParameterRef&, ..), for every reference of the
/// scene, the empty ones included.
template <class SceneOrConst, class F>
void for_each_number(SceneOrConst& scene, F&& f) {
  ReferenceVisitor<std::remove_reference_t<F>> visit{f};
  Scene::describe(scene, visit);
}
/// The same without what they may be.
template <class SceneOrConst, class F>
void for_each_ref(SceneOrConst& scene, F&& f) {
  for_each_number(scene, [&](auto& ref, const NumberSpec&) { f(ref); });
}

}  // namespace birefit
