// birefit jones: complex transmission matrices as a table.

#include <iostream>
#include <iterator>
#include <memory>
#include <variant>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/output.h"
#include "birefit/io.h"
#include "core/printable.h"

namespace birefit {
namespace {

struct JonesArguments {
  std::string config;
  std::vector<std::string> set;
  std::string out;
  bool quiet = false;
};

int run_jones(const JonesArguments& arguments) {
  Problems problems;
  Config config;
  try {
    config = load_config(arguments.config, ConfigUse::render, std::nullopt, arguments.set);
  } catch (const UserError& error) {
    problems.add(error);
  }
  try {
    check_replaces_none(arguments.out, config.inputs);
    check_output_file(arguments.out, {".csv"});
  } catch (const UserError& error) {
    problems.add(error);
  }
  problems.throw_if_any();

  const Theta theta = config.job.parameters.values();
  const RenderPlan chosen = plan(config.scene, config.job.demand, theta);
  const std::vector<JonesRow> rows = jones(config.scene, chosen, theta);
  const bool slab = !config.scene.microscope.directions.empty();  // one row a direction
  std::string text = slab ? "theta_deg,azimuth_deg" : "row,col";
  text += ",wavelength_nm,re_ss,im_ss,re_ps,im_ps,re_sp,im_sp,re_pp,im_pp\n";
  const auto out = std::back_inserter(text);
  for (const JonesRow& row : rows) {
    // 17 digits: reading the table back gives the same bits.
    if (slab)
      fmt::format_to(out, "{:.17g},{:.17g}", row.theta_deg, row.azimuth_deg);
    else
      fmt::format_to(out, "{},{}", row.row, row.column);
    fmt::format_to(out, ",{:.17g}", row.wavelength_nm);
    for (const std::complex<double>& t : {row.ss, row.ps, row.sp, row.pp})
      fmt::format_to(out, ",{:.17g},{:.17g}", t.real(), t.imag());
    text += "\n";
  }
  write_file(arguments.out, text);
  if (!arguments.quiet) {
    print_warnings(config.job.warnings);
    print_warnings(config.job.taken_as_exact);
    print_warnings(chosen.warnings);
    print_warnings(chosen.left_out);
    std::cout << fmt::format("{}: {} matrices, method {} ({}), numerical error {:.1e}\n", printable(arguments.out),
                             rows.size(), chosen.method, chosen.physics, chosen.numerical_error);
  }
  return kExitDone;
}

}  // namespace

Command add_jones_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("jones", "complex transmission matrices (slab scenes: per direction; others: per pixel)");
  auto arguments = std::make_shared<JonesArguments>();
  command->add_option("CONFIG", arguments->config, "the config (YAML)")->required();
  add_set_option(*command, arguments->set);
  command->add_option("--out", arguments->out, "table to write (.csv)")->required();
  command->add_flag("-q,--quiet", arguments->quiet, "print nothing");
  return {command, [arguments] { return run_jones(*arguments); }};
}

}  // namespace birefit
