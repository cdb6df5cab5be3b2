// Director fields as other programs write them (tests/data/files, made by its make_fields.py).

#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/fields/volume_file.h"

namespace birefit {
namespace {

using ::testing::HasSubstr;

VolumeRequest request(const std::string& name) {
  VolumeRequest r;
  r.path = std::filesystem::path(BIREFIT_SOURCE_DIR) / "tests/data/files" / name;
  r.where = {"c.yaml", 4, 3};
  const std::string extension = r.path.extension().string();
  if (extension != ".vti" && extension != ".vtk") r.spacing_um = {{0.2, 0.3, 0.4}};
  return r;
}

std::string error_of(const VolumeRequest& r) {
  try {
    load_volume(r);
  } catch (const UserError& error) {
    return error.what();
  }
  return "none";
}

void expect_field(const LoadedVolume& volume) {
  ASSERT_TRUE(volume.grid);
  const VolumeGrid& grid = *volume.grid;
  ASSERT_EQ((std::array{grid.nx, grid.ny, grid.nz}), (std::array{2, 3, 4}));
  EXPECT_NEAR(grid.spacing_um[0], 0.2, 1e-7);  // of coordinates in single precision
  EXPECT_NEAR(grid.spacing_um[1], 0.3, 1e-7);
  EXPECT_NEAR(grid.spacing_um[2], 0.4, 1e-7);
  for (int z = 0; z < 4; ++z)
    for (int y = 0; y < 3; ++y)
      for (int x = 0; x < 2; ++x) {
        const std::array<double, 3> n{1.0 + x, 2.0 - y, 0.5 + z};
        const double length = std::hypot(n[0], n[1], n[2]);
        const auto expected = director_tensor(n[0] / length, n[1] / length, n[2] / length);
        for (std::size_t c = 0; c < 6; ++c)  // single precision, or twelve digits of text
          ASSERT_NEAR(grid.nodes[grid.at(x, y, z)][c], expected[c], 3e-7) << x << y << z << ' ' << c;
      }
}

class FieldFile : public ::testing::TestWithParam<const char*> {};

TEST_P(FieldFile, HoldsTheField) { expect_field(load_volume(request(GetParam()))); }

INSTANTIATE_TEST_SUITE_P(Programs, FieldFile,
                         ::testing::Values("field_ascii.vti", "field_zlib_inline.vti", "field_zlib_appended.vti",
                                           "field_zlib_raw.vti", "field_lz4_inline.vti", "field_lz4_appended.vti",
                                           "field_lz4_raw.vti", "field_lzma_inline.vti", "field_lzma_appended.vti",
                                           "field_lzma_raw.vti", "field_one_block.vti", "field_whole_blocks.vti",
                                           "field_big_endian.vti", "field_big_endian_zlib.vti", "points_ascii.vtk",
                                           "points_binary.vtk", "grid_ascii.vtk", "grid_binary.vtk",
                                           "tensors_ascii.vtk", "field_stored.npz", "field_deflated.npz",
                                           "field_big_endian.npy", "q.npy", "q_three_halves_small.npy",
                                           "open_qmin_small.txt", "field_masked.npz", "field_integers.npy"),
                         [](const auto& info) {
                           std::string name = info.param;
                           for (char& c : name)
                             if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
                           return name;
                         });

TEST(FieldFiles, ArraysAreChosenByName) {
  VolumeRequest r = request("field_named.npz");
  EXPECT_THAT(error_of(r), HasSubstr("has no array n or Q; it has directors, other"));
  r.array = "directors";
  expect_field(load_volume(r));
  r.array = "none";
  EXPECT_THAT(error_of(r), HasSubstr("has no array none"));
}

TEST(FieldFiles, TheNormOfQIsAskedForWhereTheOrderTellsTheOther) {
  VolumeRequest r = request("q_three_halves_small.npy");
  r.bulk_order = 0.5;
  EXPECT_THAT(error_of(r), ::testing::AllOf(HasSubstr("Q = S (n n - 1/3)"), HasSubstr("Q = 3/2 S (n n - 1/3)"),
                                            HasSubstr("q_norm: 1.5")));
  r.q_norm = 1.5;
  expect_field(load_volume(r));
  r.q_norm = 1;  // as it is, then: with a warning
  EXPECT_EQ(load_volume(r).warnings.size(), 1u);
  r = request("q.npy");
  r.bulk_order = 0.5;
  expect_field(load_volume(r));
  r = request("open_qmin_small.txt");
  r.bulk_order = 0.5;
  expect_field(load_volume(r));
  r.q_norm = 1;
  EXPECT_NEAR(load_volume(r).grid->nodes[0][0] * 21.0 / 4, 1.5, 1e-6);  // n = (1, 2, 0.5) over its length
}

// As ParaView writes a grid whose axes are given one by one.
TEST(FieldFiles, ARectilinearGridHasItsSpacingFromItsAxes) {
  const std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) / ("axes_" + std::to_string(getpid()) + ".vtk");
  const auto read = [&](const std::string& y_axis) {
    std::ofstream out(file);
    out << "# vtk DataFile Version 3.0\naxes\nASCII\nDATASET RECTILINEAR_GRID\nDIMENSIONS 2 3 4\n"
           "X_COORDINATES 2 float\n0 0.2\nY_COORDINATES "
        << y_axis << "\nZ_COORDINATES 4 float\n1 1.4 1.8 2.2\nPOINT_DATA 24\nVECTORS n float\n";
    for (int z = 0; z < 4; ++z)
      for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 2; ++x) out << 1 + x << ' ' << 2 - y << ' ' << 0.5 + z << '\n';
    out.close();
    VolumeRequest r;
    r.path = file;
    r.where = {"c.yaml", 4, 3};
    return r;
  };
  expect_field(load_volume(read("3 float\n-0.3 0 0.3")));
  EXPECT_THAT(error_of(read("4 float\n-0.3 0 0.3 0.6")), HasSubstr("has 4 Y_COORDINATES, DIMENSIONS say 3"));
  EXPECT_NE(error_of(read("3 float\n-0.3 0 0.9")), "none");  // layers of unequal thickness
  std::filesystem::remove(file);
}

TEST(FieldFiles, DamagedOnesAreRefused) {
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / ("fields_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  for (const char* name : {"field_zlib_appended.vti", "field_lz4_raw.vti", "field_lzma_inline.vti", "points_binary.vtk",
                           "grid_ascii.vtk", "field_deflated.npz", "field_stored.npz", "open_qmin_small.txt"}) {
    VolumeRequest r = request(name);
    std::ifstream in(r.path, std::ios::binary);
    const std::string whole{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
    r.path = folder / name;
    // Cut off anywhere but in its last tenth, where ends of tags and lines are; with any byte wrong a message or a
    // field, never a crash.
    for (std::size_t length = 0; length < whole.size() / 10 * 9; length += 1 + whole.size() / 40) {
      std::ofstream(r.path, std::ios::binary) << whole.substr(0, length);
      EXPECT_NE(error_of(r), "none") << name << " cut to " << length;
    }
    for (std::size_t at = 0; at < whole.size(); at += 1 + whole.size() / 100) {
      std::string wrong = whole;
      wrong[at] = static_cast<char>(wrong[at] ^ 0x55);
      std::ofstream(r.path, std::ios::binary) << wrong;
      error_of(r);
    }
  }
  // An archive whose directory is said to lie at the end of all numbers: nothing is read there.
  std::string directory = std::string("PK\6\6") + std::string(52, '\0');
  directory[32] = 1;  // one entry
  directory.replace(48, 8, 8, '\xff');
  const std::string far = "PK\3\4" + directory + "PK\5\6" + std::string(18, '\xff');
  VolumeRequest r = request("field_stored.npz");
  r.path = folder / "far.npz";
  std::ofstream(r.path, std::ios::binary) << far;
  EXPECT_THAT(error_of(r), HasSubstr("damaged or cut off archive"));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace birefit
