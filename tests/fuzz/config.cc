// Configs, to the point where a fit would begin: files that they name are looked for beside the shipped ones.
#include "birefit/io.h"
#include "fuzz_target.h"

using namespace birefit;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::expect_an_answer([&] {
    load_config_text(fuzz::text_of(data, size), BIREFIT_SOURCE_DIR "/fit_configs/fuzzed.yaml", ConfigUse::plan);
  });
}
