// report.html: one file, no network, no script; for the screen, the phone and paper.

#include <string>
#include <vector>

#include <fmt/format.h>

#include "birefit/io.h"
#include "io/report/diagnostics.h"
#include "io/report/page.h"
#include "io/report/pictures.h"
#include "io/report/samples.h"
#include "io/report/style.h"
#include "io/report/tables.h"
#include "io/results/provenance.h"

namespace birefit {
namespace {

using namespace page;

std::string badge(const FitResult& result) {
  if (result.has_answer() && !result.misfit.empty()) return "<span class=\"badge fair\">Answer with misfit</span>";
  if (result.has_answer()) return "<span class=\"badge good\">Answer</span>";
  const char* reason = result.interrupted     ? "interrupted"
                       : !result.converged    ? "not converged"
                       : !result.described    ? "not described by the model"
                       : result.ambiguous     ? "ambiguous"
                       : !result.identifiable ? "not identifiable"
                                              : "pinned at a bound";
  return fmt::format("<span class=\"badge bad\">No answer: {}</span>", reason);
}

/// Where this comes from: program, files, machine and time.
std::string provenance_section(const Config& config, const FitResult& result) {
  const nlohmann::ordered_json made = made_by(config), run = this_run(result.seconds);
  const auto text = [](const nlohmann::ordered_json& value) { return escape_html(value.get<std::string>()); };
  std::string out =
      "<h2>Provenance</h2>\n<dl class=\"facts\">\n" +
      fact("program",
           text(made["program"]) + " " + text(made["version"]) + ", Fourier transforms by " + text(made["fft"])) +
      fact("config", escape_html(config.path.string())) + fact("run", text(run["date"]) + " on " + text(run["host"])) +
      fact("effort", fmt::format("{} evaluations, {:.3g} s", result.evaluations, result.seconds));
  if (!config.fingerprint.empty()) out += fact("fingerprint", escape_html(config.fingerprint));
  out +=
      "</dl>\n<div class=\"scroll\"><table>\n<caption>Files read</caption>\n<tr><th>file</th><th class=\"left\">"
      "SHA-256</th></tr>\n";
  for (const nlohmann::ordered_json& file : made["files"])
    out += "<tr><td class=\"file\">" + text(file["file"]) + "</td><td class=\"left\"><code>" + text(file["sha256"]) +
           "</code></td></tr>\n";
  return out + "</table></div>\n";
}

}  // namespace

std::string report_html(const Config& config, const FitResult& result) {
  const std::vector<Frame> frames = frames_of(config, result);
  const std::string title = config.path.filename().string();
  // Series of many frames stay a file that a mail can carry.
  const int largest_side = frames.size() <= 2 ? 700 : frames.size() <= 6 ? 480 : 300;
  int figure = 1;

  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      // Even if something were to slip through the escaping, no browser would run or fetch it.
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src "
      "'unsafe-inline'\">\n"
      "<title>" +
      escape_html(title) + " \u2013 birefit</title>\n<style>" + kStyle + "</style>\n</head>\n<body>\n<main>\n";
  out += "<p class=\"eyebrow\">birefit fit report</p>\n<h1>" + escape_html(title) + "</h1>\n";
  out += "<div class=\"verdict\">" + badge(result) + "<p>" + escape_html(result.verdict) + "</p></div>\n";
  out += key_numbers(result);
  if (!result.warnings.empty()) out += "<div class=\"warnings\"><b>Warnings</b>\n" + list(result.warnings) + "</div>\n";

  if (!config.signals.empty()) out += "<h2>Signal</h2>\n";
  for (const SignalTable& table : config.signals) out += signal_section(table, result, figure);
  if (!frames.empty()) out += "<h2>Images</h2>\n";
  for (const Frame& frame : frames) out += frame_section(frame, result, figure, largest_side);

  out += "<h2>Parameters</h2>\n" + parameter_table(result) + derived_table(result) + statistics_section(config, result);
  out += stated_table(result);
  out += departures_table(result);
  out += input_table(result);
  out += branch_table(result);
  out += coverage_table(result);
  out += samples_section(result, figure);
  out += correlation_table(result);
  out += diagnostics(result, frames, figure);
  out += identifiability(config, result);
  out += model_section(config, result);
  out += data_section(config, result);

  out += provenance_section(config, result);
  // Open, so that it is on paper, too.
  out += "<details open><summary>Config as read</summary>\n<pre>" + escape_html(config.text) + "</pre></details>\n";
  if (!result.solver_report.empty())
    out += "<details><summary>The solver\u2019s own report</summary>\n<pre>" + escape_html(result.solver_report) +
           "</pre></details>\n";
  return out + "</main>\n</body>\n</html>\n";
}

}  // namespace birefit
