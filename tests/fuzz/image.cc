// Image files of every format that is read, pictures and masks.
#include "birefit/io.h"
#include "fuzz_target.h"

using namespace birefit;

namespace {
/// The ending that a writer would give it: readers are tried by the ending first.
std::string name_of(const std::string& bytes) {
  if (bytes.starts_with("\x89PNG")) return "input.png";
  if (bytes.starts_with("\xff\xd8")) return "input.jpg";
  if (bytes.starts_with("\x93NUMPY")) return "input.npy";
  if (bytes.starts_with("P")) return "input.pgm";
  return "input.tif";
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes = fuzz::text_of(data, size);
  const fuzz::InputFile file(name_of(bytes));
  for (const bool mask : {false, true})
    fuzz::expect_an_answer([&] {
      load_image({.path = file.write(bytes), .page = 0, .channel = "mean", .where = {}, .mask = mask, .cells = !mask});
    });
  return 0;
}
