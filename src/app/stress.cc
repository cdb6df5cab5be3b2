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
#include "app/plot.h"
#include "birefit/io.h"
#include "birefit/study.h"

namespace birefit {
namespace {

struct Arguments {
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

/// A square for every place and method: its error where it answers, grey where it says that it cannot.
std::string script(const std::vector<StressPoint>& points) {
  std::vector<std::string> places, names;
  for (const StressPoint& p : points)
    if (!of_picture(p) && std::find(names.begin(), names.end(), p.method) == names.end()) names.push_back(p.method);
  std::string answered, flagged, ticks;
  std::string sweep;
  for (const StressPoint& p : points) {
    if (of_picture(p)) continue;
    const std::string place = fmt::format("{} {:g}", p.sweep, p.value);
    if (places.empty() || places.back() != place) {
      places.push_back(place);
      ticks += fmt::format("{}'{}' {}", ticks.empty() ? "" : ", ",
                           p.sweep == sweep ? fmt::format("{:g}", p.value) : place, places.size() - 1);
      sweep = p.sweep;
    }
    const auto m = std::find(names.begin(), names.end(), p.method) - names.begin();
    if (!p.flag.empty())
      flagged += fmt::format("{} {}\n", m, places.size() - 1);
    else if (std::isfinite(p.error))
      answered += fmt::format("{} {} {:.3g}\n", m, places.size() - 1, std::log10(std::max(p.error, 1e-14)));
  }
  std::string methods;
  for (std::size_t m = 0; m < names.size(); ++m) methods += fmt::format("{}'{}' {}", m ? ", " : "", names[m], m);
  return fmt::format(
      "set terminal svg size 900,{} dynamic font 'sans,12' background rgb 'white'\n$a << EOD\n{}EOD\n$f << EOD\n{}EOD\n"
      "set yrange [{}:-0.5]\nset xrange [-0.5:{}]\nset ytics noenhanced ({})\nset x2range [-0.5:{}]\nset x2tics "
      "noenhanced rotate by 30 ({})\nunset xtics\nunset key\n"
      "set lmargin 26\nset tmargin 6\nset cbrange [-14:-2]\nset palette defined (-14 '#0072B2', -9 '#56B4E9', -6 "
      "'#009E73', -4 '#F0E442', -2 '#D55E00')\n"
      "set cblabel 'log_{{10}} of the error; grey: flagged by the method itself'\n"
      "plot $f using 1:2 with points pt 5 ps 0.9 lc rgb '#cccccc', $a using 1:2:3 with points pt 5 ps 0.9 lc palette\n",
      120 + 17 * places.size(), answered, flagged, static_cast<double>(places.size()) - 0.5,
      static_cast<double>(names.size()) - 0.5, ticks, static_cast<double>(names.size()) - 0.5, methods);
}

/// Pictures by wave optics: error against the method's own estimate. The law: no point above the diagonal.
std::string wave_script(const std::vector<StressPoint>& points) {
  std::string data, plots;
  int colour = 0;
  for (const auto& [name, rgb] : {std::pair{"series", "#0072B2"}, {"split_step", "#D55E00"}, {"march", "#009E73"}}) {
    data += fmt::format("$p{} << EOD\n", colour);
    for (const StressPoint& p : points)
      if (p.sweep.starts_with("wave_") && p.method == fmt::format("{} of a ball", name) && p.flag.empty() &&
          p.error > 1e-12)
        data += fmt::format("{:.4g} {:.4g}\n", p.estimate, p.error);
    data += "EOD\n";
    plots +=
        fmt::format(", $p{} using 1:2 with points pt 7 ps 0.6 lc rgb '{}' title '{}' noenhanced", colour++, rgb, name);
  }
  return fmt::format(
      "set terminal svg size 640,560 dynamic font 'sans,13' background rgb 'white'\n{}set logscale xy\nset format xy "
      "'10^{{%T}}'\n"
      "set xrange [1e-12:10]\nset yrange [1e-13:10]\nset key top left\nset xlabel 'what the method says of its "
      "error'\nset ylabel 'error of the picture'\nset grid lc rgb '#dddddd'\n"
      "plot x with lines lc rgb 'black' title 'the law: not above'{}\n",
      data, plots);
}

int run_stress(const Arguments& arguments) {
  const std::filesystem::path out = arguments.out;
  make_folder(arguments.out);
  const std::vector<StressPoint> points = measure_stress(arguments.quick, [&](const std::string& what) {
    if (!arguments.quiet) std::cerr << "sweeping " << what << "\n";
  });
  write_file(out / "stress.csv", table(points));
  draw(script(points), out / "stress.svg");
  draw(wave_script(points), out / "stress_waves.svg");
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
  auto arguments = std::make_shared<Arguments>();
  CLI::App* command =
      app.add_subcommand("stress", "sweeps into the places where transport methods fail: error, own estimate, flag");
  command->add_option("--out", arguments->out, "folder for stress.csv, stress.svg and stress_waves.svg")
      ->capture_default_str();
  command->add_flag("--quick", arguments->quick, "fewer places");
  command->add_flag("-q,--quiet", arguments->quiet, "say nothing");
  return {command, [arguments] { return run_stress(*arguments); }};
}

}  // namespace birefit
