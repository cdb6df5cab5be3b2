#pragma once
// What the config says of a file with a sampled field.

#include <array>
#include <filesystem>
#include <optional>
#include <string>

#include "birefit/error.h"

namespace birefit {

struct VolumeRequest {
  std::filesystem::path path;
  const std::string* content = nullptr;             ///< what the file would hold, where it is none; null: it is a file
  Where where;                                      ///< of the config entry, for what is wrong with the request
  std::string array;                                ///< its name, where the file has several; "" = n or Q
  double q_norm = 0;                                ///< Q = q_norm S (n n - 1/3); 0 = the format's own (1, or 3/2)
  bool x_first = false;                             ///< .npy: array[x, y, z] instead of array[z, y, x]
  std::optional<std::array<double, 3>> spacing_um;  ///< needed but for VTK's files, which say it
  /// order of the bulk, in the units of the file's S or Q; 0 = the largest in the file
  double bulk_order = 0;
};

}  // namespace birefit
