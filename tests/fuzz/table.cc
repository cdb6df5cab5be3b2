// Tables of numbers and of text.
#include "fuzz_target.h"
#include "io/files/table.h"

using namespace birefit;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const fuzz::InputFile file("input.csv");
  const std::filesystem::path path = file.write(fuzz::text_of(data, size));
  for (const MissingNumbers missing : {MissingNumbers::refused, MissingNumbers::left_out})
    fuzz::expect_an_answer([&] { load_placed_table(path, {}, missing); });
  fuzz::expect_an_answer([&] {
    Problems problems;
    load_text_table(path, {}, problems, true);
  });
  return 0;
}
