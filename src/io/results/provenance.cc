#include "io/results/provenance.h"

#include <chrono>
#include <cmath>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include "core/printable.h"
#include "io/files/whole_file.h"

namespace birefit {

nlohmann::ordered_json made_by(const Config& config) {
  using Json = nlohmann::ordered_json;
  Json files = Json::array();
  files.push_back({{"file", printable(config.path.string())}, {"sha256", sha256(config.text)}});
  for (const std::filesystem::path& file : config.inputs) {
    const auto array = config.arrays.find(file);
    files.push_back({{"file", printable(file.string())},
                     {"sha256", array == config.arrays.end() ? sha256_of_file(file) : array->second}});
  }
  return {{"program", "birefit"}, {"version", BIREFIT_VERSION}, {"fft", BIREFIT_FFT}, {"files", std::move(files)}};
}

nlohmann::ordered_json this_run(double seconds) {
  char host[256] = {};
  if (::gethostname(host, sizeof host - 1) != 0) host[0] = 0;
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  return {{"date", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(now))},
          {"seconds", std::isfinite(seconds) ? nlohmann::ordered_json(seconds) : nlohmann::ordered_json(nullptr)},
          {"host", printable(host)}};
}

}  // namespace birefit
