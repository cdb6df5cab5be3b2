// fit.json: as a series that goes on reads it, and as a prior.
#include "birefit/series.h"
#include "fuzz_target.h"
#include "io/config/prior.h"

using namespace birefit;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::InputFile file("fit.json");
  const std::filesystem::path path = file.write(fuzz::text_of(data, size));
  fuzz::expect_an_answer([&] { load_recorded_fit(path); });
  return fuzz::expect_an_answer([&] {
    std::vector<std::string> warnings;
    load_prior(path, {{"material.birefringence", {}}, {"sample.droplet.diameter_um", {}}}, {}, warnings);
  });
}
