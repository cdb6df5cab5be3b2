// birefit chart: every transport method's speed against its accuracy, as tables and pictures.

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <set>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/output.h"
#include "birefit/io.h"
#include "birefit/study.h"

namespace birefit {
namespace {

struct Arguments {
  std::string out = "out/chart";
  bool quick = false, quiet = false;
};

std::string number(double x) { return std::isfinite(x) ? fmt::format("{:.6g}", x) : std::string(); }

std::string points_csv(const Chart& chart) {
  std::string text =
      "scene,method,effort,seconds_per_ray,seconds_per_ray_in_lanes,medium_samples_per_ray,jones_error,intensity_error,gradient_error\n";
  for (const ChartPoint& p : chart.points)
    text += fmt::format("{},{},{},{},{},{},{},{},{}\n", p.scene, p.method, p.effort, number(p.seconds), number(p.seconds_in_lanes),
                        number(p.samples), number(p.jones_error), number(p.intensity_error), number(p.gradient_error));
  return text;
}
std::string scenes_csv(const Chart& chart) {
  std::string text = "scene,what,phase_rad,reference_agreement,intensity_error_e_only,intensity_error_one_way\n";
  for (const ChartScene& s : chart.scenes)
    text += fmt::format("{},\"{}\",{},{},{},{}\n", s.name, s.what, number(s.phase_rad), number(s.reference_agreement),
                        number(s.e_only_error), number(s.one_way_error));
  return text;
}
std::string frames_csv(const Chart& chart) {
  std::string text = "scene,method,accuracy_asked,seconds_per_frame,worst_error,rms_error\n";
  for (const ChartFrame& f : chart.frames)
    text += fmt::format("{},{},{},{},{},{}\n", f.scene, f.method, number(f.asked), number(f.seconds), number(f.worst_error), number(f.rms_error));
  return text;
}

constexpr const char* kMethods[] = {"layers_edge", "layers_midpoint", "ode_operator", "ode_scalar", "wei_norman",
                                    "wei_norman_exp", "magnus4", "magnus6", "diagonal"};
/// Okabe and Ito's colours, told apart by every eye.
constexpr const char* kColours[] = {"#999999", "#000000", "#F0E442", "#E69F00", "#D55E00", "#CC79A7", "#0072B2", "#56B4E9", "#009E73"};

std::string rays_script(const Chart& chart, const std::string& svg) {
  std::string script = fmt::format(
      "set terminal svg size 1500,820 dynamic font 'sans,13' background rgb 'white'\nset output '{}'\n"
      "set logscale xy\nset format x '10^{{%T}}'\nset format y '10^{{%T}}'\nset grid lc rgb '#dddddd'\n"
      "set xrange [1e-14:2]\nset yrange [0.01:20000]\nunset key\n"
      "set multiplot layout 2,4 margins 0.05,0.99,0.08,0.94 spacing 0.045,0.12\n",
      svg);
  for (const ChartScene& scene : chart.scenes) {
    std::string plot, data;
    for (std::size_t m = 0; m < std::size(kMethods); ++m) {
      std::string block;
      for (const ChartPoint& p : chart.points) {
        const double seconds = std::isfinite(p.seconds_in_lanes) ? p.seconds_in_lanes : p.seconds;
        if (p.scene == scene.name && p.method == kMethods[m] && std::isfinite(p.intensity_error) && p.intensity_error < 2)
          block += fmt::format("{:.6g} {:.6g}\n", std::max(p.intensity_error, 1e-14), 1e6 * seconds);
      }
      if (block.empty()) continue;
      data += fmt::format("$d{} << EOD\n{}EOD\n", m, block);
      plot += fmt::format("{}$d{} with linespoints lw 1.6 pt 7 ps 0.45 lc rgb '{}'", plot.empty() ? "" : ", ", m, kColours[m]);
    }
    script += data + fmt::format("set title '{} ({:.3g} rad)' noenhanced\nset xlabel 'error of the intensity' offset 0,0.4\nset ylabel 'us a ray' offset 1.5,0\nplot {}\n",
                                 scene.name, scene.phase_rad, plot);
  }
  // The last place holds the legend.
  script += "unset title; unset xlabel; unset ylabel; unset border; unset tics; unset grid; set key center center noenhanced spacing 1.4\nplot ";
  for (std::size_t m = 0; m < std::size(kMethods); ++m)
    script += fmt::format("{}NaN with linespoints lw 2 pt 7 ps 0.6 lc rgb '{}' title '{}'", m ? ", " : "", kColours[m], kMethods[m]);
  return script + "\nunset multiplot\n";
}

std::string frames_script(const Chart& chart, const std::string& svg) {
  std::string script = fmt::format(
      "set terminal svg size 820,520 dynamic font 'sans,13' background rgb 'white'\nset output '{}'\nset logscale xy\n"
      "set format x '10^{{%T}}'\nset grid lc rgb '#dddddd'\nset key top right noenhanced\n"
      "set xlabel 'worst error of a pixel'\nset ylabel 'ms a frame of 500 x 500'\n",
      svg);
  std::set<std::string> names;
  std::string plot;
  int k = 0;
  for (const ChartFrame& first : chart.frames) {
    if (!names.insert(first.scene).second) continue;
    script += fmt::format("$f{} << EOD\n", k);
    for (const ChartFrame& f : chart.frames)
      if (f.scene == first.scene) script += fmt::format("{:.6g} {:.6g}\n", std::max(f.worst_error, 1e-14), 1e3 * f.seconds);
    script += "EOD\n";
    plot += fmt::format("{}$f{} with linespoints lw 2 pt 7 ps 0.6 lc rgb '{}' title '{}'", k ? ", " : "", k, kColours[6 + k % 3], first.scene);
    ++k;
  }
  return script + "plot " + plot + "\n";
}

bool draw(const std::string& script) {
  std::FILE* pipe = popen("gnuplot", "w");
  if (!pipe) return false;
  std::fwrite(script.data(), 1, script.size(), pipe);
  return pclose(pipe) == 0;
}

int run_chart(const Arguments& arguments) {
  const std::filesystem::path out = arguments.out;
  std::error_code failure;
  std::filesystem::create_directories(out, failure);
  if (failure) throw UserError(Where{}, arguments.out + " cannot be made: " + failure.message(), "name a folder that can be written");
  const Chart chart = measure_chart(arguments.quick, [&](const std::string& what) {
    if (!arguments.quiet) std::cerr << "measuring " << what << "\n";
  });
  write_file((out / "chart.csv").string(), points_csv(chart));
  write_file((out / "scenes.csv").string(), scenes_csv(chart));
  if (!chart.frames.empty()) write_file((out / "frames.csv").string(), frames_csv(chart));
  const auto quoted = [&](const char* name) {
    std::string path;
    for (const char c : (out / name).string()) path += c == '\'' ? std::string("''") : std::string(1, c);
    return path;
  };
  bool drawn = draw(rays_script(chart, quoted("chart.svg")));
  if (!chart.frames.empty()) drawn = draw(frames_script(chart, quoted("frames.svg"))) && drawn;
  if (!drawn) std::cerr << "birefit: no picture: gnuplot is not there or failed; the tables are complete (Debian: gnuplot-nox)\n";
  if (!arguments.quiet) std::cout << (out / "chart.csv").string() << ": " << chart.points.size() << " measurements\n";
  return kExitDone;
}

}  // namespace

Command add_chart_command(CLI::App& app) {
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command = app.add_subcommand("chart", "speed against accuracy of every transport method, measured here: tables and pictures");
  command->add_option("--out", arguments->out, "folder for chart.csv, scenes.csv, frames.csv and the SVGs")->capture_default_str();
  command->add_flag("--quick", arguments->quick, "fewer efforts, no frames");
  command->add_flag("-q,--quiet", arguments->quiet, "say nothing");
  return {command, [arguments] { return run_chart(*arguments); }};
}

}  // namespace birefit
