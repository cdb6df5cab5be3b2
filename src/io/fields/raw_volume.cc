#include "io/fields/raw_volume.h"

#include <fmt/format.h>

namespace birefit::fields {

void refuse(const std::string& file, const std::string& what, const std::string& hint) {
  throw UserError({file}, what, hint);
}

void check_size(const std::string& file, double nx, double ny, double nz) {
  if (!(nx >= 2 && ny >= 2 && nz >= 2))
    refuse(file,
           fmt::format("has {:.0f} x {:.0f} x {:.0f} nodes (x, y, z): at least 2 are needed along each", nx, ny, nz),
           "repeat a single layer: the field then does not change across it");
  if (nx * ny * nz > static_cast<double>(kMostNodes))
    refuse(file, fmt::format("has {:.3g} nodes, more than {:.0e}", nx * ny * nz, static_cast<double>(kMostNodes)),
           "keep every second node along each side");
}

void to_six(NodeArray& field) {
  std::vector<double> six;
  six.reserve(field.values.size() / 9 * 6);
  for (std::size_t i = 0; i + 9 <= field.values.size(); i += 9) {
    const double* m = field.values.data() + i;
    six.insert(six.end(), {m[0], m[4], m[8], 0.5 * (m[1] + m[3]), 0.5 * (m[2] + m[6]), 0.5 * (m[5] + m[7])});
  }
  field.values = std::move(six);
  field.components = 6;
}

std::array<double, 3> demand_spacing(const VolumeRequest& request, const std::string& format) {
  if (!request.spacing_um)
    throw UserError(request.where, "a " + format + " file needs spacing_um", "[dx, dy, dz] between nodes");
  return *request.spacing_um;
}

void refuse_spacing(const VolumeRequest& request, const std::string& format) {
  if (request.spacing_um)
    throw UserError(request.where, "spacing_um belongs to .npy files: a " + format + " says it itself",
                    "leave it out; scale stretches the box");
}

}  // namespace birefit::fields
