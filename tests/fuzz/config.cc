// Configs, to the point where a fit would begin: files that they name are stand-ins that tools/fuzz makes.
#include "birefit/io.h"
#include "fuzz_target.h"

using namespace birefit;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::expect_an_answer([&] {
    load_config_text(fuzz::text_of(data, size), BIREFIT_FUZZ_BESIDE "/fit_configs/fuzzed.yaml", ConfigUse::plan);
  });
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed) {
  return fuzz::mutate_config(data, size, most, seed);
}
