#pragma once
// 16-bit binary PGM, which any image tool turns into the shipped PNG.

#include <algorithm>
#include <cstdio>
#include <vector>

/// Codes of a 12-bit camera.
inline void write_pgm(const char* path, int width, int height, const std::vector<double>& counts) {
  std::FILE* file = std::fopen(path, "wb");
  if (!file) {
    std::perror(path);
    return;
  }
  std::fprintf(file, "P5\n%d %d\n65535\n", width, height);
  for (double c : counts) {
    const unsigned value = static_cast<unsigned>(std::min(4095.0, std::max(0.0, c)));
    std::fputc(static_cast<int>(value >> 8), file);
    std::fputc(static_cast<int>(value & 255), file);
  }
  std::fclose(file);
}
