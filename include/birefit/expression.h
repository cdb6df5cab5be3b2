#pragma once
// Arithmetic of a user's between numbers of a config: "2 * sample.cell.thickness_um". With exact derivatives, and with
// units: um and nm convert, um and deg do not add (docs/configuration.md, "Ties and derived quantities").

#include <exception>
#include <optional>
#include <string>
#include <vector>

namespace birefit {

/// A mistake in an expression's text, or in what it does with units.
struct ExpressionError : std::exception {
  /// At a column of the text, from 1: what is wrong, what to do.
  ExpressionError(int at, std::string is_wrong, std::string to_do = {})
      : column(at), wrong(std::move(is_wrong)), hint(std::move(to_do)) {}
  /// What is wrong.
  const char* what() const noexcept override { return wrong.c_str(); }
  int column = 1;
  std::string wrong, hint;
};

/// Text as arithmetic: numbers, names of numbers, units (um, nm, mm, cm, deg, rad, K, V, N, pN, MPa, s, px, brewster),
/// pi, + - * / ^ with unary minus and parentheses, sqrt, exp, log, log10, sin, cos, tan, asin, acos, atan, abs. Angles
/// know that they are in degrees, which asin, acos and atan give; what sin, cos and tan take without a unit is in
/// radians.
class Expression {
 public:
  /// Throws ExpressionError where the text is none. Of numbers and units alone, units are settled.
  explicit Expression(std::string text);

  /// A number that it reads.
  struct Name {
    std::string text;  ///< as it stands: a path or the end of one
    int column = 1;    ///< of its first place, from 1
  };

  /// Whether a config's word is meant as one: not a number, not a number with a unit behind it, not a single word.
  static bool is_one(const std::string& text);
  /// As it was written.
  const std::string& text() const { return text_; }
  /// What it reads, each name once, in the order of the text.
  const std::vector<Name>& names() const { return names_; }
  /// Numbers alone: neither names nor units.
  bool is_plain() const { return plain_; }

  /// States the units of what it reads ("um", "mm2/s", "" of a pure number; in the order of names()) and that of the
  /// result; without one it is worked out. Throws ExpressionError where they do not go together; names both.
  void settle_units(const std::vector<std::string>& of_names, const std::optional<std::string>& result);
  /// That of the result, once units are settled: "um", "um^2/s", "".
  const std::string& unit() const { return unit_; }

  /// The result, of numbers in their units. Without settled units all are taken as they are. May be no number (a root
  /// of what is negative).
  double value(const std::vector<double>& numbers) const;
  /// The same with its derivatives by the numbers, exact.
  double value(const std::vector<double>& numbers, std::vector<double>& slopes) const;

 private:
  friend class ExpressionParser;
  enum class Op { number, name, add, subtract, multiply, divide, power, negate, call };
  struct Step {
    Op op = Op::number;
    double number = 0;  ///< of a number or a unit, in coherent units; of a function, see apply()
    int index = 0;      ///< of a name, or of a function
    int column = 1;
    std::string unit;  ///< of a number that is a unit
  };
  template <class S>
  S evaluate(const std::vector<S>& numbers) const;

  std::string text_;
  std::vector<Step> steps_;  ///< each takes its arguments from a stack
  std::vector<Name> names_;
  bool plain_ = true;
  std::vector<double> to_coherent_;  ///< factors of the names' units
  double from_coherent_ = 1;
  std::string unit_;
};

}  // namespace birefit
