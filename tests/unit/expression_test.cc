// Arithmetic of users: values, derivatives, units, and where each is wrong.

#include "birefit/expression.h"

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <ceres/jet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "birefit/parameters.h"

namespace birefit {
namespace {

using ::testing::HasSubstr;

double value_of(const std::string& text) { return Expression(text).value({}); }

/// "column: what is wrong"; "" where nothing is.
std::string mistake(const std::string& text, const std::vector<std::string>& units = {},
                    const std::optional<std::string>& unit = std::nullopt) {
  try {
    Expression(text).settle_units(units, unit);
  } catch (const ExpressionError& error) {
    return std::to_string(error.column) + ": " + error.wrong;
  }
  return {};
}

TEST(Expression, BindsAsArithmeticDoes) {
  EXPECT_EQ(value_of("2 + 3 * 4"), 14);
  EXPECT_EQ(value_of("(2 + 3) * 4"), 20);
  EXPECT_EQ(value_of("10 - 3 - 2"), 5);
  EXPECT_EQ(value_of("16 / 4 / 2"), 2);
  EXPECT_EQ(value_of("2 ^ 3 ^ 2"), 512);
  EXPECT_EQ(value_of("-2 ^ 2"), -4);
  EXPECT_EQ(value_of("2 ^ -1"), 0.5);
  EXPECT_EQ(value_of("2 * -3"), -6);
  EXPECT_EQ(value_of("--2 - +1"), 1);
  EXPECT_EQ(value_of("1e-3 * 2E3"), 2);
  EXPECT_EQ(value_of(".5 * 4"), 2);
  EXPECT_EQ(value_of("sqrt(16) + abs(-2) * log10(1000) - log(exp(1))"), 9);
  EXPECT_DOUBLE_EQ(value_of("sin(30 * deg) + cos(pi / 3) + tan(pi / 4)"), 2);
}

TEST(Expression, ReadsNamesOnceAndUnitsNotAtAll) {
  const Expression e("sample.cell.thickness_um * 2 + micrographs[12].a.b[3] + 3 * um - sample.cell.thickness_um");
  ASSERT_EQ(e.names().size(), 2u);
  EXPECT_EQ(e.names()[0].text, "sample.cell.thickness_um");
  EXPECT_EQ(e.names()[1].text, "micrographs[12].a.b[3]");
  EXPECT_EQ(e.names()[1].column, 32);
  EXPECT_FALSE(e.is_plain());
  EXPECT_TRUE(Expression("2 * pi").is_plain());
  EXPECT_FALSE(Expression("2 * um").is_plain());
}

TEST(Expression, IsWhatNoOtherWordIs) {
  for (const char* text : {"2 * 3", "a.b", "2*um", "sqrt(2)", "1/3", "a - b", "2^3", "-a.b", "19.28 / 5.21"})
    EXPECT_TRUE(Expression::is_one(text)) << text;
  for (const char* text : {"", "9.3", "-1e-4", "+2", "9.3 um", "auto", "none", "1,5", "5-10", "2026-11-27", "N/A",
                           "9.3 +- 0.1", ".nan", "-.inf", "thickness_um", "a,b"})
    EXPECT_FALSE(Expression::is_one(text)) << text;
}

TEST(Expression, SaysWhereItIsWrong) {
  EXPECT_EQ(mistake("2 * (3 + 4"), "11: the parenthesis of column 5 is not closed");
  EXPECT_EQ(mistake("2 * "), "5: the expression ends where a number or a name is expected");
  EXPECT_EQ(mistake("2 ** 3"), "4: '**' is not expected here");
  EXPECT_EQ(mistake("2 3"), "3: '3' is not expected here");
  EXPECT_EQ(mistake("1 + sinh(2)"), "5: sinh is no function");
  EXPECT_EQ(mistake("a.b[ + 1"), "4: '[' is not expected here");
  EXPECT_THAT(mistake(std::string(3000, '1')), HasSubstr("longer"));
  EXPECT_THAT(mistake(std::string(1000, '(')), HasSubstr("nested"));
  EXPECT_THAT(mistake(std::string(1000, '-')), HasSubstr("nested"));
  EXPECT_NE(mistake(std::string("1 + \0", 5)), "");
}

/// A slope each, by the dual numbers of another library.
TEST(Expression, HasExactDerivatives) {
  using Jet = ceres::Jet<double, 3>;
  const std::string text =
      "sqrt(a.a) * sin(b.b) ^ 3 / (1 + exp(-c.c)) + atan(a.a / b.b) - log10(a.a ^ b.b) * abs(-c.c) + "
      "acos(0.3 * b.b) + tan(b.b) - asin(b.b / 3) + cos(c.c) ^ 2 - a.a ^ -2 * log(c.c)";
  const auto by_hand = [](const Jet& a, const Jet& b, const Jet& c) {
    return sqrt(a) * pow(sin(b), 3.0) / (1.0 + exp(-c)) + atan2(a / b, Jet(1.0)) -
           log(pow(a, b)) / std::numbers::ln10 * abs(-c) + acos(0.3 * b) + tan(b) - asin(b / 3.0) + cos(c) * cos(c) -
           log(c) / (a * a);
  };
  const Expression e(text);
  for (const auto& [a, b, c] : {std::array{2.0, 0.7, 1.3}, std::array{0.4, 1.1, 0.2}, std::array{30.0, 0.1, 5.0}}) {
    const Jet expected = by_hand(Jet(a, 0), Jet(b, 1), Jet(c, 2));
    std::vector<double> slopes;
    EXPECT_NEAR(e.value({a, b, c}, slopes), expected.a, 1e-13 * (1 + std::abs(expected.a)));
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(slopes[static_cast<std::size_t>(k)], expected.v[k], 1e-12 * (1 + std::abs(expected.v[k]))) << k;
  }
}

TEST(Expression, HasDerivativesWhereAPartHasNone) {
  std::vector<double> slopes;
  EXPECT_EQ(Expression("a.a ^ 2 * b.b").value({0, 3}, slopes), 0);
  EXPECT_EQ(slopes, (std::vector<double>{0, 0}));
  EXPECT_EQ(Expression("a.a ^ 2").value({-3}, slopes), 9);  // no logarithm of what is negative
  EXPECT_EQ(slopes, (std::vector<double>{-6}));
  EXPECT_EQ(Expression("a.a ^ b.b").value({0, 2}, slopes), 0);  // at the end of a range
  EXPECT_EQ(slopes, (std::vector<double>{0, 0}));
  EXPECT_EQ(Expression("a.a ^ 0").value({0}, slopes), 1);
  EXPECT_EQ(slopes, (std::vector<double>{0}));
  EXPECT_EQ(Expression("sqrt(0) + a.a").value({1}, slopes), 1);  // nor a root's slope that nothing takes
  EXPECT_EQ(slopes, (std::vector<double>{1}));
}

TEST(Expression, ConvertsUnits) {
  Expression retardance("a.thickness_um * b.birefringence");
  retardance.settle_units({"um", ""}, "nm");
  EXPECT_DOUBLE_EQ(retardance.value({5, 0.12}), 600);
  std::vector<double> slopes;
  retardance.value({5, 0.12}, slopes);
  EXPECT_DOUBLE_EQ(slopes[0], 120);
  EXPECT_DOUBLE_EQ(slopes[1], 5000);

  Expression sum("a.a + b.b + 2 * mm");
  sum.settle_units({"um", "nm"}, "um");
  EXPECT_DOUBLE_EQ(sum.value({1, 500}), 2001.5);

  Expression fourier("a.diffusivity * b.time / c.thickness ^ 2");
  fourier.settle_units({"mm2/s", "s", "um"}, "");
  EXPECT_NEAR(fourier.value({0.1, 2, 1000}), 0.2, 1e-15);

  Expression phase("360 * deg * a.a / b.b");
  phase.settle_units({"nm", "um"}, "deg");
  EXPECT_DOUBLE_EQ(phase.value({147.5, 0.59}), 90);

  Expression angle("sin(a.azimuth_deg)");
  angle.settle_units({"deg"}, "");
  EXPECT_NEAR(angle.value({30}), 0.5, 1e-15);

  Expression stress("a.a * b.b");  // a brewster is 1e-12/Pa
  stress.settle_units({"brewster", "MPa"}, "");
  EXPECT_NEAR(stress.value({50, 2}), 1e-4, 1e-18);
}

TEST(Expression, WorksOutTheUnitOfItsResult) {
  const auto unit = [](const std::string& text, const std::vector<std::string>& units) {
    Expression e(text);
    e.settle_units(units, std::nullopt);
    return e.unit();
  };
  EXPECT_EQ(unit("a.a / b.b", {"pN", "pN"}), "");
  EXPECT_EQ(unit("a.a + b.b", {"pN", "pN"}), "pN");
  EXPECT_EQ(unit("a.a * b.b", {"um", ""}), "um");
  EXPECT_EQ(unit("a.a * b.b", {"nm", ""}), "nm");
  EXPECT_EQ(unit("a.a / b.b", {"V", "um"}), "V/um");
  EXPECT_EQ(unit("a.a ^ 2 / b.b", {"um", "s"}), "um^2/s");
  EXPECT_EQ(unit("sqrt(a.a * b.b)", {"um", "um"}), "um");
  EXPECT_EQ(unit("asin(a.a)", {""}), "deg");
  Expression inverse("asin(a.a)");
  inverse.settle_units({""}, std::nullopt);
  EXPECT_NEAR(inverse.value({0.5}), 30, 1e-12);
}

TEST(Expression, RefusesWhatUnitsDoNotAllow) {
  EXPECT_EQ(mistake("a.a + b.b", {"um", "deg"}), "5: um and deg do not add");
  EXPECT_EQ(mistake("a.a - 2", {"um"}), "5: um and a pure number do not subtract");
  EXPECT_EQ(mistake("2 * a.a", {"um"}, "deg"), "1: the expression is in um, and not in deg");
  EXPECT_EQ(mistake("2 * 3 * a.a", {""}, "um"), "1: the expression is a pure number, and not in um");
  EXPECT_EQ(mistake("exp(a.a)", {"K"}), "1: exp takes a pure number, not K");
  EXPECT_EQ(mistake("sin(a.a)", {"um"}), "1: sin takes an angle, not um");
  EXPECT_EQ(mistake("2 ^ a.a", {"um"}), "3: an exponent takes a pure number, not um");
  EXPECT_EQ(mistake("a.a ^ b.b", {"um", ""}), "5: um is raised to a power that is no constant");
  EXPECT_EQ(mistake("a.a ^ (1 / 2 + 1.5)", {"um"}, "um"), "1: the expression is in um^2, and not in um");
}

ParameterTable table_of(const std::vector<double>& values) {
  ParameterTable table;
  for (std::size_t i = 0; i < values.size(); ++i) table.add_constant("n" + std::to_string(i), values[i]);
  return table;
}
Tie tie_of(const std::string& text, std::vector<int> of) { return {std::make_shared<Expression>(text), std::move(of)}; }

TEST(Ties, FollowByTheChainRule) {
  ParameterTable table = table_of({2, 3, 0, 0});
  table.tie(2, tie_of("a.a * b.b", {0, 1}));
  table.tie(3, tie_of("a.a ^ 2 + b.b", {2, 0}));
  Theta theta = table.values();
  EXPECT_EQ(theta, (Theta{2, 3, 6, 38}));
  theta[0] = 1;
  table.follow(theta);
  EXPECT_EQ(theta, (Theta{1, 3, 3, 10}));
  const std::vector<TieSlope> slopes = table.slopes(3, theta);
  ASSERT_EQ(slopes.size(), 2u);
  EXPECT_EQ(slopes[0].index, 0);
  EXPECT_EQ(slopes[0].by, 2 * 3 * 3 + 1);
  EXPECT_EQ(slopes[1].index, 1);
  EXPECT_EQ(slopes[1].by, 2 * 3 * 1);
  EXPECT_EQ(table.roots(3), (std::vector<int>{0, 1}));
  EXPECT_EQ(table.roots(1), (std::vector<int>{1}));
}

TEST(Ties, AreWorkedOutInTheirTurnWhicheverComesFirst) {
  ParameterTable table = table_of({2, 0, 0});
  table.tie(2, tie_of("a.a + 1", {1}));
  table.tie(1, tie_of("a.a * 10", {0}));
  EXPECT_EQ(table.values(), (Theta{2, 20, 21}));
  EXPECT_EQ(table.tied(), (std::vector<int>{1, 2}));
  EXPECT_THROW(table.tie(0, tie_of("a.a", {2})), std::logic_error);
  EXPECT_THROW(table.tie(1, tie_of("a.a", {0})), std::logic_error);
}

TEST(Ties, StayAtTheEndOfWhatANumberMayBe) {
  ParameterTable table = table_of({2, 0.5});
  table[1].lower = 0, table[1].upper = 4;
  table.tie(1, tie_of("sqrt(a.a) * 3", {0}));
  Theta theta = table.values();
  EXPECT_EQ(theta[1], 4);
  EXPECT_TRUE(table.is_held(1, theta));
  EXPECT_TRUE(table.slopes(1, theta).empty());
  theta[0] = 1;
  table.follow(theta);
  EXPECT_EQ(theta[1], 3);
  EXPECT_FALSE(table.is_held(1, theta));
  theta[0] = -1;  // no number: what it began with
  table.follow(theta);
  EXPECT_EQ(theta[1], 0.5);
  EXPECT_TRUE(table.is_held(1, theta));
}

TEST(Ties, ReachAsFarAsBoundsLetThem) {
  ParameterTable table = table_of({2, 3, 0});
  table[0].free = true, table[0].lower = 1, table[0].upper = 5;
  table.tie(2, tie_of("a.a - b.b", {1, 0}));
  EXPECT_EQ(table.reach(2), std::pair(-2.0, 2.0));
  EXPECT_EQ(table.reach(0), std::pair(1.0, 5.0));
  EXPECT_EQ(table.reach(1), std::pair(3.0, 3.0));
}

}  // namespace
}  // namespace birefit
