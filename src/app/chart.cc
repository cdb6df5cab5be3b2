// birefit chart: every transport method's speed against its accuracy, as tables and pictures.

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <set>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/output.h"
#include "app/plot.h"
#include "birefit/io.h"
#include "birefit/study.h"

namespace birefit {
namespace {

struct Arguments {
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

std::string rays_script(const MethodChart& chart) {
  std::string script = fmt::format(
      "set terminal svg size 1500,820 dynamic font 'sans,13' background rgb 'white'\n"
      "set logscale xy\nset format x '10^{{%T}}'\nset format y '10^{{%T}}'\nset grid lc rgb '#dddddd'\n"
      "set xrange [1e-14:2]\nset yrange [0.01:20000]\nunset key\n"
      "set multiplot layout 2,4 margins 0.05,0.99,0.08,0.94 spacing 0.045,0.12\n");
  for (const ChartScene& scene : chart.scenes) {
    std::string plot, data;
    for (std::size_t m = 0; m < std::size(kChartedMethods); ++m) {
      // A line for each length of series.
      std::map<std::string, std::string> lines;
      for (const ChartPoint& p : chart.points) {
        if (p.scene == scene.name && p.method == kChartedMethods[m] && std::isfinite(p.intensity_error) &&
            p.intensity_error < 2)
          lines[line_of(p)] +=
              fmt::format("{:.6g} {:.6g}\n", std::max(p.intensity_error, 1e-14), 1e6 * fastest_seconds(p));
      }
      std::string block;
      for (const auto& [order, line] : lines) block += (block.empty() ? "" : "\n") + line;
      if (block.empty()) continue;
      data += fmt::format("$d{} << EOD\n{}EOD\n", m, block);
      plot += fmt::format("{}$d{} with linespoints lw 1.6 pt 7 ps 0.45 lc rgb '{}'", plot.empty() ? "" : ", ", m,
                          kColours[m]);
    }
    script += data + fmt::format(
                         "set title '{} ({:.3g} rad)' noenhanced\nset xlabel 'error of the intensity' offset "
                         "0,0.4\nset ylabel 'us a ray' offset 1.5,0\nplot {}\n",
                         scene.name, scene.phase_rad, plot);
  }
  // The last place holds the legend.
  script +=
      "unset title; unset xlabel; unset ylabel; unset border; unset tics; unset grid; set key center center noenhanced "
      "spacing 1.4\nplot ";
  for (std::size_t m = 0; m < std::size(kChartedMethods); ++m)
    script += fmt::format("{}NaN with linespoints lw 2 pt 7 ps 0.6 lc rgb '{}' title '{}'", m ? ", " : "", kColours[m],
                          kChartedMethods[m]);
  return script + "\nunset multiplot\n";
}

std::string frames_script(const MethodChart& chart) {
  std::string script = fmt::format(
      "set terminal svg size 820,520 dynamic font 'sans,13' background rgb 'white'\nset logscale xy\n"
      "set format x '10^{{%T}}'\nset grid lc rgb '#dddddd'\nset key top right noenhanced\n"
      "set xlabel 'worst error of a pixel'\nset ylabel 'ms a frame of 500 x 500'\n");
  std::set<std::string> names;
  std::string plot;
  int k = 0;
  for (const ChartFrame& first : chart.frames) {
    if (!names.insert(first.scene).second) continue;
    script += fmt::format("$f{} << EOD\n", k);
    for (const ChartFrame& f : chart.frames)
      if (f.scene == first.scene)
        script += fmt::format("{:.6g} {:.6g}\n", std::max(f.worst_error, 1e-14), 1e3 * f.seconds);
    script += "EOD\n";
    plot += fmt::format("{}$f{} with linespoints lw 2 pt 7 ps 0.6 lc rgb '{}' title '{}'", k ? ", " : "", k,
                        kColours[6 + k % 4], first.scene);
    ++k;
  }
  return script + "plot " + plot + "\n";
}

std::string waves_csv(const std::vector<WavePoint>& points) {
  std::string text = "sample,radius_um,objective_na,model,effort,seconds,relative_rms_error,planner_estimate\n";
  for (const WavePoint& p : points)
    text += fmt::format("{},{:g},{:g},{},{},{},{},{}\n", p.sample, p.radius_um, p.objective_na, p.model, p.effort,
                        csv_number(p.seconds), csv_number(p.error), csv_number(p.estimate));
  return text;
}

/// Error against radius for each sample at NA 0.4, and time against error for one droplet.
std::string waves_script(const std::vector<WavePoint>& points) {
  constexpr const char* kModels[] = {"straight", "eikonal", "split_step", "march"};
  constexpr const char* kModelColours[] = {"#999999", "#000000", "#0072b2", "#d55e00"};
  std::string script = fmt::format(
      "set terminal svg size 1500,430 dynamic font 'sans,13' background rgb 'white'\nset logscale y\nset grid lc rgb "
      "'#dddddd'\n"
      "set key top left noenhanced maxrows 2 samplen 1.5 width -1\nset multiplot layout 1,4 margins "
      "0.055,0.99,0.14,0.9 spacing 0.055,0.1\nset yrange [0.001:6]\n");
  std::vector<std::string> samples;
  for (const WavePoint& p : points)
    if (std::find(samples.begin(), samples.end(), p.sample) == samples.end()) samples.push_back(p.sample);
  int block = 0;
  for (std::size_t k = 0; k < samples.size() && k < 3; ++k) {
    std::string plot;
    for (std::size_t m = 0; m < std::size(kModels); ++m) {
      std::string data;
      for (const WavePoint& p : points)
        if (p.sample == samples[k] && p.model == kModels[m] && p.effort.empty() && p.objective_na == 0.4 && p.error > 0)
          data += fmt::format("{:g} {:.4g}\n", p.radius_um, p.error);
      if (data.empty()) continue;
      script += fmt::format("$w{} << EOD\n{}EOD\n", block, data);
      plot += fmt::format("{}$w{} with linespoints lw 2 pt 7 ps 0.5 lc rgb '{}' title '{}'", plot.empty() ? "" : ", ",
                          block++, kModelColours[m], kModels[m]);
    }
    script += fmt::format(
        "set title '{}, NA 0.4' noenhanced\nset xlabel 'radius (um)'\nset ylabel '{}' offset 1,0\nplot {}\n",
        samples[k], k == 0 ? "RMS error of the picture" : "", plot);
  }
  std::string plot;
  for (std::size_t m = 0; m < std::size(kModels); ++m) {
    std::string data;
    for (const WavePoint& p : points)
      if (p.objective_na == 0.8 && p.model == kModels[m] && p.error > 0)
        data += fmt::format("{:.4g} {:.4g}\n", p.error, 1e3 * p.seconds);
    if (data.empty()) continue;
    script += fmt::format("$w{} << EOD\n{}EOD\n", block, data);
    plot += fmt::format("{}$w{} with points pt 7 ps 0.8 lc rgb '{}' title '{}'", plot.empty() ? "" : ", ", block++,
                        kModelColours[m], kModels[m]);
  }
  if (plot.empty()) return script + "unset multiplot\n";  // of a quick run
  return script +
         "set logscale x\nset yrange [0.05:20000]\nset xrange [0.005:2]\nset title '9 um, NA 0.8'\nset xlabel 'RMS "
         "error of the picture'\nset ylabel 'ms a picture' offset 1.5,0\nplot " +
         plot + "\nunset multiplot\n";
}

int run_chart(const Arguments& arguments) {
  const std::filesystem::path out = arguments.out;
  make_folder(arguments.out);
  const MethodChart chart = measure_chart(arguments.quick, [&](const std::string& what) {
    if (!arguments.quiet) std::cerr << "measuring " << what << "\n";
  });
  write_file((out / "chart.csv").string(), points_csv(chart));
  write_file((out / "scenes.csv").string(), scenes_csv(chart));
  write_file((out / "summary.md").string(), summary_md(chart));
  if (!chart.frames.empty()) write_file((out / "frames.csv").string(), frames_csv(chart));
  if (draw(rays_script(chart), out / "chart.svg") && !chart.frames.empty())
    draw(frames_script(chart), out / "frames.svg");
  const std::vector<WavePoint> waves = measure_waves(arguments.quick, [&](const std::string& what) {
    if (!arguments.quiet) std::cerr << "measuring " << what << "\n";
  });
  write_file((out / "waves.csv").string(), waves_csv(waves));
  draw(waves_script(waves), out / "waves.svg");
  if (!arguments.quiet) std::cout << (out / "chart.csv").string() << ": " << chart.points.size() << " measurements\n";
  return kExitDone;
}

}  // namespace

Command add_chart_command(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand(
      "chart", "speed against accuracy of every transport method, measured here: tables and pictures");
  command
      ->add_option("--out", arguments->out,
                   "folder for chart.csv, scenes.csv, frames.csv, waves.csv, summary.md (the tables that methods.md "
                   "quotes) and the SVGs")
      ->capture_default_str();
  command->add_flag("--quick", arguments->quick, "fewer efforts, no frames");
  command->add_flag("-q,--quiet", arguments->quiet, "say nothing");
  return {command, [arguments] { return run_chart(*arguments); }};
}

}  // namespace birefit
