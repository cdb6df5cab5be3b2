// Makes the field and the image of data/volume: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/volume.cc -o make_volume && ./make_volume

#include <cstdint>
#include <fstream>

#include "independent_droplet.h"  // camera()
#include "independent_volume.h"
#include "pgm.h"

namespace {

void append_block(std::string& data, const void* values, std::uint32_t bytes) {
  data.append(reinterpret_cast<const char*>(&bytes), 4);
  data.append(static_cast<const char*>(values), bytes);
}

}  // namespace

int main() {
  using namespace birefit::testing;
  constexpr int kSize = 48;
  IndependentVolume v = radial_ball(32, 4.0, 4.2);
  v.birefringence = 0.12;
  v.center_x_px = 23.2;
  v.center_y_px = 24.1;
  v.um_per_px = 0.2;
  std::ofstream file("field.vti", std::ios::binary);
  const std::string extent = "\"0 31 0 31 0 31\"", spacing = std::to_string(v.spacing_um);
  v.spacing_um = std::stod(spacing);  // as the file says it
  std::string data;
  append_block(data, v.director.data(), static_cast<std::uint32_t>(v.director.size() * 12));
  const std::size_t second = data.size();
  append_block(data, v.inside.data(), static_cast<std::uint32_t>(v.inside.size()));
  file << "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"0.1\" byte_order=\"LittleEndian\" "
          "header_type=\"UInt32\">\n<ImageData WholeExtent="
       << extent << " Origin=\"0 0 0\" Spacing=\"" << spacing << " " << spacing << " " << spacing
       << "\">\n<Piece Extent=" << extent
       << ">\n<PointData>\n<DataArray type=\"Float32\" Name=\"n\" NumberOfComponents=\"3\" format=\"appended\" "
          "offset=\"0\"/>\n"
       << "<DataArray type=\"UInt8\" Name=\"domain_mask\" format=\"appended\" offset=\"" << second
       << "\"/>\n</PointData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_" << data
       << "\n</AppendedData>\n</VTKFile>\n";
  std::vector<double> mean;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) mean.push_back(90 + 3300 * v.pixel(column, row, 8));
  write_pgm("volume.pgm", kSize, kSize, camera(mean, 0.5, 4.0, 271));
}
