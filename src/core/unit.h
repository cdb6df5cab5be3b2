#pragma once
// Units of numbers as factors and powers of a few base units.

#include <map>
#include <optional>
#include <string>

namespace birefit {

/// factor * product of base^power; bases: um, s, K, V, N, deg, px, and any unit that is not known otherwise.
struct Unit {
  double factor = 1;
  std::map<std::string, double> powers;  ///< none is 0

  bool is_pure() const { return powers.empty(); }
  /// Same kind of quantity: to convert takes a factor.
  bool is_like(const Unit& other) const;
  /// The product with `other` to a power.
  Unit times(const Unit& other, double power) const;
  Unit to_the(double power) const;
};

/// "um", "mm2/s", "V/um", "" as structs describe them.
Unit unit_of(const std::string& text);
/// The unit that a word stands for in an expression; nothing where it stands for none.
std::optional<Unit> unit_word(const std::string& word);
/// Those words, for messages.
std::string unit_words();
/// "um", "um^2/s", "a pure number": what has this unit, in base units but for those of one factor that have a name.
std::string name_of(const Unit& unit);

}  // namespace birefit
