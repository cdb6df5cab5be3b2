#pragma once
// What every format of a sampled field comes down to, before its numbers are looked at.

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "io/fields/request.h"

namespace birefit::fields {

constexpr std::size_t kMostNodes = 100'000'000;

/// Components of one array by node, x fastest.
struct NodeArray {
  int components = 0;
  std::vector<double> values;  ///< [node * components + component]
};

struct RawVolume {
  std::string file;
  int nx = 0, ny = 0, nz = 0;
  std::array<double, 3> spacing_um{};
  std::string name;       ///< of the array with the directors, for messages
  bool tensor = false;    ///< `field` is Q with 6 components xx, yy, zz, xy, xz, yz
  double usual_norm = 1;  ///< of Q in files of this format: Q = norm S (n n - 1/3)
  NodeArray field;        ///< 3 or 6 components
  std::optional<NodeArray> order, mask;
};

[[noreturn]] void refuse(const std::string& file, const std::string& what, const std::string& hint);

/// At least 2 nodes along each side, and no more than can be held.
void check_size(const std::string& file, double nx, double ny, double nz);

/// [3][3] in rows to xx, yy, zz, xy, xz, yz.
void to_six(NodeArray& field);

/// The spacing that a file without one needs from the config.
std::array<double, 3> demand_spacing(const VolumeRequest& request, const std::string& format);
/// The config gives no spacing for a file that states its own.
void refuse_spacing(const VolumeRequest& request, const std::string& format);

}  // namespace birefit::fields
