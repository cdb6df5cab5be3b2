// Material files as refractiveindex.info has them; what is read has an index at every wavelength of its range.
#include "fuzz_target.h"
#include "io/config/material_file.h"

using namespace birefit;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::InputFile file("input.yml");
  return fuzz::expect_an_answer([&] { load_material_file(file.write(fuzz::text_of(data, size)), {}); });
}
