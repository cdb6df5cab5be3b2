#include "app/demo.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iostream>

#include <fmt/format.h>

#include "app/output.h"
#include "birefit/error.h"
#include "birefit/io.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

/// As one word of a shell's line.
std::string for_shell(const fs::path& path) {
  const std::string text = path.string();
  const auto plain = [](unsigned char c) { return std::isalnum(c) || std::strchr("/._-+,:@%", c) || c >= 0x80; };
  if (std::all_of(text.begin(), text.end(), plain)) return text;
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

constexpr double kReadCounts = 4, kCountsPerPhoton = 0.5, kTopCode = 65535;

/// Normal numbers, the same on every machine: splitmix64 (Steele, Lea, Flood 2014) through Box and Muller's formula.
class Noise {
 public:
  double operator()() { return std::sqrt(-2 * std::log(uniform())) * std::cos(2 * M_PI * uniform()); }

 private:
  double uniform() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return (static_cast<double>((z ^ (z >> 31)) >> 11) + 0.5) / 9007199254740992.0;
  }

  std::uint64_t state_ = 7;
};

void make_picture(const Kind& kind, const DemoPicture& picture, const fs::path& config, Noise& noise) {
  Image counts(kind.width, kind.height);
  if (!picture.dark) counts = picture_of(kind, config, kind.width, kind.height, picture.set);
  for (double& value : counts.values()) {
    const double light = kind.gain * value;
    value = kind.offset + light + noise() * std::sqrt(kReadCounts * kReadCounts + kCountsPerPhoton * light);
    value = std::clamp(std::round(value), 0.0, kTopCode) / kTopCode;
  }
  const fs::path file = config.parent_path() / picture.file;
  fs::create_directories(file.parent_path());
  save_image(counts, file);
}

/// What the freedericksz config reads: the light at voltages from below the threshold to five times that.
void make_table(const Kind& kind, const fs::path& config, Noise& noise) {
  std::string text = "volts,photodiode_v\n";
  for (int i = 0; i < 48; ++i) {
    const double volts = 0.5 + 0.1 * i;
    const std::string at = fmt::format("sample.cell.director.freedericksz.voltage_v={:.1f}", volts);
    const double light = picture_of(kind, config, 1, 1, {at})(0, 0);
    text += fmt::format("{:.1f},{:.4f}\n", volts, kind.offset + kind.gain * light + 0.01 * kind.gain * noise());
  }
  write_file(config.parent_path() / "sweep.csv", text);
}

}  // namespace

void make_demo(const Kind& kind, const fs::path& folder) {
  const fs::path config = folder / (kind.name + ".yaml");
  if (std::error_code ignored; fs::exists(config, ignored))
    throw UserError({config.string()}, "is there already", "give --demo a folder of its own");
  OutputFolder made(folder);
  made.keep();
  // What is there tells that a demonstration is: not where it could not be finished.
  struct Unfinished {
    fs::path config;
    ~Unfinished() {
      std::error_code ignored;
      if (!config.empty()) fs::remove(config, ignored);
    }
  } unfinished{config};
  write_file(config, kind.config);
  for (const auto& [name, content] : kind.files) write_file(folder / name, content);
  Noise noise;
  for (const DemoPicture& picture : kind.pictures) make_picture(kind, picture, config, noise);
  if (kind.config.find("\nsignal:") != std::string::npos) make_table(kind, config, noise);

  if (!kind.truth.empty()) {
    std::string truth = "name,value\n";
    for (const auto& [path, value] : kind.truth) truth += fmt::format("{},{}\n", path, value);
    write_file(folder / "truth.csv", truth);
    std::cout << "A picture made with what the config does not know (" << (folder / "truth.csv").string() << "):\n";
    for (const auto& [path, value] : kind.truth) std::cout << fmt::format("  {} = {}\n", path, value);
  }
  unfinished.config.clear();
  const fs::path out = folder / (kind.command == "jones" ? "jones.csv" : "out");
  std::cout << "Run it:\n  birefit " << kind.command << " " << for_shell(config) << " --out " << for_shell(out) << "\n";
}

}  // namespace birefit
