#pragma once
// What all fuzz targets share: bytes become a file, and everything but a mistake of the user ends the run.

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "birefit/error.h"

namespace birefit::fuzz {

/// The bytes under a name in a folder of this process; tools/fuzz keeps it in memory.
class InputFile {
 public:
  explicit InputFile(const std::string& name)
      : folder_(std::filesystem::temp_directory_path() / ("birefit_fuzz." + std::to_string(getpid()))),
        path_(folder_ / name) {
    std::filesystem::create_directories(folder_);
  }
  const std::filesystem::path& write(const std::string& bytes) const {
    std::ofstream(path_, std::ios::binary) << bytes;
    return path_;
  }

 private:
  std::filesystem::path folder_, path_;
};

/// How many inputs were no mistake; said at the end of a run.
inline void count_accepted() {
  static struct Count {
    long accepted = 0;
    ~Count() { std::fprintf(stderr, "accepted: %ld\n", accepted); }
  } count;
  ++count.accepted;
}

/// Runs `work`. A UserError is an answer; any other exception is uncaught, which libFuzzer reports with the input.
template <class Work>
int expect_an_answer(const Work& work) {
  try {
    work();
    count_accepted();
  } catch (const UserError&) {
  }
  return 0;
}

inline std::string text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace birefit::fuzz
