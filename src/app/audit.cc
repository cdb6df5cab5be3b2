// birefit audit: fits of pictures that are nearly the model's, as tables and a picture.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iostream>
#include <memory>
#include <vector>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/interrupt.h"
#include "app/output.h"
#include "app/watch.h"
#include "birefit/audit.h"
#include "birefit/io.h"
#include "core/printable.h"
#include "core/threads.h"
#include "io/report/format.h"
#include "io/results/work.h"

namespace birefit {
namespace {

struct AuditArguments {
  std::string config;
  std::vector<std::string> set, departures, without;
  std::string out;
  int threads = -1, problems = 3, samples = 0;
  std::uint64_t seed = 1;
  bool list = false, quiet = false;
};

/// For a table that spreadsheets open: names of parameters and grades hold neither quotes nor line ends.
std::string intervals_csv(const std::vector<AuditFit>& fits) {
  std::string text =
      "departure,amount,size,grade,apart,parameter,truth,value,low95,high95,half_widths_off,drawn_low95,drawn_high95\n";
  for (const AuditFit& fit : fits) {
    std::string grade = printable(fit.grade);  // of what could not be fitted the error
    std::replace(grade.begin(), grade.end(), '"', '\'');
    const std::string head =
        fmt::format("\"{}\",\"{}\",{},\"{}\",{}", fit.departure, fit.amount, fit.size, grade, fit.apart ? 1 : 0);
    for (const AuditFit::Of& p : fit.parameters)
      text += fmt::format("{},\"{}\",{},{},{},{},{:.3g},{},{}\n", head, p.name, csv_number(p.truth),
                          csv_number(p.value), csv_number(p.low), csv_number(p.high), p.off(),
                          p.drawn ? csv_number((*p.drawn)[0]) : "", p.drawn ? csv_number((*p.drawn)[1]) : "");
    if (fit.parameters.empty()) text += head + ",,,,,,,,\n";
  }
  return text;
}

std::string rows_csv(const std::vector<AuditRow>& rows) {
  std::string text =
      "departure,amount,size,problems,answers,with_misfit,apart,intervals,held,width_over_clean,worst_half_widths,"
      "drawn,drawn_held\n";
  for (const AuditRow& r : rows)
    text += fmt::format("\"{}\",\"{}\",{},{},{},{},{},{},{},{},{:.3g},{},{}\n", r.departure, r.amount, r.size,
                        r.problems, r.answers, r.with_misfit, r.apart, r.intervals, r.held, csv_number(r.width),
                        r.worst, r.drawn, r.drawn_held);
  return text;
}

std::string width_text(double width) { return std::isfinite(width) ? fmt::format("{:.2g} x", width) : "-"; }

std::string table(const std::vector<AuditRow>& rows) {
  std::string text = fmt::format("{:<44}{:>14}{:>10}{:>12}{:>13}{:>9}{:>9}\n", "departure", "amount", "answers",
                                 "with misfit", "hold", "width", "worst");
  for (const AuditRow& r : rows)
    text += fmt::format("{:<44}{:>14}{:>10}{:>12}{:>13}{:>9}{:>9.2f}{}\n", r.departure, r.amount,
                        fmt::format("{} of {}", r.answers, r.problems), r.with_misfit,
                        fmt::format("{} of {}", r.held, r.intervals), width_text(r.width), r.worst,
                        r.apart ? fmt::format("   and {} apart", r.apart) : "");
  return text;
}

/// Of every departure a line of three bars: answers whose intervals hold, those that do not, and refusals.
std::string picture(const std::vector<AuditRow>& rows) {
  constexpr int kName = 300, kCell = 220, kBar = 120, kLine = 22, kTop = 58;
  constexpr const char *kHolds = "#0072B2", *kMissed = "#D55E00", *kRefused = "#cccccc", *kInk = "#2b2f36";
  std::vector<std::string> names;
  for (const AuditRow& r : rows)
    if (std::find(names.begin(), names.end(), r.departure) == names.end()) names.push_back(r.departure);
  const int width = kName + 3 * kCell, height = kTop + kLine * static_cast<int>(names.size()) + 12;
  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\" "
      "font-family=\"sans-serif\" font-size=\"12\" fill=\"{2}\">\n<title>Departures by size: answers whose 95 % "
      "intervals hold the truth, answers whose do not, and refusals</title>\n<rect width=\"{0}\" height=\"{1}\" "
      "fill=\"white\"/>\n",
      width, height, kInk);
  int x = 12;
  for (const auto& [colour, words] : {std::pair{kHolds, "intervals that hold the truth"},
                                      {kMissed, "intervals that do not"},
                                      {kRefused, "no answer"}}) {
    out += fmt::format(
        "<rect x=\"{}\" y=\"12\" width=\"12\" height=\"12\" fill=\"{}\"/><text x=\"{}\" y=\"22\">{}</text>\n", x,
        colour, x + 17, words);
    x += 205;
  }
  out += "<text x=\"12\" y=\"46\" fill=\"#6b7280\">departure (\u00d7: half-width over that of none)</text>\n";
  for (int size = 0; size < 3; ++size)
    out += fmt::format("<text x=\"{}\" y=\"46\" fill=\"#6b7280\">{}</text>\n", kName + size * kCell,
                       size == 0   ? "small"
                       : size == 1 ? "middle"
                                   : "large");
  for (const AuditRow& r : rows) {
    const auto line = std::find(names.begin(), names.end(), r.departure) - names.begin();
    const int y = kTop + kLine * static_cast<int>(line), left = kName + std::max(0, r.size - 1) * kCell;
    if (r.size <= 1) out += fmt::format("<text x=\"12\" y=\"{}\">{}</text>\n", y + 14, escape_html(r.departure));
    if (r.problems == 0) {
      out += fmt::format("<text x=\"{}\" y=\"{}\">{}: leaves no trace</text>\n", left, y + 14, escape_html(r.amount));
      continue;
    }
    const double answered = static_cast<double>(r.answers) / r.problems;
    const double held = r.intervals > 0 ? answered * r.held / r.intervals : 0;
    double at = left;
    for (const auto& [share, colour] :
         {std::pair{held, kHolds}, {answered - held, kMissed}, {1 - answered, kRefused}}) {
      out += fmt::format("<rect x=\"{:.1f}\" y=\"{}\" width=\"{:.1f}\" height=\"14\" fill=\"{}\"/>\n", at, y + 3,
                         share * kBar, colour);
      at += share * kBar;
    }
    out += fmt::format("<text x=\"{}\" y=\"{}\" font-size=\"10\">{}{}</text>\n", left + kBar + 5, y + 14,
                       r.size > 0 ? escape_html(r.amount) + ", " : "",
                       std::isfinite(r.width) ? fmt::format("{:.2g}\u00d7", r.width) : "\u2013");
  }
  return out + "</svg>\n";
}

int run_audit(const AuditArguments& arguments) {
  Config config = load_config(arguments.config, ConfigUse::plan, std::nullopt, arguments.set);
  FitJob& job = config.job;
  if (arguments.threads >= 0) job.options.threads = arguments.threads;
  if (arguments.list) {
    for (const DepartureWords& d : departures_of(job))
      std::cout << fmt::format("{:<44}{:>12}{:>12}{:>12}   {}\n", d.name, d.amounts[0], d.amounts[1], d.amounts[2],
                               d.what);
    return kExitDone;
  }
  const std::filesystem::path path(arguments.config);
  const std::filesystem::path out = arguments.out.empty() ? path.stem().string() + "-audit" : arguments.out;
  OutputFolder folder(out);
  const Interrupt interrupt;
  job.options.interrupted = &interrupt.flag();
  job.options.samples = arguments.samples;
  job.options.not_asked = arguments.without;
  std::vector<AuditFit> fits;
  {
    std::atomic<int> done = 0;
    Watch watch(arguments.quiet, [](double) { return std::numeric_limits<double>::quiet_NaN(); });
    AuditOptions options{arguments.problems, arguments.seed, arguments.departures, {}};
    options.say = [&](const std::string& line) { watch.say(fmt::format("{} fits; {}", ++done, line)); };
    fits = do_work(config, memory_to_fit(job) * thread_count(job.options.threads), [&] { return audit(job, options); });
  }
  const std::vector<AuditRow> rows = tally(fits);
  write_file(out / "audit.csv", rows_csv(rows));
  write_file(out / "intervals.csv", intervals_csv(fits));
  write_file(out / "audit.svg", picture(rows));
  folder.keep();
  int problems = 0, answers = 0, intervals = 0, held = 0, drawn = 0, drawn_held = 0;
  for (const AuditRow& r : rows)
    if (r.size > 0) {
      problems += r.problems, answers += r.answers, intervals += r.intervals, held += r.held;
      drawn += r.drawn, drawn_held += r.drawn_held;
    }
  if (!arguments.quiet)
    std::cout << table(rows)
              << fmt::format("Disturbed: {} of {} answered, {} of {} intervals hold the truth{}. {}\n", answers,
                             problems, held, intervals,
                             intervals > 0 ? fmt::format(" ({:.1f} %)", 100.0 * held / intervals) : "",
                             printable((out / "audit.svg").string()))
              << (drawn > 0 ? fmt::format("Of the draws' own intervals {} of {} do ({:.1f} %).\n", drawn_held, drawn,
                                          100.0 * drawn_held / drawn)
                            : "");
  return interrupt.flag().load() ? kExitNoAnswer : kExitDone;
}

}  // namespace

Command add_audit_command(CLI::App& app) {
  auto arguments = std::make_shared<AuditArguments>();
  CLI::App* command = app.add_subcommand(
      "audit", "where a fit fails, and whether it knows: pictures that are nearly the model's, drawn at random");
  command
      ->add_option("CONFIG", arguments->config, "the config (YAML); an image gives levels and noise, if there is one")
      ->required();
  add_set_option(*command, arguments->set);
  command->add_option(
      "--out", arguments->out,
      "folder for audit.csv, intervals.csv and audit.svg; default: the config's name + \"-audit\", here");
  command->add_option("--problems", arguments->problems, "of every departure and size; three times as many undisturbed")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--departure", arguments->departures, "this one alone; may be repeated")->allow_extra_args(false);
  command
      ->add_option("--without", arguments->without,
                   "fits that do not ask for this where something is left over; may be repeated")
      ->allow_extra_args(false)
      ->check(
          CLI::IsMember({"light", "background", "blur", "gamma", "curve", "stretch", "specks", "outside", "charge"}));
  command->add_option("--seed", arguments->seed, "of the random numbers")->capture_default_str();
  command
      ->add_option("--samples", arguments->samples,
                   "draw N times from the posterior of each fit: do the draws' own intervals hold?")
      ->check(CLI::Range(10, 1000000));
  command->add_flag("--list", arguments->list, "say which departures apply, and end");
  add_threads_option(*command, arguments->threads);
  command->add_flag("-q,--quiet", arguments->quiet, "no table and no progress");
  return {command, [arguments] { return run_audit(*arguments); }};
}

}  // namespace birefit
