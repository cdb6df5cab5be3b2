// birefit stress: sweeps into the places where transport methods fail, as a table and a picture.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <vector>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/output.h"
#include "birefit/io.h"
#include "birefit/study.h"
#include "io/report/chart.h"
#include "io/report/colour_grid.h"

namespace birefit {
namespace {

struct StressArguments {
  std::string out = "out/stress";
  bool quick = false, quiet = false;
};

std::string table(const std::vector<StressPoint>& points) {
  std::string text = "sweep,value,method,error,estimate,medium_samples,flag\n";
  for (const StressPoint& p : points)
    text += fmt::format("{},{:.6g},{},{},{},{},\"{}\"\n", p.sweep, p.value, p.method, csv_number(p.error),
                        csv_number(p.estimate), csv_number(p.samples), p.flag);
  return text;
}

/// Whole pictures have no place among the rays.
bool of_picture(const StressPoint& p) { return p.method.find(" of a ") != std::string::npos; }

/// A cell for every place and method: its error where it answers, grey where it says that it cannot.
ColourGrid errors_grid(const std::vector<StressPoint>& points) {
  ColourGrid grid;
  grid.title = "error of every method in every trap; grey where the method flags its own answer";
  grid.palette = {{1e-14, "#0072B2"}, {1e-9, "#56B4E9"}, {1e-6, "#009E73"}, {1e-4, "#F0E442"}, {1e-2, "#D55E00"}};
  grid.value_label = "error";
  grid.grey_label = "flagged by the method itself";
  for (const StressPoint& p : points) {
    if (of_picture(p)) continue;
    const std::string value = fmt::format("{:g}", p.value);
    if (grid.rows.empty() || grid.rows.back().group != p.sweep || grid.rows.back().name != value)
      grid.rows.push_back({p.sweep, value});
    auto column = std::find(grid.columns.begin(), grid.columns.end(), p.method);
    if (column == grid.columns.end()) column = grid.columns.insert(column, p.method);
    ColourGrid::Cell cell{grid.rows.size() - 1, static_cast<std::size_t>(column - grid.columns.begin()), {}};
    if (p.flag.empty()) cell.value = p.error;
    if (!p.flag.empty() || std::isfinite(p.error)) grid.cells.push_back(cell);
  }
  return grid;
}

/// Pictures by wave optics: error against the method's own estimate. The law: no point above the diagonal.
Sheet waves_sheet(const std::vector<StressPoint>& points) {
  Panel panel;
  panel.y_label = "error of the picture";
  panel.height = 440;
  panel.log_y = true;
  panel.y_range = {1e-13, 20};
  panel.series.push_back({DataSeries::Kind::line, "the law: not above", {1e-13, 20}, {1e-13, 20}, "#000000", 1});
  for (const auto& [name, colour] : {std::pair{"series", "#0072B2"}, {"split_step", "#D55E00"}, {"march", "#009E73"}}) {
    DataSeries series{DataSeries::Kind::points, name, {}, {}, colour, 5};
    for (const StressPoint& p : points)
      if (p.sweep.starts_with("wave_") && p.method == fmt::format("{} of a ball", name) && p.flag.empty() &&
          p.error > 1e-12)
        series.x.push_back(p.estimate), series.y.push_back(p.error);
    panel.series.push_back(std::move(series));
  }
  Chart chart;
  chart.title = "error of wave pictures against what their method says of it";
  chart.x_label = "what the method says of its error";
  chart.log_x = true;
  chart.x_range = {1e-12, 20};
  chart.width = 600;
  chart.panels = {std::move(panel)};
  return {chart.title, {chart}, 1, {}};
}

int run_stress(const StressArguments& arguments) {
  const std::filesystem::path out = arguments.out;
  make_folder(arguments.out);
  const std::vector<StressPoint> points = measure_stress(arguments.quick, [&](const std::string& what) {
    if (!arguments.quiet) std::cerr << "sweeping " << what << "\n";
  });
  write_file(out / "stress.csv", table(points));
  write_file(out / "stress.svg", svg_file(errors_grid(points)));
  write_file(out / "stress_waves.svg", svg_file(waves_sheet(points)));
  int broken = 0, flagged = 0, unknown = 0;
  for (const StressPoint& p : points) {
    if (!p.flag.empty())
      ++flagged;
    else if (std::isnan(p.error))
      ++unknown;
    else
      broken += p.error > p.estimate + 1e-10;  // the truth is known to 1e-11
  }
  if (!arguments.quiet)
    std::cout << fmt::format(
        "{}: {} answers, {} of them flagged by their method, {} without a known truth, {} beyond their own estimate\n",
        (out / "stress.csv").string(), points.size(), flagged, unknown, broken);
  return kExitDone;
}

}  // namespace

Command add_stress_command(CLI::App& app) {
  auto arguments = std::make_shared<StressArguments>();
  CLI::App* command =
      app.add_subcommand("stress", "sweeps into the places where transport methods fail: error, own estimate, flag");
  command->add_option("--out", arguments->out, "folder for stress.csv, stress.svg and stress_waves.svg")
      ->capture_default_str();
  command->add_flag("--quick", arguments->quick, "fewer places");
  command->add_flag("-q,--quiet", arguments->quiet, "say nothing");
  return {command, [arguments] { return run_stress(*arguments); }};
}

}  // namespace birefit
