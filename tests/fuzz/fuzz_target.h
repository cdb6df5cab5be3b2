#pragma once
// What all fuzz targets share: bytes become a file, and everything but a mistake of the user ends the run.

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "birefit/error.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

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

/// A mutation of a config. Random bytes hardly ever leave one that is read to its end: three times in four a word or a
/// number of it takes another's place, or a line goes, or comes twice.
inline std::size_t mutate_config(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed) {
  std::minstd_rand random(seed);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  if (size == 0 || below(4) == 0) return LLVMFuzzerMutate(data, size, most);
  std::string text = text_of(data, size);
  struct Part {
    std::size_t begin, length;
  };
  const auto parts_of = [&](const auto& belongs) {
    std::vector<Part> parts;
    for (std::size_t i = 0; i < text.size();) {
      std::size_t end = i;
      while (end < text.size() && belongs(text[end])) ++end;
      if (end > i) parts.push_back({i, end - i});
      i = std::max(end, i + 1);
    }
    return parts;
  };
  if (below(4) == 0) {
    const std::vector<Part> lines = parts_of([](char c) { return c != '\n'; });
    if (lines.empty()) return LLVMFuzzerMutate(data, size, most);
    const Part from = lines[below(lines.size())], to = lines[below(lines.size())];
    if (below(2) == 0)
      text.erase(from.begin, from.length + 1);
    else
      text.insert(to.begin, text.substr(from.begin, from.length) + "\n");
  } else {
    const std::vector<Part> words = parts_of(
        [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '.' || c == '-'; });
    if (words.empty()) return LLVMFuzzerMutate(data, size, most);
    const Part to = words[below(words.size())], from = words[below(words.size())];
    static const char* const kNumbers[] = {"0",    "-1",  "1",     "2",     "0.5", "90",
                                           "1e-9", "1e9", "1e300", "-0.01", "17",  "1.5"};
    const bool number = std::isdigit(static_cast<unsigned char>(text[to.begin])) && below(2) == 0;
    text.replace(to.begin, to.length,
                 number ? std::string(kNumbers[below(std::size(kNumbers))]) : text.substr(from.begin, from.length));
  }
  text.resize(std::min(text.size(), most));
  std::copy(text.begin(), text.end(), data);
  return text.size();
}

}  // namespace birefit::fuzz
