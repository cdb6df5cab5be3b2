#include <cerrno>
#include <cstring>
#include <fstream>
#include <new>
#include <string>

#include <unistd.h>

#include "birefit/io.h"
#include "io/images/asked.h"
#include "io/images/npy_array.h"
#include "io/images/npy_image.h"
#include "io/libraries/table.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

bool begins_with(const fs::path& path, std::string_view magic) {
  std::string bytes(magic.size(), '\0');
  std::ifstream file(path, std::ios::binary);
  return file.read(bytes.data(), static_cast<std::streamsize>(bytes.size())) && bytes == magic;
}

}  // namespace

LoadedImage load_image(const ImageRequest& request) {
  std::error_code code;
  const fs::file_status status = fs::status(request.path, code);
  if (status.type() == fs::file_type::not_found)
    refuse_image(request, "does not exist", "check the name; relative paths start at the config's folder");
  if (code) refuse_image(request, "cannot be opened: " + code.message(), "check the permissions of its folder");
  if (fs::is_directory(status)) refuse_image(request, "is a folder", "name one image in it");
  if (!fs::is_regular_file(status)) refuse_image(request, "is not a file", "name an image file");
  const std::uintmax_t size = fs::file_size(request.path, code);
  if (code) refuse_image(request, "cannot be opened: " + code.message(), "check its permissions");
  if (size == 0) refuse_image(request, "is empty (zero bytes)", "copy it again from its source");
  if (::access(request.path.c_str(), R_OK) != 0)
    refuse_image(request, std::string("cannot be opened: ") + std::strerror(errno), "check its permissions");

  try {
    return begins_with(request.path, kNpyMagic) ? load_npy(request) : load_by_libraries(request);
  } catch (const std::bad_alloc&) {
    refuse_image(request, "does not fit into memory", "crop it to the object, or bin it");
  }
}

}  // namespace birefit
