// birefit chart: every transport method's speed against its accuracy, as tables and pictures.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/output.h"
#include "birefit/io.h"
#include "birefit/study.h"
#include "io/report/chart.h"

namespace birefit {
namespace {

/// Okabe and Ito's colours and one of Tol's, told apart by every eye.
constexpr const char* kColours[] = {"#999999", "#000000", "#F0E442", "#E69F00", "#D55E00",
                                    "#CC79A7", "#0072B2", "#56B4E9", "#882255", "#009E73"};
/// The methods in the order of kColours.
constexpr const char* kChartedMethods[] = {"layers_edge", "layers_midpoint", "ode_operator", "ode_scalar",
                                           "wei_norman",  "wei_norman_exp",  "magnus4",      "magnus6",
                                           "modal",       "diagonal"};
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
/// Errors below are drawn there: rounding is no method's merit.
constexpr double kLeastError = 1e-14;

struct ChartArguments {
  std::string out = "out/chart";
  bool quick = false, quiet = false;
};

std::string points_csv(const MethodChart& chart) {
  std::string text =
      "scene,method,effort,seconds_per_ray,seconds_per_ray_in_lanes,medium_samples_per_ray,jones_error,intensity_error,"
      "gradient_error\n";
  for (const ChartPoint& p : chart.points)
    text += fmt::format("{},{},{},{},{},{},{},{},{}\n", p.scene, p.method, p.effort, csv_number(p.seconds),
                        csv_number(p.seconds_in_lanes), csv_number(p.samples), csv_number(p.jones_error),
                        csv_number(p.intensity_error), csv_number(p.gradient_error));
  return text;
}
std::string scenes_csv(const MethodChart& chart) {
  std::string text = "scene,what,phase_rad,reference_agreement,intensity_error_e_only,intensity_error_one_way\n";
  for (const ChartScene& s : chart.scenes)
    text += fmt::format("{},\"{}\",{},{},{},{}\n", s.name, s.what, csv_number(s.phase_rad),
                        csv_number(s.reference_agreement), csv_number(s.e_only_error), csv_number(s.one_way_error));
  return text;
}
std::string frames_csv(const MethodChart& chart) {
  std::string text = "scene,method,accuracy_asked,seconds_per_frame,worst_error,rms_error,worst_column,worst_row\n";
  for (const ChartFrame& f : chart.frames)
    text += fmt::format("{},{},{},{},{},{},{},{}\n", f.scene, f.method, csv_number(f.asked), csv_number(f.seconds),
                        csv_number(f.worst_error), csv_number(f.rms_error), f.worst_column, f.worst_row);
  return text;
}

double fastest_seconds(const ChartPoint& p) {
  return std::isfinite(p.seconds_in_lanes) ? p.seconds_in_lanes : p.seconds;
}

/// " order=3" of a series that is shorter or longer than usual; such are lines of their own.
std::string line_of(const ChartPoint& p) {
  const std::size_t at = p.effort.find(' ');
  return at == std::string::npos ? "" : p.effort.substr(at);
}

/// The fastest point of a method (of any: "") on a ray whose intensity errs by at most `error`, and so does every later
/// one on that line, which are listed from the least effort to the most: not by chance. Null where there is none.
const ChartPoint* fastest_within(const MethodChart& chart, const std::string& scene, const std::string& method,
                                 double error) {
  const ChartPoint* best = nullptr;
  for (auto p = chart.points.begin(); p != chart.points.end(); ++p) {
    if (p->scene != scene || (!method.empty() && p->method != method)) continue;
    const bool holds = std::all_of(p, chart.points.end(), [&](const ChartPoint& q) {
      return q.scene != scene || q.method != p->method || line_of(q) != line_of(*p) || q.intensity_error <= error;
    });
    if (holds && (!best || fastest_seconds(*p) < fastest_seconds(*best))) best = &*p;
  }
  return best;
}

/// What docs/methods.md quotes of the measurements.
std::string summary_md(const MethodChart& chart) {
  const auto number = [](double x) {
    if (x < 10) return fmt::format("{:.1f}", x);
    const double digit = std::pow(10, std::floor(std::log10(x)) - 1);  // the second
    return fmt::format("{:.0f}", digit * std::round(x / digit));
  };
  std::string text = "Microseconds a ray for an intensity within 1e-4, one core (- : not reached):\n\n| ray |",
              rule = "|---|";
  for (const char* method : kChartedMethods) text += fmt::format(" {} |", method), rule += "---|";
  text += "\n" + rule + "\n";
  for (const ChartScene& scene : chart.scenes) {
    text += fmt::format("| {} |", scene.name);
    for (const char* method : kChartedMethods) {
      const ChartPoint* p = fastest_within(chart, scene.name, method, 1e-4);
      text += p ? fmt::format(" {} |", number(1e6 * fastest_seconds(*p))) : " - |";
    }
    text += "\n";
  }
  text +=
      "\nAgainst the source paper's 4,096 layers (layers_edge) and, at an error of 1e-4, layers of their middle:\n\n"
      "| ray | 4,096 layers: us a ray, error | fastest at no larger error | times faster | layers_midpoint at 1e-4: us "
      "a ray | fastest at 1e-4 | times faster |\n|---|---|---|---|---|---|---|\n";
  for (const ChartScene& scene : chart.scenes) {
    const auto edge = std::find_if(chart.points.begin(), chart.points.end(), [&](const ChartPoint& p) {
      return p.scene == scene.name && p.method == "layers_edge" && p.effort == "n=4096";
    });
    const ChartPoint *middle = fastest_within(chart, scene.name, "layers_midpoint", 1e-4),
                     *best = fastest_within(chart, scene.name, "", 1e-4);
    if (edge == chart.points.end() || !middle || !best) continue;  // a quick run
    const ChartPoint* no_worse = fastest_within(chart, scene.name, "", edge->intensity_error);
    if (!no_worse) no_worse = &*edge;
    text +=
        fmt::format("| {} | {}, {:.0e} | {} {} | {} | {} | {} {} | {} |\n", scene.name,
                    number(1e6 * fastest_seconds(*edge)), edge->intensity_error, no_worse->method, no_worse->effort,
                    number(fastest_seconds(*edge) / fastest_seconds(*no_worse)), number(1e6 * fastest_seconds(*middle)),
                    best->method, best->effort, number(fastest_seconds(*middle) / fastest_seconds(*best)));
  }
  if (chart.frames.empty()) return text;
  text +=
      "\nFrames of 500 x 500 pixels for 1e-4, against pixels nine times finer:\n\n| scene | method | ms | worst error "
      "| at column, row |\n|---|---|---|---|---|\n";
  for (const ChartFrame& f : chart.frames)
    if (f.asked == 1e-4)
      text += fmt::format("| {} | {} | {} | {:.0e} | {}, {} |\n", f.scene, f.method, number(1e3 * f.seconds),
                          f.worst_error, f.worst_column, f.worst_row);
  return text;
}

DataSeries line_with_dots(const std::string& label, const std::string& colour) {
  DataSeries series;
  series.label = label;
  series.colour = colour;
  series.dots = 4.5;
  return series;
}

/// A ray's time against the error of its intensity, a panel for every ray.
Sheet rays_sheet(const MethodChart& measured) {
  Sheet sheet;
  sheet.title = "time of a ray against the error of its intensity, every transport method";
  sheet.columns = 4;
  for (std::size_t m = 0; m < std::size(kChartedMethods); ++m)
    sheet.legend.push_back(line_with_dots(kChartedMethods[m], kColours[m]));
  for (const ChartScene& scene : measured.scenes) {
    Panel panel;
    panel.y_label = "\u00b5s a ray";
    panel.height = 240;
    panel.log_y = true;
    panel.y_range = {0.01, 20000};
    for (std::size_t m = 0; m < std::size(kChartedMethods); ++m) {
      // A line for each length of series.
      std::map<std::string, std::vector<std::pair<double, double>>> lines;
      for (const ChartPoint& p : measured.points)
        if (p.scene == scene.name && p.method == kChartedMethods[m] && std::isfinite(p.intensity_error) &&
            p.intensity_error < 2)
          lines[line_of(p)].emplace_back(std::max(p.intensity_error, kLeastError), 1e6 * fastest_seconds(p));
      DataSeries series = line_with_dots("", kColours[m]);
      for (const auto& [length, line] : lines) {
        for (const auto& [error, time] : line) series.x.push_back(error), series.y.push_back(time);
        series.x.push_back(kNaN), series.y.push_back(kNaN);
      }
      if (!lines.empty()) panel.series.push_back(std::move(series));
    }
    Chart chart;
    chart.heading = fmt::format("{} ({:.3g} rad)", scene.name, scene.phase_rad);
    chart.title = chart.heading;
    chart.x_label = "error of the intensity";
    chart.x_range = {3e-15, 3};
    chart.log_x = true;
    chart.width = 320;
    chart.panels = {std::move(panel)};
    sheet.charts.push_back(std::move(chart));
  }
  return sheet;
}

Sheet frames_sheet(const MethodChart& measured) {
  Panel panel;
  panel.y_label = "ms a frame of 500 \u00d7 500";
  panel.height = 380;
  panel.log_y = true;
  std::set<std::string> names;
  for (const ChartFrame& first : measured.frames) {
    const std::size_t k = names.size();
    if (!names.insert(first.scene).second) continue;
    DataSeries series = line_with_dots(first.scene, kColours[6 + k % 4]);
    for (const ChartFrame& f : measured.frames)
      if (f.scene == first.scene)
        series.x.push_back(std::max(f.worst_error, kLeastError)), series.y.push_back(1e3 * f.seconds);
    panel.series.push_back(std::move(series));
  }
  Chart chart;
  chart.title = "time of a frame against its worst pixel's error";
  chart.x_label = "worst error of a pixel";
  chart.log_x = true;
  chart.width = 720;
  chart.panels = {std::move(panel)};
  return {chart.title, {chart}, 1, {}};
}

std::string waves_csv(const std::vector<WavePoint>& points) {
  std::string text = "sample,radius_um,objective_na,model,effort,seconds,relative_rms_error,planner_estimate\n";
  for (const WavePoint& p : points)
    text += fmt::format("{},{:g},{:g},{},{},{},{},{}\n", p.sample, p.radius_um, p.objective_na, p.model, p.effort,
                        csv_number(p.seconds), csv_number(p.error), csv_number(p.estimate));
  return text;
}

constexpr const char* kModels[] = {"straight", "eikonal", "split_step", "march"};
constexpr const char* kModelColours[] = {"#999999", "#000000", "#0072B2", "#D55E00"};

/// The error of every model's pictures against their radius.
Panel error_panel(const std::vector<WavePoint>& points, const std::string& sample) {
  Panel panel;
  panel.y_label = "RMS error of the picture";
  panel.height = 300;
  panel.log_y = true;
  panel.y_range = {0.001, 6};
  for (std::size_t m = 0; m < std::size(kModels); ++m) {
    DataSeries series = line_with_dots("", kModelColours[m]);
    for (const WavePoint& p : points)
      if (p.sample == sample && p.model == kModels[m] && p.effort.empty() && p.objective_na == 0.4 && p.error > 0)
        series.x.push_back(p.radius_um), series.y.push_back(p.error);
    panel.series.push_back(std::move(series));
  }
  return panel;
}

/// Time against error for one droplet.
Panel time_panel(const std::vector<WavePoint>& points) {
  Panel panel;
  panel.y_label = "ms a picture";
  panel.height = 300;
  panel.log_y = true;
  panel.y_range = {0.05, 20000};
  for (std::size_t m = 0; m < std::size(kModels); ++m) {
    DataSeries series{DataSeries::Kind::points, "", {}, {}, kModelColours[m], 6.5};
    for (const WavePoint& p : points)
      if (p.objective_na == 0.8 && p.model == kModels[m] && p.error > 0)
        series.x.push_back(p.error), series.y.push_back(1e3 * p.seconds);
    if (!series.x.empty()) panel.series.push_back(std::move(series));
  }
  return panel;
}

/// Error against radius for each sample at NA 0.4, and time against error for one droplet.
Sheet waves_sheet(const std::vector<WavePoint>& points) {
  Sheet sheet;
  sheet.title = "error of pictures by rays, curved rays, propagation and march";
  sheet.columns = 4;
  for (std::size_t m = 0; m < std::size(kModels); ++m)
    sheet.legend.push_back(line_with_dots(kModels[m], kModelColours[m]));
  const auto add = [&](const std::string& heading, const std::string& x_label, Panel panel) -> Chart& {
    Chart chart;
    chart.title = chart.heading = heading;
    chart.x_label = x_label;
    chart.width = 320;
    chart.panels = {std::move(panel)};
    return sheet.charts.emplace_back(std::move(chart));
  };
  std::vector<std::string> samples;
  for (const WavePoint& p : points)
    if (std::find(samples.begin(), samples.end(), p.sample) == samples.end()) samples.push_back(p.sample);
  for (std::size_t k = 0; k < samples.size() && k < 3; ++k)
    add(samples[k] + ", NA 0.4", "radius (\u00b5m)", error_panel(points, samples[k])).x_range = {1, 16};
  Panel times = time_panel(points);
  if (times.series.empty()) return sheet;  // of a quick run
  Chart& chart = add("9 \u00b5m, NA 0.8", "RMS error of the picture", std::move(times));
  chart.log_x = true;
  chart.x_range = {0.005, 2};
  return sheet;
}

std::string spectra_csv(const std::vector<SpectrumPoint>& points) {
  std::string text = "scene,rule,effort,wavelengths,seconds_per_pixel,error,delta_e\n";
  for (const SpectrumPoint& p : points)
    text += fmt::format("\"{}\",{},{},{},{},{},{}\n", p.scene, p.rule, p.effort, p.wavelengths, csv_number(p.seconds),
                        csv_number(p.error), csv_number(p.delta_e));
  return text;
}

constexpr const char* kRules[] = {"Gauss", "even in 1/wavelength", "even in wavelength", "planned", "closed form"};
constexpr const char* kRuleColours[] = {"#0072B2", "#56B4E9", "#D55E00", "#000000", "#009E73"};

/// "1.43/40 nm" of "echoes in 1.43, 40 nm".
std::string short_words(std::string echoes) {
  echoes.erase(0, std::string_view("echoes in ").size());
  return echoes.replace(echoes.find(", "), 2, "/");
}

/// A pixel's time against its error, a panel for every sample, and what [S4]'s double reflections leave out.
Sheet spectra_sheet(const std::vector<SpectrumPoint>& points) {
  Sheet sheet;
  sheet.title =
      "white light: time of a pixel against the error of its colour; echoes: error against double reflections";
  sheet.columns = 3;
  for (std::size_t r = 0; r < std::size(kRules); ++r)
    sheet.legend.push_back(line_with_dots(kRules[r], kRuleColours[r]));
  std::vector<std::string> scenes, echoes;
  for (const SpectrumPoint& p : points)
    if (std::vector<std::string>& list = p.rule == "M" ? echoes : scenes; list.empty() || list.back() != p.scene)
      list.push_back(p.scene);
  constexpr double kLeast = 1e-11;
  for (const std::string& scene : scenes) {
    Panel panel;
    panel.y_label = "\u00b5s a pixel, three colours";
    panel.height = 260;
    panel.log_y = true;
    for (std::size_t r = 0; r < std::size(kRules); ++r) {
      DataSeries series = line_with_dots("", kRuleColours[r]);
      for (const SpectrumPoint& p : points)
        if (p.scene == scene && p.rule == kRules[r])
          series.x.push_back(std::max(p.error, kLeast)), series.y.push_back(1e6 * p.seconds);
      if (!series.x.empty()) panel.series.push_back(std::move(series));
    }
    Chart chart;
    chart.title = chart.heading = scene;
    chart.x_label = "worst error of X, Y, Z (share of white)";
    chart.log_x = true;
    chart.x_range = {0.5 * kLeast, 1};
    chart.width = 400;
    chart.panels = {std::move(panel)};
    sheet.charts.push_back(std::move(chart));
  }
  Panel panel;
  panel.y_label = "error of the intensity";
  panel.height = 260;
  panel.log_y = true;
  panel.y_range = {1e-13, 1};
  for (std::size_t k = 0; k < echoes.size(); ++k) {
    DataSeries series = line_with_dots(short_words(echoes[k]), kColours[4 + k % 6]);
    for (const SpectrumPoint& p : points)
      if (p.scene == echoes[k])
        series.x.push_back(static_cast<double>(series.x.size())), series.y.push_back(std::max(p.error, 1e-13));
    panel.series.push_back(std::move(series));
  }
  Chart chart;
  chart.title = chart.heading = "a layer in media 1.43 and 1, lines of light";
  chart.x_label = "double reflections that are kept";
  chart.width = 400;
  chart.panels = {std::move(panel)};
  sheet.charts.push_back(std::move(chart));
  return sheet;
}

int run_chart(const ChartArguments& arguments) {
  const std::filesystem::path out = arguments.out;
  make_folder(arguments.out);
  const MethodChart chart = measure_chart(arguments.quick, [&](const std::string& what) {
    if (!arguments.quiet) std::cerr << "measuring " << what << "\n";
  });
  write_file((out / "chart.csv").string(), points_csv(chart));
  write_file((out / "scenes.csv").string(), scenes_csv(chart));
  write_file((out / "summary.md").string(), summary_md(chart));
  if (!chart.frames.empty()) write_file((out / "frames.csv").string(), frames_csv(chart));
  write_file(out / "chart.svg", svg_file(rays_sheet(chart)));
  if (!chart.frames.empty()) write_file(out / "frames.svg", svg_file(frames_sheet(chart)));
  const std::vector<SpectrumPoint> spectra = measure_spectra(arguments.quick, [&](const std::string& what) {
    if (!arguments.quiet) std::cerr << "measuring " << what << "\n";
  });
  write_file((out / "spectra.csv").string(), spectra_csv(spectra));
  write_file(out / "spectra.svg", svg_file(spectra_sheet(spectra)));
  const std::vector<WavePoint> waves = measure_waves(arguments.quick, [&](const std::string& what) {
    if (!arguments.quiet) std::cerr << "measuring " << what << "\n";
  });
  write_file((out / "waves.csv").string(), waves_csv(waves));
  write_file(out / "waves.svg", svg_file(waves_sheet(waves)));
  if (!arguments.quiet) std::cout << (out / "chart.csv").string() << ": " << chart.points.size() << " measurements\n";
  return kExitDone;
}

}  // namespace

Command add_chart_command(CLI::App& app) {
  auto arguments = std::make_shared<ChartArguments>();
  CLI::App* command = app.add_subcommand(
      "chart", "speed against accuracy of every transport method, measured here: tables and pictures");
  command
      ->add_option("--out", arguments->out,
                   "folder for chart.csv, scenes.csv, frames.csv, spectra.csv, waves.csv, summary.md (the tables that "
                   "methods.md quotes) and the SVGs")
      ->capture_default_str();
  command->add_flag("--quick", arguments->quick, "fewer efforts, no frames");
  command->add_flag("-q,--quiet", arguments->quiet, "say nothing");
  return {command, [arguments] { return run_chart(*arguments); }};
}

}  // namespace birefit
