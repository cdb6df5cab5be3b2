#pragma once
// The commands of the program, one file each. Each adds itself to the command line and returns its exit code:
// 0 done, 1 the fit has no answer; a UserError it throws ends in 2 and anything else in 3 (main.cc).

#include <functional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace birefit {

struct Command {
  CLI::App* app = nullptr;
  std::function<int()> run;
};

Command add_fit_command(CLI::App& app);
Command add_series_command(CLI::App& app);
Command add_render_command(CLI::App& app);
Command add_jones_command(CLI::App& app);
Command add_view_command(CLI::App& app);
Command add_watch_command(CLI::App& app);
Command add_explain_command(CLI::App& app);
Command add_new_command(CLI::App& app);
Command add_schema_command(CLI::App& app);
Command add_chart_command(CLI::App& app);
Command add_stress_command(CLI::App& app);
Command add_audit_command(CLI::App& app);
Command add_michel_levy_command(CLI::App& app);

inline constexpr int kExitDone = 0;
inline constexpr int kExitNoAnswer = 1;
inline constexpr int kExitUserError = 2;
inline constexpr int kExitInternalError = 3;

/// --threads, checked: 0 (all cores) to 1024.
void add_threads_option(CLI::App& app, int& threads);
/// --set PATH=VALUE, any number of times.
void add_set_option(CLI::App& app, std::vector<std::string>& set);

}  // namespace birefit
