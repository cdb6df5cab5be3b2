#include "app/plot.h"

#include <cmath>
#include <cstdio>
#include <iostream>

#include <fmt/format.h>

#include "birefit/error.h"

namespace birefit {

bool draw(const std::string& script) {
  std::FILE* pipe = popen("gnuplot", "w");
  bool done = pipe != nullptr;
  if (pipe) {
    std::fwrite(script.data(), 1, script.size(), pipe);
    done = pclose(pipe) == 0;
  }
  if (!done) std::cerr << "birefit: no picture: gnuplot is not there or failed; the tables are complete (Debian: gnuplot-nox)\n";
  return done;
}

std::string plot_path(const std::filesystem::path& path) {
  std::string quoted = "'";
  for (const char c : path.string()) quoted += c == '\'' ? std::string("''") : std::string(1, c);
  return quoted + "'";
}

void make_folder(const std::string& folder) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure) throw UserError(Where{}, folder + " cannot be made: " + failure.message(), "name a folder that can be written");
}

std::string csv_number(double x) { return std::isfinite(x) ? fmt::format("{:.6g}", x) : std::string(); }

}  // namespace birefit
