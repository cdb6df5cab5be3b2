#include "birefit/expression.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "core/scalar.h"
#include "core/unit.h"

namespace birefit {
namespace {

using Graded = Dual<double, 1>;

/// What a function makes of units.
enum class Takes { pure, angle, any, root, gives_angle };
struct Function {
  const char* name;
  Takes takes;
  double (*value)(double);
  double (*slope)(double x, double value);
};
constexpr double kLn10 = std::numbers::ln10;
const std::array<Function, 11> kFunctions{{
    {"sqrt", Takes::root, [](double x) { return std::sqrt(x); }, [](double, double v) { return 0.5 / v; }},
    {"exp", Takes::pure, [](double x) { return std::exp(x); }, [](double, double v) { return v; }},
    {"log", Takes::pure, [](double x) { return std::log(x); }, [](double x, double) { return 1 / x; }},
    {"log10", Takes::pure, [](double x) { return std::log10(x); }, [](double x, double) { return 1 / (kLn10 * x); }},
    {"sin", Takes::angle, [](double x) { return std::sin(x); }, [](double x, double) { return std::cos(x); }},
    {"cos", Takes::angle, [](double x) { return std::cos(x); }, [](double x, double) { return -std::sin(x); }},
    {"tan", Takes::angle, [](double x) { return std::tan(x); }, [](double, double v) { return 1 + v * v; }},
    {"asin", Takes::gives_angle, [](double x) { return std::asin(x); },
     [](double x, double) { return 1 / std::sqrt(1 - x * x); }},
    {"acos", Takes::gives_angle, [](double x) { return std::acos(x); },
     [](double x, double) { return -1 / std::sqrt(1 - x * x); }},
    {"atan", Takes::gives_angle, [](double x) { return std::atan(x); },
     [](double x, double) { return 1 / (1 + x * x); }},
    {"abs", Takes::any, [](double x) { return std::abs(x); },
     [](double x, double) { return x > 0   ? 1.0
                                   : x < 0 ? -1.0
                                           : 0.0; }},
}};

/// `turn`: from degrees to radians of what is an angle, and back of what becomes one.
double apply(const Function& f, double x, double turn) {
  return f.takes == Takes::gives_angle ? turn * f.value(x) : f.value(turn * x);
}
Graded apply(const Function& f, const Graded& x, double turn) {
  const bool gives = f.takes == Takes::gives_angle;
  const double in = gives ? x.value : turn * x.value, value = f.value(in);
  return x.d[0] == 0 ? Graded(gives ? turn * value : value)
                     : x.chain(gives ? turn * value : value, turn * f.slope(in, value));
}
double power(double a, double b) { return std::pow(a, b); }
/// Each part by itself: a constant exponent takes any base, a logarithm only positive ones.
Graded power(const Graded& a, const Graded& b) {
  Graded r(std::pow(a.value, b.value));
  if (a.d[0] != 0 && b.value != 0) r.d[0] += b.value * std::pow(a.value, b.value - 1) * a.d[0];
  if (b.d[0] != 0 && r.value != 0) r.d[0] += r.value * std::log(a.value) * b.d[0];
  return r;
}

bool is_letter(char c) { return std::isalpha(static_cast<unsigned char>(c)) || c == '_'; }
bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)); }

/// How far a number reaches; `at` where there is none.
std::size_t end_of_number(const std::string& text, std::size_t at, double& number) {
  if (at >= text.size() || !(is_digit(text[at]) || text[at] == '.')) return at;
  const auto [stop, error] = std::from_chars(text.data() + at, text.data() + text.size(), number);
  return error == std::errc{} ? static_cast<std::size_t>(stop - text.data()) : at;
}

/// How far a name reaches: keys between points, each with a number in brackets or without.
std::size_t end_of_name(const std::string& text, std::size_t at) {
  while (at < text.size() && is_letter(text[at])) {
    while (at < text.size() && (is_letter(text[at]) || is_digit(text[at]))) ++at;
    if (at < text.size() && text[at] == '[') {
      std::size_t close = at + 1;
      while (close < text.size() && is_digit(text[close])) ++close;
      if (close == at + 1 || close == text.size() || text[close] != ']') return at;
      at = close + 1;
    }
    if (at + 1 >= text.size() || text[at] != '.' || !is_letter(text[at + 1])) return at;
    ++at;
  }
  return at;
}

}  // namespace

/// Recursive descent: sum, product, sign, power, atom.
class ExpressionParser {
 public:
  explicit ExpressionParser(Expression& into) : e_(into), text_(into.text_) {}

  void parse() {
    constexpr std::size_t kLongest = 2000;
    if (text_.size() > kLongest) throw ExpressionError(1, "the expression is longer than 2000 characters");
    sum();
    if (!at_end()) fail(fmt::format("'{}' is not expected here", text_[at_]), "an operator: + - * / ^");
  }

 private:
  using Op = Expression::Op;

  [[noreturn]] void fail(const std::string& what, const std::string& hint = {}) const {
    throw ExpressionError(column(), what, hint);
  }
  int column() const { return static_cast<int>(at_) + 1; }
  bool at_end() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
    return at_ >= text_.size();
  }
  bool takes(char c) {
    if (at_end() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  void push(Op op, int column) {
    Expression::Step step;
    step.op = op, step.column = column;
    e_.steps_.push_back(std::move(step));
  }
  void binary(Op op, void (ExpressionParser::*right)()) {
    const int column = static_cast<int>(at_);  // of the sign, which was just taken
    (this->*right)();
    push(op, column);
  }

  void sum() {
    product();
    for (;;) {
      if (takes('+'))
        binary(Op::add, &ExpressionParser::product);
      else if (takes('-'))
        binary(Op::subtract, &ExpressionParser::product);
      else
        return;
    }
  }
  void product() {
    sign();
    for (;;) {
      if (takes('*')) {
        if (at_ < text_.size() && text_[at_] == '*') fail("'**' is not expected here", "a power is written ^");
        binary(Op::multiply, &ExpressionParser::sign);
      } else if (takes('/')) {
        binary(Op::divide, &ExpressionParser::sign);
      } else {
        return;
      }
    }
  }
  /// -2^2 is -(2^2), 2^-1 a half.
  void sign() {
    constexpr int kDeepest = 100;
    if (++depth_ > kDeepest) fail("the expression is nested too deeply");
    if (takes('-')) {
      const int column = static_cast<int>(at_);
      sign();
      push(Op::negate, column);
    } else if (takes('+')) {
      sign();
    } else {
      atom();
      if (takes('^')) binary(Op::power, &ExpressionParser::sign);
    }
    --depth_;
  }
  void atom() {
    if (at_end()) fail("the expression ends where a number or a name is expected");
    const int column = this->column();
    if (takes('(')) {
      sum();
      if (!takes(')')) fail(fmt::format("the parenthesis of column {} is not closed", column), "add )");
      return;
    }
    Expression::Step step;
    step.column = column;
    if (const std::size_t end = end_of_number(text_, at_, step.number); end > at_) {
      at_ = end;
      e_.steps_.push_back(std::move(step));
      return;
    }
    const std::size_t end = end_of_name(text_, at_);
    if (end == at_) fail(fmt::format("'{}' is not expected here", text_[at_]), "a number, a name or a parenthesis");
    const std::string word = text_.substr(at_, end - at_);
    at_ = end;
    if (takes('(')) {
      call(word, column);
      return;
    }
    if (word == "pi") {
      step.number = std::numbers::pi;
    } else if (const std::optional<Unit> unit = unit_word(word)) {
      step.number = unit->factor, step.unit = word;
      e_.plain_ = false;
    } else {
      step.op = Op::name;
      step.index = name(word, column);
    }
    e_.steps_.push_back(std::move(step));
  }
  void call(const std::string& word, int column) {
    const auto found =
        std::find_if(kFunctions.begin(), kFunctions.end(), [&](const auto& f) { return word == f.name; });
    if (found == kFunctions.end()) {
      std::string known;
      for (const Function& f : kFunctions) known += (known.empty() ? "" : ", ") + std::string(f.name);
      throw ExpressionError(column, word + " is no function", "known here: " + known);
    }
    sum();
    if (!takes(')')) fail(fmt::format("the parenthesis of {} is not closed", word), "add )");
    push(Op::call, column);
    e_.steps_.back().index = static_cast<int>(found - kFunctions.begin());
    e_.steps_.back().number = 1;
  }
  int name(const std::string& word, int column) {
    e_.plain_ = false;
    const auto found = std::find_if(e_.names_.begin(), e_.names_.end(), [&](const auto& n) { return n.text == word; });
    if (found != e_.names_.end()) return static_cast<int>(found - e_.names_.begin());
    e_.names_.push_back({word, column});
    return static_cast<int>(e_.names_.size()) - 1;
  }

  Expression& e_;
  const std::string& text_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

Expression::Expression(std::string text) : text_(std::move(text)) {
  ExpressionParser(*this).parse();
  to_coherent_.assign(names_.size(), 1);
  if (names_.empty()) settle_units({}, std::nullopt);
}

bool Expression::is_one(const std::string& text) {
  // A path of keys, a sign between spaces, or one that no word, date or range has: 2026-11-27, 5-10, N/A.
  double number = 0;
  const auto is_space = [&](std::size_t at) { return at < text.size() && text[at] == ' '; };
  const bool digits = std::any_of(text.begin(), text.end(), is_digit);
  for (std::size_t at = text.find_first_not_of("+- "); at < text.size();) {
    if (const std::size_t end = end_of_number(text, at, number); end > at) {
      at = end;
    } else if (is_letter(text[at])) {
      const std::size_t end = end_of_name(text, at);
      if (text.find('.', at) < end) return true;
      at = std::max(end, at + 1);
    } else {
      const char c = text[at];
      if (c == '*' || c == '^' || c == '(' || (c == '/' && digits)) return true;
      if ((c == '+' || c == '-' || c == '/') && at > 0 && is_space(at - 1) && is_space(at + 1)) return true;
      ++at;
    }
  }
  return false;
}

void Expression::settle_units(const std::vector<std::string>& of_names, const std::optional<std::string>& result) {
  struct Item {
    Unit unit;                       ///< of what is on the stack
    std::optional<double> constant;  ///< where it is a plain number that reads nothing
  };
  std::vector<Item> stack;
  const auto pop = [&] {
    Item top = std::move(stack.back());
    stack.pop_back();
    return top;
  };
  for (Step& step : steps_) {
    const auto pure = [&](const Item& item, const std::string& what) {
      if (!item.unit.is_pure())
        throw ExpressionError(step.column, fmt::format("{} takes a pure number, not {}", what, name_of(item.unit)),
                              "divide by what has that unit");
    };
    switch (step.op) {
      case Op::number:
        stack.push_back({step.unit.empty() ? Unit{} : unit_of(step.unit),
                         step.unit.empty() ? std::optional(step.number) : std::nullopt});
        break;
      case Op::name: {
        const Unit unit = unit_of(of_names.at(static_cast<std::size_t>(step.index)));
        to_coherent_[static_cast<std::size_t>(step.index)] = unit.factor;
        stack.push_back({unit, std::nullopt});
        break;
      }
      case Op::add:
      case Op::subtract: {
        const Item right = pop(), left = pop();
        if (!left.unit.is_like(right.unit)) {
          const bool number = left.unit.is_pure() || right.unit.is_pure();
          throw ExpressionError(step.column,
                                fmt::format("{} and {} do not {}", name_of(left.unit), name_of(right.unit),
                                            step.op == Op::add ? "add" : "subtract"),
                                number ? fmt::format("give the number its unit: 2 * {}",
                                                     name_of(left.unit.is_pure() ? right.unit : left.unit))
                                       : "");
        }
        std::optional<double> constant;
        if (left.constant && right.constant)
          constant = *left.constant + (step.op == Op::add ? *right.constant : -*right.constant);
        // The unit of the first, by name; all is counted in base units.
        stack.push_back({left.unit, constant});
        break;
      }
      case Op::multiply:
      case Op::divide: {
        const Item right = pop(), left = pop();
        std::optional<double> constant;
        if (left.constant && right.constant)
          constant = step.op == Op::multiply ? *left.constant * *right.constant : *left.constant / *right.constant;
        Unit unit = left.unit.times(right.unit, step.op == Op::multiply ? 1 : -1);
        stack.push_back({std::move(unit), constant});
        break;
      }
      case Op::power: {
        const Item exponent = pop(), base = pop();
        pure(exponent, "an exponent");
        if (!base.unit.is_pure() && !exponent.constant)
          throw ExpressionError(step.column,
                                fmt::format("{} is raised to a power that is no constant", name_of(base.unit)),
                                "only a pure number has such powers");
        std::optional<double> constant;
        if (base.constant && exponent.constant) constant = std::pow(*base.constant, *exponent.constant);
        stack.push_back({base.unit.to_the(exponent.constant.value_or(1)), constant});
        break;
      }
      case Op::negate:
        if (stack.back().constant) stack.back().constant = -*stack.back().constant;
        break;
      case Op::call: {
        const Function& f = kFunctions[static_cast<std::size_t>(step.index)];
        Item of = pop();
        if (f.takes == Takes::pure || f.takes == Takes::gives_angle) pure(of, f.name);
        if (f.takes == Takes::angle && !of.unit.is_pure() && !of.unit.is_like(unit_of("deg")))
          throw ExpressionError(step.column, fmt::format("{} takes an angle, not {}", f.name, name_of(of.unit)),
                                "without a unit it is in radians");
        constexpr double kDegPerRad = 180 / std::numbers::pi;
        step.number = f.takes == Takes::angle && !of.unit.is_pure() ? 1 / kDegPerRad
                      : f.takes == Takes::gives_angle               ? kDegPerRad
                                                                    : 1;
        Unit unit = f.takes == Takes::root          ? of.unit.to_the(0.5)
                    : f.takes == Takes::any         ? of.unit
                    : f.takes == Takes::gives_angle ? unit_of("deg")
                                                    : Unit{};
        stack.push_back(
            {std::move(unit), of.constant ? std::optional(apply(f, *of.constant, step.number)) : std::nullopt});
        break;
      }
    }
  }
  Unit unit = stack.back().unit;
  if (result) {
    const Unit wanted = unit_of(*result);
    if (!unit.is_like(wanted))
      throw ExpressionError(
          1,
          fmt::format("the expression is {}, and not {}", unit.is_pure() ? name_of(unit) : "in " + name_of(unit),
                      wanted.is_pure() ? name_of(wanted) : "in " + *result),
          unit.is_pure() ? fmt::format("give it its unit: .. * {}", *result) : "");
    from_coherent_ = 1 / wanted.factor;
    unit_ = *result;
    return;
  }
  // In the unit of a number that it reads, where one is of that kind.
  unit.factor = 1;
  unit_ = unit.is_pure() ? "" : name_of(unit);
  from_coherent_ = 1;
  for (auto name = of_names.rbegin(); name != of_names.rend(); ++name)
    if (const Unit of = unit_of(*name); !unit.is_pure() && of.is_like(unit))
      unit_ = *name, from_coherent_ = 1 / of.factor;
}

template <class S>
S Expression::evaluate(const std::vector<S>& numbers) const {
  std::vector<S> stack;
  stack.reserve(steps_.size());
  for (const Step& step : steps_) {
    if (step.op == Op::number) {
      stack.push_back(S(step.number));
      continue;
    }
    if (step.op == Op::name) {
      const auto at = static_cast<std::size_t>(step.index);
      stack.push_back(numbers[at] * to_coherent_[at]);
      continue;
    }
    const S last = stack.back();
    if (step.op == Op::negate) {
      stack.back() = -last;
      continue;
    }
    if (step.op == Op::call) {
      stack.back() = apply(kFunctions[static_cast<std::size_t>(step.index)], last, step.number);
      continue;
    }
    stack.pop_back();
    S& first = stack.back();
    if (step.op == Op::add) first = first + last;
    if (step.op == Op::subtract) first = first - last;
    if (step.op == Op::multiply) first = first * last;
    if (step.op == Op::divide) first = first / last;
    if (step.op == Op::power) first = power(first, last);
  }
  return stack.back() * from_coherent_;
}

double Expression::value(const std::vector<double>& numbers) const { return evaluate(numbers); }

double Expression::value(const std::vector<double>& numbers, std::vector<double>& slopes) const {
  slopes.resize(names_.size());
  std::vector<Graded> graded(numbers.begin(), numbers.end());
  for (std::size_t k = 0; k < names_.size(); ++k) {
    graded[k].d[0] = 1;
    slopes[k] = evaluate(graded).d[0];
    graded[k].d[0] = 0;
  }
  return evaluate(numbers);
}

}  // namespace birefit
