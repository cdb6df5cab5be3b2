// Director fields: arrays of numpy, VTK's two formats, the text of open-Qmin.
#include "fuzz_target.h"
#include "io/fields/volume_file.h"

using namespace birefit;

namespace {
std::string name_of(const std::string& bytes) {
  if (bytes.starts_with("\x93NUMPY")) return "input.npy";
  if (bytes.starts_with("PK")) return "input.npz";
  if (bytes.starts_with("<")) return "input.vti";
  if (bytes.starts_with("# vtk")) return "input.vtk";
  return "input.txt";
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes = fuzz::text_of(data, size);
  const fuzz::InputFile file(name_of(bytes));
  return fuzz::expect_an_answer([&] {
    VolumeRequest request;
    request.path = file.write(bytes);
    request.spacing_um = {0.1, 0.1, 0.1};
    load_volume(request);
  });
}
