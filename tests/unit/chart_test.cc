// Charts and the files they are drawn into: places on the page, text of others, nothing to draw.

#include <cmath>
#include <limits>
#include <regex>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pugixml.hpp>

#include "io/report/chart.h"
#include "io/report/colour_grid.h"
#include "io/report/marks.h"

namespace birefit {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
const std::string kEvil = "</text><script>alert('1')</script>&\"\n\x1b[2J\xff";

void expect_well_formed(const std::string& svg) {
  pugi::xml_document document;
  const pugi::xml_parse_result parsed = document.load_string(svg.c_str(), pugi::parse_full);
  ASSERT_TRUE(parsed) << parsed.description() << " at " << svg.substr(static_cast<std::size_t>(parsed.offset), 80);
  EXPECT_STREQ(document.document_element().name(), "svg");
  EXPECT_STREQ(document.document_element().attribute("xmlns").value(), "http://www.w3.org/2000/svg");
  EXPECT_GT(document.document_element().attribute("width").as_double(), 0);
  EXPECT_GT(document.document_element().attribute("height").as_double(), 0);
}

Chart chart_of(std::vector<DataSeries> series) {
  Panel panel;
  panel.y_label = "y";
  panel.series = std::move(series);
  Chart chart;
  chart.title = "chart";
  chart.x_label = "x";
  chart.panels = {panel};
  return chart;
}

DataSeries points(std::vector<double> x, std::vector<double> y) {
  return {DataSeries::Kind::points, "points", std::move(x), std::move(y), "#123456", 4};
}

/// All numbers that `pattern` finds.
std::vector<double> numbers(const std::string& text, const std::string& pattern) {
  std::vector<double> found;
  const std::regex regex(pattern);
  for (auto at = std::sregex_iterator(text.begin(), text.end(), regex); at != std::sregex_iterator(); ++at)
    for (std::size_t k = 1; k < at->size(); ++k) found.push_back(std::stod((*at)[k]));
  return found;
}

TEST(Charts, ALogarithmicAxisPutsDecadesAtEqualDistances) {
  const AxisScale scale{1e-6, 1e2, 50, 850, true};
  for (int d = -6; d <= 2; ++d) EXPECT_NEAR(scale(std::pow(10, d)), 50 + 100 * (d + 6), 1e-9);
  EXPECT_FALSE(scale.has(0));
  EXPECT_FALSE(scale.has(-1));

  Chart chart = chart_of({points({1e-3, 1e-2, 1e-1, 1, 0, -1}, {1, 10, 100, 1000, 1, 1})});
  chart.log_x = chart.panels[0].log_y = true;
  const std::vector<double> at = numbers(svg_file({"", {chart}, 1, {}}), "M([0-9.]+) ([0-9.]+)h0");
  ASSERT_EQ(at.size(), 8u);  // zero and less have no place
  for (std::size_t k = 4; k < 8; ++k) EXPECT_NEAR(at[k] - at[k - 2], at[k - 2] - at[k - 4], 0.21);
  EXPECT_GT(at[2], at[0] + 50);
  EXPECT_LT(at[3], at[1] - 30);
}

TEST(Charts, LabelsOfALogarithmicAxisAreAllWrittenOutOrNoneIs) {
  int power = 0;
  for (const AxisTick& tick : axis_ticks({0.002, 2000, 0, 400, true}, 8, power, true))
    EXPECT_THAT(tick.label, Not(HasSubstr("tspan")));
  for (const AxisTick& tick : axis_ticks({1e-6, 2000, 0, 400, true}, 12, power, true))
    EXPECT_THAT(tick.label, HasSubstr("tspan"));
}

TEST(Charts, SmallTicksStandBetweenPowersOfTenWhereThereIsRoom) {
  EXPECT_EQ(small_ticks({1, 100, 0, 100, true}).size(), 17u);  // 2 .. 9, 10, 20 .. 90
  EXPECT_EQ(small_ticks({1, 1e10, 0, 100, true}).size(), 9u);
  EXPECT_TRUE(small_ticks({1, 100, 0, 100, false}).empty());
  EXPECT_TRUE(small_ticks({1, 2, 0, 100, true}).empty());
}

TEST(Charts, AnIntervalEndsWhereTheScaleSays) {
  const AxisScale x{0, 10, 100, 200}, y{0, 4, 300, 100};
  DataSeries series = points({5, 7, 8}, {2, 2, 2});
  series.low = {1, kNaN, -kInfinity};
  series.high = {3.5, 3, kInfinity};
  const std::string drawn = draw_series(series, x, y);
  EXPECT_THAT(drawn, HasSubstr("M150.0 250.0V125.0"));
  EXPECT_THAT(drawn, Not(HasSubstr("M170.0 250")));    // an end that is not known
  EXPECT_THAT(drawn, HasSubstr("M180.0 302.0V98.0"));  // without an end: out of the frame
  EXPECT_THAT(drawn, HasSubstr("M150.0 200.0h0"));

  DataSeries line{DataSeries::Kind::line, "", {0, 10}, {2, 2}, "#123456"};
  line.low = {1, 1}, line.high = {3, 3};
  EXPECT_THAT(draw_series(line, x, y), HasSubstr("M100.0 150.0L200.0 150.0L200.0 250.0L100.0 250.0z"));

  // The axis reaches over all intervals.
  series = points({1, 2}, {5, 6});
  series.low = {-100, 5}, series.high = {6, 400};
  EXPECT_THAT(svg(chart_of({series})), HasSubstr("from -100 to 400"));
}

TEST(Charts, MarksAreCirclesAndTriangles) {
  const AxisScale x{0, 10, 100, 200}, y{0, 4, 300, 100};
  DataSeries series = points({5}, {2});
  series.width = 8;
  series.mark = DataSeries::Mark::circle;
  EXPECT_THAT(draw_series(series, x, y),
              ::testing::AllOf(HasSubstr("M146.0 200.0a4.00 4.00"), HasSubstr("fill=\"none\"")));
  series.mark = DataSeries::Mark::up;
  EXPECT_THAT(draw_series(series, x, y), HasSubstr("M150.0 195.4l4.00 6.92h-8.00z"));
  series.mark = DataSeries::Mark::down;
  EXPECT_THAT(draw_series(series, x, y), HasSubstr("M150.0 204.6l4.00 -6.92h-8.00z"));
}

TEST(Charts, ASheetOfChartsIsWellFormedWhateverItSays) {
  DataSeries series = points({1, 2, 3}, {3, kNaN, 1});
  series.label = kEvil;
  Chart chart = chart_of({series});
  chart.heading = chart.x_label = chart.title = chart.panels[0].y_label = kEvil;
  chart.panels.push_back(chart.panels[0]);
  for (const int columns : {1, 2, 3, 4}) {
    const std::string file = svg_file({kEvil, {chart, chart, chart, chart, chart}, columns, {series, series}});
    expect_well_formed(file);
    EXPECT_THAT(file, Not(HasSubstr("<script")));
    EXPECT_THAT(file, HasSubstr("&lt;script&gt;"));
    EXPECT_EQ(file.find('\x1b'), std::string::npos);
    EXPECT_EQ(file.find('\xff'), std::string::npos);
  }
}

TEST(Charts, TextThatIsTooLongIsSqueezedInAFileAlone) {
  Chart chart = chart_of({points({1, 2}, {1, 2})});
  chart.x_label = std::string(400, 'x');
  EXPECT_THAT(svg_file({"", {chart}, 1, {}}), HasSubstr("textLength=\"366\""));
  EXPECT_THAT(svg(chart), Not(HasSubstr("textLength")));
}

TEST(Charts, WhatIsNoNumberIsNotDrawn) {
  for (const bool log : {false, true}) {
    for (const std::vector<double>& y :
         {std::vector<double>{}, {kNaN, kNaN}, {kInfinity, -kInfinity}, {0, 0}, {-1, kNaN}, {1}}) {
      std::vector<DataSeries> all;
      for (const DataSeries::Kind kind : {DataSeries::Kind::line, DataSeries::Kind::points})
        for (const DataSeries::Mark mark : {DataSeries::Mark::dot, DataSeries::Mark::circle, DataSeries::Mark::up}) {
          DataSeries series = points({kNaN, 1}, y);
          series.kind = kind, series.mark = mark;
          series.low = series.high = y;
          all.push_back(series);
        }
      Chart chart = chart_of(all);
      chart.log_x = chart.panels[0].log_y = log;
      const std::string file = svg_file({"", {chart}, 2, all});
      expect_well_formed(file);
      EXPECT_THAT(file, Not(::testing::ContainsRegex("[ \"ML]-?(nan|inf)")));
    }
  }
  expect_well_formed(svg_file(Sheet{}));
  expect_well_formed(svg_file({"", {Chart{}, Chart{}, Chart{}}, 2, {points({}, {})}}));
  const AxisScale scale;
  EXPECT_THAT(draw_series(points({}, {}), scale, scale), HasSubstr("d=\"\""));
}

TEST(Charts, CellsHaveTheColoursOfTheirValues) {
  ColourGrid grid;
  grid.title = grid.value_label = grid.grey_label = kEvil;
  grid.columns = {"first", kEvil};
  grid.rows = {{"group", "1e-05"}, {"group", "1"}, {kEvil, kEvil}};
  grid.palette = {{1e-4, "#000000"}, {1, "#204060"}};
  grid.cells = {{0, 0, 1e-2}, {1, 1, std::nullopt}, {2, 0, 1e-9}, {2, 1, 50}};
  const std::string file = svg_file(grid);
  expect_well_formed(file);
  for (const char* colour : {"#102030", "#cccccc", "fill=\"#000000\"", "fill=\"#204060\""})
    EXPECT_THAT(file, HasSubstr(colour));
  EXPECT_THAT(file, Not(HasSubstr("<script")));
  EXPECT_THAT(file, HasSubstr("10<tspan dy=\"-4\" font-size=\"8.5\">\u22125</tspan>"));
  const std::size_t group = file.find(">group<");
  ASSERT_NE(group, std::string::npos);
  EXPECT_EQ(file.find(">group<", group + 1), std::string::npos);  // once, at its first row
}

}  // namespace
}  // namespace birefit
