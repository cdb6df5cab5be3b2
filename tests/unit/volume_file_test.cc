// Director fields from files: every layout that is read, every mistake that is found.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>

#include "io/fields/volume_file.h"

namespace birefit {
namespace {

using ::testing::HasSubstr;

class VolumeFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("birefit_volume_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path write(const std::string& name, const std::string& content) const {
    std::ofstream(folder_ / name, std::ios::binary) << content;
    return folder_ / name;
  }
  LoadedVolume npy(const std::string& content, bool x_first = false) const {
    VolumeRequest request;
    request.path = write("field.npy", content);
    request.x_first = x_first;
    request.spacing_um = {{0.2, 0.3, 0.4}};
    return load_volume(request);
  }
  LoadedVolume vti(const std::string& content, double bulk_order = 0) const {
    VolumeRequest request;
    request.path = write("field.vti", content);
    request.bulk_order = bulk_order;
    return load_volume(request);
  }
  std::string npy_error(const std::string& content) const {
    return error_of([&] { npy(content); });
  }
  std::string vti_error(const std::string& content) const {
    return error_of([&] { vti(content); });
  }
  static std::string error_of(const std::function<void()>& body) {
    try {
      body();
    } catch (const UserError& error) {
      return error.what();
    }
    return "no error";
  }
  std::filesystem::path folder_;
};

constexpr int kNx = 2, kNy = 3, kNz = 4, kNodes = kNx * kNy * kNz;

std::array<double, 3> director(int x, int y, int z) {
  const double tilt = 0.2 + 0.1 * x - 0.15 * z, azimuth = 0.5 * y + 0.3 * z - 0.7 * x;
  return {std::cos(tilt) * std::cos(azimuth), std::cos(tilt) * std::sin(azimuth), std::sin(tilt)};
}

template <class T>
std::string raw_bytes(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

std::string npy_text(const std::string& header, const std::string& data, int version = 1) {
  std::string text = "\x93NUMPY";
  text += static_cast<char>(version);
  text += '\0';
  const std::uint32_t length = static_cast<std::uint32_t>(header.size());
  text.append(reinterpret_cast<const char*>(&length), version == 1 ? 2 : 4);
  return text + header + data;
}
std::string header(const std::string& type, bool fortran, const std::string& shape) {
  return "{'descr': '" + type + "', 'fortran_order': " + (fortran ? "True" : "False") + ", 'shape': " + shape +
         ", }   \n";
}

/// Values of the node's components in the order of the array.
template <class T>
std::string npy_data(bool x_first, bool fortran, int components,
                     const std::function<double(int, int, int, int)>& value) {
  const int n[4] = {x_first ? kNx : kNz, kNy, x_first ? kNz : kNx, components};
  std::vector<T> all(static_cast<std::size_t>(kNodes * components));
  for (int a = 0; a < n[0]; ++a)
    for (int b = 0; b < n[1]; ++b)
      for (int c = 0; c < n[2]; ++c)
        for (int d = 0; d < n[3]; ++d) {
          const int at = fortran ? a + n[0] * (b + n[1] * (c + n[2] * d)) : ((a * n[1] + b) * n[2] + c) * n[3] + d;
          all[static_cast<std::size_t>(at)] = static_cast<T>(x_first ? value(a, b, c, d) : value(c, b, a, d));
        }
  return raw_bytes(all);
}

double component(int x, int y, int z, int c) { return director(x, y, z)[static_cast<std::size_t>(c)]; }

void expect_field(const LoadedVolume& volume, double tolerance, double order = 1) {
  ASSERT_TRUE(volume.grid);
  ASSERT_EQ(volume.grid->nx, kNx);
  ASSERT_EQ(volume.grid->ny, kNy);
  ASSERT_EQ(volume.grid->nz, kNz);
  for (int z = 0; z < kNz; ++z)
    for (int y = 0; y < kNy; ++y)
      for (int x = 0; x < kNx; ++x) {
        const auto n = director(x, y, z);
        const auto expected = director_tensor(n[0], n[1], n[2], order);
        for (std::size_t c = 0; c < 6; ++c)
          ASSERT_NEAR(volume.grid->nodes[volume.grid->at(x, y, z)][c], expected[c], tolerance)
              << x << y << z << " " << c;
      }
}

// Rounding of float or double.
TEST_F(VolumeFile, NumpyInEveryLayout) {
  for (bool x_first : {false, true})
    for (bool fortran : {false, true}) {
      const std::string shape = x_first ? "(2, 3, 4, 3)" : "(4, 3, 2, 3)";
      const LoadedVolume single =
          npy(npy_text(header("<f4", fortran, shape), npy_data<float>(x_first, fortran, 3, component)), x_first);
      expect_field(single, 3e-7);
      EXPECT_EQ(single.grid->spacing_um, (std::array<double, 3>{0.2, 0.3, 0.4}));
      EXPECT_TRUE(single.warnings.empty());
      expect_field(
          npy(npy_text(header("<f8", fortran, shape), npy_data<double>(x_first, fortran, 3, component)), x_first),
          1e-15);
    }
  for (int version : {2, 3})
    expect_field(
        npy(npy_text(header("<f8", false, "(4, 3, 2, 3)"), npy_data<double>(false, false, 3, component), version)),
        1e-15);
}

// Q = S (n n - 1/3) with one S: relative order 1 whatever S is. Eigenvectors to rounding.
TEST_F(VolumeFile, NumpyTensors) {
  const auto q = [](int x, int y, int z, int i, int j) {
    const auto n = director(x, y, z);
    return 0.6 * (n[static_cast<std::size_t>(i)] * n[static_cast<std::size_t>(j)] - (i == j ? 1.0 / 3 : 0));
  };
  const auto six = [&](int x, int y, int z, int c) {
    const int i[6] = {0, 1, 2, 0, 0, 1}, j[6] = {0, 1, 2, 1, 2, 2};
    return q(x, y, z, i[c], j[c]);
  };
  const auto nine = [&](int x, int y, int z, int c) { return q(x, y, z, c / 3, c % 3); };
  const LoadedVolume volume =
      npy(npy_text(header("<f8", false, "(4, 3, 2, 6)"), npy_data<double>(false, false, 6, six)));
  expect_field(volume, 1e-13);
  EXPECT_NEAR(volume.bulk_order, 0.6, 1e-13);
  expect_field(npy(npy_text(header("<f8", false, "(4, 3, 2, 3, 3)"), npy_data<double>(false, false, 9, nine))), 1e-13);
  expect_field(npy(npy_text(header("<f8", true, "(4, 3, 2, 3, 3)"), npy_data<double>(false, true, 9, nine))), 1e-13);
  // The upper triangle by rows, as some write it, is not what is read: its trace gives it away.
  const auto triangle = [&](int x, int y, int z, int c) {
    const int i[6] = {0, 0, 0, 1, 1, 2}, j[6] = {0, 1, 2, 1, 2, 2};
    return q(x, y, z, i[c], j[c]);
  };
  EXPECT_THAT(npy_error(npy_text(header("<f8", false, "(4, 3, 2, 6)"), npy_data<double>(false, false, 6, triangle))),
              HasSubstr("has the trace"));
}

// n and -n are one state: not a bit changes.
TEST_F(VolumeFile, TheSignOfADirectorHasNoMeaning) {
  const auto flipped = [](int x, int y, int z, int c) {
    return ((x + 2 * y + 3 * z) % 2 ? -1 : 1) * component(x, y, z, c);
  };
  const LoadedVolume a =
      npy(npy_text(header("<f8", false, "(4, 3, 2, 3)"), npy_data<double>(false, false, 3, component)));
  const LoadedVolume b =
      npy(npy_text(header("<f8", false, "(4, 3, 2, 3)"), npy_data<double>(false, false, 3, flipped)));
  EXPECT_EQ(a.grid->nodes, b.grid->nodes);
}

TEST_F(VolumeFile, LongDirectorsAreNormalisedWithAWarning) {
  const LoadedVolume volume = npy(
      npy_text(header("<f8", false, "(4, 3, 2, 3)"), npy_data<double>(false, false, 3, [](int x, int y, int z, int c) {
                 return (x + y + z ? 1.0 : 1.5) * component(x, y, z, c);
               })));
  expect_field(volume, 1e-15);
  ASSERT_EQ(volume.warnings.size(), 1u);
  EXPECT_THAT(volume.warnings[0], HasSubstr("off by up to 0.5, at [x, y, z] = [0, 0, 0]"));
}

TEST_F(VolumeFile, BadNumpyFiles) {
  const std::string good = npy_data<float>(false, false, 3, component), shape = "(4, 3, 2, 3)";
  EXPECT_THAT(npy_error("PK\3\4 something else"), HasSubstr("damaged or cut off archive"));
  EXPECT_THAT(npy_error(npy_text(header("<f4", false, shape), good, 9)), HasSubstr("version 9"));
  EXPECT_THAT(npy_error(npy_text(header("<c8", false, shape), good)), HasSubstr("astype"));
  EXPECT_THAT(npy_error(npy_text(header("<f4", false, "(4, 3, 2)"), good)), HasSubstr("expected (nz, ny, nx, 3)"));
  EXPECT_THAT(npy_error(npy_text(header("<f4", false, "(3, 4, 3, 2)"), good)), HasSubstr("moveaxis"));
  EXPECT_THAT(npy_error(npy_text(header("<f4", false, "(1, 3, 8, 3)"), good)), HasSubstr("at least 2"));
  EXPECT_THAT(npy_error(npy_text(header("<f4", false, "(99999, 99999, 99999, 3)"), good)),
              HasSubstr("every second node"));
  EXPECT_THAT(npy_error(npy_text(header("<f4", false, shape), good.substr(4))),
              HasSubstr("has 284 bytes of data, its shape needs 288"));
  EXPECT_THAT(npy_error(npy_text(header("<f4", false, shape), good).substr(0, 40)), HasSubstr("is cut short"));
  const auto spoilt = [&](double value) {
    return npy_text(header("<f8", false, shape), npy_data<double>(false, false, 3, [&](int x, int y, int z, int c) {
                      return x == 1 && y == 2 && z == 0 ? value : component(x, y, z, c);
                    }));
  };
  EXPECT_THAT(npy_error(spoilt(0)), HasSubstr("the director is zero at node [x, y, z] = [1, 2, 0]"));
  EXPECT_THAT(npy_error(spoilt(std::nan(""))), HasSubstr("is not a finite number at node [x, y, z] = [1, 2, 0]"));
  VolumeRequest request;
  request.path = write("field.npy", npy_text(header("<f4", false, shape), good));
  EXPECT_THAT(error_of([&] { load_volume(request); }), HasSubstr("needs spacing_um"));
  request.path = folder_ / "none.npy";
  EXPECT_THAT(error_of([&] { load_volume(request); }), HasSubstr("does not exist"));
  request.path = write("field.npz", "PK");
  EXPECT_THAT(error_of([&] { load_volume(request); }), HasSubstr("neither .npy, .npz, .vti"));
}

// ---- .vti ----------------------------------------------------------------------------------------------------------

std::string base64(const std::string& bytes) {
  static const char* const letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += k > bytes.size() - i ? '=' : letters[group >> (18 - 6 * k) & 63];
  }
  return out;
}
template <class H>
std::string with_length(const std::string& data) {
  const H length = static_cast<H>(data.size());
  return std::string(reinterpret_cast<const char*>(&length), sizeof length) + data;
}

std::string vti_text(const std::string& arrays, const std::string& appended = "",
                     const std::string& attributes = "byte_order=\"LittleEndian\" header_type=\"UInt32\"",
                     const std::string& image = "WholeExtent=\"3 4 0 2 0 3\" Origin=\"9 9 9\" Spacing=\"0.2 0.3 0.4\"",
                     const std::string& data = "PointData") {
  return "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" " + attributes + ">\n<ImageData " +
         image + ">\n<Piece Extent=\"3 4 0 2 0 3\">\n<" + data + ">\n" + arrays + "</" + data +
         ">\n</Piece>\n</ImageData>\n" + appended + "</VTKFile>\n";
}
std::string array_text(const std::string& name, int components, const std::string& type, const std::string& format,
                       const std::string& content, const std::string& more = "") {
  return "<DataArray type=\"" + type + "\" Name=\"" + name + "\" NumberOfComponents=\"" + std::to_string(components) +
         "\" format=\"" + format + "\" " + more + ">" + content + "</DataArray>\n";
}
template <class T>
std::vector<T> nodes(int components, const std::function<double(int, int, int, int)>& value) {
  std::vector<T> all;
  for (int z = 0; z < kNz; ++z)
    for (int y = 0; y < kNy; ++y)
      for (int x = 0; x < kNx; ++x)
        for (int c = 0; c < components; ++c) all.push_back(static_cast<T>(value(x, y, z, c)));
  return all;
}
std::string ascii(int components, const std::function<double(int, int, int, int)>& value) {
  std::string text;
  char number[40];
  for (double x : nodes<double>(components, value)) {
    std::snprintf(number, sizeof number, "%.17g ", x);
    text += number;
  }
  return text;
}

TEST_F(VolumeFile, VtkInEveryFormat) {
  const std::string doubles = raw_bytes(nodes<double>(3, component)), floats = raw_bytes(nodes<float>(3, component));
  const LoadedVolume volume = vti(vti_text(array_text("n", 3, "Float64", "ascii", ascii(3, component))));
  expect_field(volume, 1e-15);
  EXPECT_EQ(volume.grid->spacing_um, (std::array<double, 3>{0.2, 0.3, 0.4}));
  expect_field(vti(vti_text(array_text("n", 3, "Float64", "binary",
                                       "\n  " + base64(with_length<std::uint32_t>(doubles)) + "\n"))),
               1e-15);
  expect_field(vti(vti_text(array_text("n", 3, "Float32", "binary", base64(with_length<std::uint64_t>(floats))), "",
                            "byte_order=\"LittleEndian\" header_type=\"UInt64\"")),
               3e-7);
  // Some writers pad the length for itself.
  const std::uint32_t length = static_cast<std::uint32_t>(floats.size());
  expect_field(
      vti(vti_text(array_text("n", 3, "Float32", "binary",
                              base64(std::string(reinterpret_cast<const char*>(&length), 4)) + base64(floats)))),
      3e-7);
  // Appended, behind another array; raw data look like XML here and there.
  const std::string other = with_length<std::uint32_t>("</AppendedData> < & _ >");
  const std::string at = "offset=\"" + std::to_string(other.size()) + "\"";
  expect_field(vti(vti_text(array_text("n", 3, "Float64", "appended", "", at),
                            "<AppendedData encoding=\"raw\">\n  _" + other + with_length<std::uint32_t>(doubles) +
                                "\n</AppendedData>\n")),
               1e-15);
  const std::string first = base64(with_length<std::uint32_t>("xy"));
  expect_field(
      vti(vti_text(array_text("n", 3, "Float32", "appended", "", "offset=\"" + std::to_string(first.size()) + "\""),
                   "<AppendedData encoding=\"base64\">_" + first + base64(with_length<std::uint32_t>(floats)) +
                       "</AppendedData>\n")),
      3e-7);
}

TEST_F(VolumeFile, VtkTensorsOrderAndMask) {
  const auto q = [](int x, int y, int z, int c) {
    const int i[6] = {0, 1, 2, 0, 1, 0}, j[6] = {0, 1, 2, 1, 2, 2};  // VTK: .. xy, yz, xz
    const auto n = director(x, y, z);
    return 0.5 * (n[static_cast<std::size_t>(i[c])] * n[static_cast<std::size_t>(j[c])] - (c < 3 ? 1.0 / 3 : 0));
  };
  expect_field(vti(vti_text(array_text("Q", 6, "Float64", "ascii", ascii(6, q)))), 1e-13);
  expect_field(vti(vti_text(array_text("Q", 6, "Float64", "ascii", ascii(6, q))), 1.0), 1e-13, 0.5);
  const std::string n = array_text("n", 3, "Float64", "ascii", ascii(3, component));
  const LoadedVolume volume = vti(vti_text(
      n + array_text("S", 1, "Float64", "ascii", ascii(1, [](int x, int, int, int) { return x ? 0.3 : 0.6; }))));
  EXPECT_NEAR(volume.bulk_order, 0.6, 1e-15);
  const auto trace = [](const std::array<double, 6>& t) { return t[0] + t[1] + t[2]; };
  EXPECT_NEAR(trace(volume.grid->nodes[0]), 1, 1e-14);
  EXPECT_NEAR(trace(volume.grid->nodes[1]), 0.5, 1e-14);
  // Behind the mask anything may stand.
  const auto holed = [](int x, int y, int z, int c) {
    return x == 0 && y == 0 ? std::numeric_limits<double>::quiet_NaN() : component(x, y, z, c);
  };
  const auto mask = nodes<std::uint8_t>(1, [](int x, int y, int, int) { return x == 0 && y == 0 ? 0 : 1; });
  const LoadedVolume masked = vti(
      vti_text(array_text("n", 3, "Float64", "ascii", ascii(3, holed)) +
               array_text("domain_mask", 1, "UInt8", "binary", base64(with_length<std::uint32_t>(raw_bytes(mask))))));
  EXPECT_EQ(trace(masked.grid->nodes[0]), 0);
  EXPECT_NEAR(trace(masked.grid->nodes[1]), 1, 1e-14);
}

TEST_F(VolumeFile, BadVtkFiles) {
  const std::string floats = raw_bytes(nodes<float>(3, component)),
                    good = array_text("n", 3, "Float64", "ascii", ascii(3, component));
  const std::string binary = array_text("n", 3, "Float32", "binary", base64(with_length<std::uint32_t>(floats)));
  EXPECT_THAT(vti_error("<VTKFile type=\"UnstructuredGrid\"></VTKFile>"), HasSubstr("Resample To Image"));
  EXPECT_THAT(vti_error(vti_text(binary, "", "compressor=\"vtkZfpDataCompressor\" byte_order=\"LittleEndian\"")),
              HasSubstr("is compressed by vtkZfpDataCompressor"));
  EXPECT_THAT(vti_error(vti_text(binary, "", "compressor=\"vtkZLibDataCompressor\" byte_order=\"LittleEndian\"")),
              HasSubstr("n is cut short or damaged"));
  EXPECT_THAT(vti_error(vti_text(binary, "", "byte_order=\"MiddleEndian\"")), HasSubstr("is unknown"));
  EXPECT_THAT(vti_error(vti_text(good, "", "", "WholeExtent=\"3 4 0 2 0 3\" Spacing=\"0.2 0.3 0.4\"", "CellData")),
              HasSubstr("Cell Data To Point Data"));
  EXPECT_THAT(vti_error(vti_text(array_text("velocity", 3, "Float64", "ascii", ascii(3, component)))),
              HasSubstr("it has velocity"));
  EXPECT_THAT(vti_error(vti_text(good + array_text("Q", 9, "Float64", "ascii", ""))), HasSubstr("both n and Q"));
  EXPECT_THAT(vti_error(vti_text(array_text("n", 2, "Float64", "ascii", ""))),
              HasSubstr("n has 2 components, expected 3"));
  EXPECT_THAT(vti_error(vti_text(array_text("n", 3, "Float64", "ascii", "1 0 0"))),
              HasSubstr("n has 3 numbers, its 2 x 3 x 4 nodes need 72"));
  EXPECT_THAT(vti_error(vti_text(array_text("n", 3, "Float64", "ascii", "1 0 zero"))),
              HasSubstr("value 3 is no number"));
  EXPECT_THAT(vti_error(vti_text(
                  array_text("n", 3, "Float32", "binary", base64(with_length<std::uint32_t>(floats)).substr(0, 100)))),
              HasSubstr("n is cut short"));
  EXPECT_THAT(vti_error(vti_text(
                  array_text("n", 3, "Float32", "binary", base64(with_length<std::uint32_t>(floats.substr(12)))))),
              HasSubstr("nodes need 72"));
  EXPECT_THAT(vti_error(vti_text(array_text("n", 3, "Float32", "appended", "", "offset=\"5000\""),
                                 "<AppendedData encoding=\"raw\">_abc</AppendedData>")),
              HasSubstr("behind the end of the file"));
  EXPECT_THAT(vti_error(vti_text(good, "", "", "WholeExtent=\"0 9 0 2 0 3\" Spacing=\"1 1 1\"")),
              HasSubstr("not the WholeExtent"));
  EXPECT_THAT(vti_error(vti_text(good, "", "", "WholeExtent=\"3 4 0 2 0 3\" Spacing=\"1 0 1\"")),
              HasSubstr("three positive numbers"));
  EXPECT_THAT(vti_error(vti_text(good, "", "",
                                 "WholeExtent=\"3 4 0 2 0 3\" Spacing=\"1 1 1\" Direction=\"0 1 0 1 0 0 0 0 1\"")),
              HasSubstr("rotation_deg"));
  EXPECT_THAT(vti_error(vti_text(array_text(
                  "n", 3, "Float64", "ascii",
                  ascii(3, [](int x, int y, int z, int c) { return z == 3 ? 0.0 : component(x, y, z, c); })))),
              HasSubstr("n is zero at node [x, y, z] = [0, 0, 3]"));
  EXPECT_THAT(vti_error(vti_text(good + array_text("domain_mask", 1, "Float64", "ascii",
                                                   ascii(1, [](int, int, int, int) { return 0.0; })))),
              HasSubstr("leaves no node"));
  VolumeRequest request;
  request.path = write("field.vti", vti_text(good));
  request.spacing_um = {{1, 1, 1}};
  EXPECT_THAT(error_of([&] { load_volume(request); }), HasSubstr("spacing_um belongs to .npy"));
}

}  // namespace
}  // namespace birefit
