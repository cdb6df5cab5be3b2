#include "app/plot.h"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>

#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "birefit/error.h"
#include "birefit/io.h"

namespace birefit {
namespace {

/// Runs gnuplot without a shell, its input from one open file and its output to another; its exit code, or the error of
/// starting it.
int run_gnuplot(std::FILE* input, std::FILE* output) {
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_adddup2(&files, fileno(input), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&files, fileno(output), STDOUT_FILENO);
  char name[] = "gnuplot";
  char* arguments[] = {name, nullptr};
  pid_t child = 0;
  const int failure = posix_spawnp(&child, name, &files, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&files);
  if (failure != 0) return failure;
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return errno;
  return status;
}

/// What an open file holds, from its beginning; nothing where it cannot be read.
std::string content_of(std::FILE* file) {
  std::string content;
  std::rewind(file);
  char buffer[65536];
  while (const std::size_t count = std::fread(buffer, 1, sizeof buffer, file)) content.append(buffer, count);
  return std::ferror(file) ? std::string() : content;
}

}  // namespace

bool draw(const std::string& script, const std::filesystem::path& picture) {
  const auto close = [](std::FILE* file) { std::fclose(file); };
  // Both ways go through files without a name: a pipe that nobody reads would end this program, and whatever ends it
  // leaves nothing half drawn.
  const std::unique_ptr<std::FILE, decltype(close)> input(std::tmpfile(), close), output(std::tmpfile(), close);
  bool done = input && output && std::fwrite(script.data(), 1, script.size(), input.get()) == script.size();
  if (done) {
    std::rewind(input.get());
    done = run_gnuplot(input.get(), output.get()) == 0;
  }
  const std::string drawn = done ? content_of(output.get()) : std::string();
  if (drawn.empty()) {
    std::cerr << "birefit: no picture: gnuplot is not there or failed; the tables are complete (Debian: gnuplot-nox)\n";
    return false;
  }
  write_file(picture, drawn);
  return true;
}

std::string plot_text(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) {
    const bool control = static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
    quoted += control ? " " : c == '\'' ? "''" : std::string(1, c);
  }
  return quoted + "'";
}

void make_folder(const std::string& folder) {
  std::error_code failure;
  std::filesystem::create_directories(folder, failure);
  if (failure)
    throw UserError(Where{}, folder + " cannot be made: " + failure.message(), "name a folder that can be written");
}

std::string csv_number(double x) { return std::isfinite(x) ? fmt::format("{:.6g}", x) : std::string(); }

}  // namespace birefit
