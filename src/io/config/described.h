#pragma once
// Reading what structs describe of their numbers (birefit/number_spec.h, birefit/director.h).

#include <array>
#include <string>
#include <variant>
#include <vector>

#include "io/config/reader.h"

namespace birefit {

/// Calls number(key, spec, words, refs ..) for what a struct describes itself, not for what is inside of it.
template <class Number>
struct NumberVisitor {
  const Number& each;
  void number(const char* key, ParameterRef& ref, const NumberSpec& spec, const char* words) {
    if (!spec.implied) each(key, spec, words, &ref);
  }
  void vector(const char* key, std::array<ParameterRef, 3>&, const NumberSpec& spec, const char* words) {
    each(key, spec, words, nullptr);
  }
  void list(const char* key, std::vector<ParameterRef>&, const NumberSpec& spec, const char* words) {
    each(key, spec, words, nullptr);
  }
  template <class Part>
  void inside(const char*, Part&) {}
};
/// each(key, spec, words, ref): ref null for vectors and lists.
template <class T, class Each>
void each_number(T& object, const Each& each) {
  T::describe(object, NumberVisitor<Each>{each});
}

/// The keys of a T's block, in the order of its description.
template <class T>
std::vector<std::string> described_keys() {
  std::vector<std::string> keys;
  T object;
  each_number(object, [&](const char* key, const NumberSpec&, const char*, ParameterRef*) { keys.emplace_back(key); });
  return keys;
}

/// What a number of T may be, by its key; a component's of a vector, a coefficient's of a list.
template <class T>
NumberSpec described(const std::string& key) {
  NumberSpec found;
  T object;
  each_number(object, [&](const char* name, const NumberSpec& spec, const char*, ParameterRef*) {
    if (key == name) found = spec;
  });
  return found;
}

/// One number as T describes it: given, or its fallback, or an empty reference where it may be left out, or missing.
template <class T>
ParameterRef read_described(ConfigReader& reader, const Block& block, const std::string& key) {
  const NumberSpec spec = described<T>(key);
  if (spec.optional && !reader.given(block, key)) return {};
  return reader.number(block, key, spec, spec.fallback);
}

/// All of T's numbers that stand in its block; vectors and lists are left to who reads them.
template <class T>
void read_numbers(ConfigReader& reader, const Block& block, T& object) {
  each_number(object, [&](const char* key, const NumberSpec&, const char*, ParameterRef* ref) {
    if (ref) *ref = read_described<T>(reader, block, key);
  });
}

/// Of a variant: what(static_cast<const T*>(nullptr)) for each kind that has a key in configs.
template <class Variant>
struct KindsOf;
template <class... T>
struct KindsOf<std::variant<T...>> {
  template <class What>
  static void each(const What& what) {
    const auto one = [&]<class One>(const One* type) {
      if constexpr (requires { One::kKey; }) what(type);
    };
    (one(static_cast<const T*>(nullptr)), ...);
  }
  static std::vector<std::string> keys() {
    std::vector<std::string> all;
    each([&]<class One>(const One*) { all.push_back(One::kKey); });
    return all;
  }
};
template <class Variant, class What>
void each_kind(const What& what) {
  KindsOf<Variant>::each(what);
}

}  // namespace birefit
