#include "python/arrays.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "birefit/error.h"

namespace birefit::python {
namespace {

constexpr py::ssize_t kDouble = sizeof(double);

[[noreturn]] void refuse(const std::string& name, const std::string& what, const std::string& hint) {
  throw UserError({"array '" + name + "'"}, what, hint);
}

bool is(const py::array& array, const char* type) { return array.dtype().is(py::dtype(type)); }

ArrayImage::Sample sample_of(const py::array& array) {
  return is(array, "uint8")     ? ArrayImage::Sample::uint8
         : is(array, "uint16")  ? ArrayImage::Sample::uint16
         : is(array, "float32") ? ArrayImage::Sample::float32
                                : ArrayImage::Sample::float64;
}

/// Native, of a type that pictures have.
py::array readable(const py::array& array, const std::string& name) {
  const char kind = array.dtype().kind();
  if (kind != 'b' && kind != 'u' && kind != 'i' && kind != 'f')
    refuse(name, "has elements that are no real numbers", "an image has integers or floats");
  for (const char* type : {"uint8", "uint16", "float32", "float64"})
    if (is(array, type)) return array;
  const bool wide = kind != 'b' && !(kind == 'u' && array.itemsize() <= 2);
  const char* type = wide ? "float64" : array.itemsize() == 1 ? "uint8" : "uint16";
  return array.attr("astype")(type).cast<py::array>();
}

}  // namespace

ArrayImage image_of(const py::array& given, const std::string& name) {
  if (given.ndim() != 2 && given.ndim() != 3)
    refuse(name, "has " + std::to_string(given.ndim()) + " dimensions",
           "an image is (rows, columns) or (rows, columns, channels)");
  constexpr py::ssize_t kMost = 1 << 20;
  for (py::ssize_t i = 0; i < given.ndim(); ++i)
    if (given.shape(i) > kMost) refuse(name, "has too many pixels on a side", "crop it to the object, or bin it");
  py::array array = readable(given, name);
  ArrayImage image;
  const py::object masked = py::module_::import("numpy").attr("ma");
  if (py::isinstance(given, masked.attr("MaskedArray"))) {
    const bool some = masked.attr("is_masked")(given).cast<bool>();
    if (some && (is(array, "uint8") || is(array, "uint16"))) image.count_bits = is(array, "uint8") ? 8 : 16;
    array = (some ? array.attr("astype")("float64").attr("filled")(py::float_(std::nan(""))) : array.attr("data"))
                .cast<py::array>();
  }
  image.sample = sample_of(array);
  image.height = static_cast<int>(array.shape(0)), image.width = static_cast<int>(array.shape(1));
  image.row_bytes = array.strides(0), image.column_bytes = array.strides(1);
  if (array.ndim() == 3) image.channels = static_cast<int>(array.shape(2)), image.channel_bytes = array.strides(2);
  image.first = array.data();
  // Whoever lets go of it last may not have the interpreter's lock.
  image.owner = std::shared_ptr<const void>(new py::object(array), [](const py::object* object) {
    const py::gil_scoped_acquire lock;
    delete object;
  });
  return image;
}

py::array array_of(std::vector<Image> images) {
  const Image& first = images.front();
  const py::ssize_t rows = first.height(), columns = first.width(), count = std::ssize(images);
  if (count == 1) {
    const auto owner = std::make_shared<Image>(std::move(images.front()));
    return array_over({rows, columns}, {columns * kDouble, kDouble}, owner->values().data(), owner);
  }
  // A plane an image, one after the other: what is seen as (rows, columns, images) is written in order.
  const auto owner = std::make_shared<std::vector<double>>();
  owner->reserve(static_cast<std::size_t>(count) * first.size());
  for (const Image& image : images) owner->insert(owner->end(), image.values().begin(), image.values().end());
  return array_over({rows, columns, count}, {columns * kDouble, kDouble, rows * columns * kDouble}, owner->data(),
                    owner);
}

py::array view_of(const Image& image, const std::shared_ptr<const void>& owner) {
  py::array array =
      array_over({image.height(), image.width()}, {image.width() * kDouble, kDouble}, image.values().data(), owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

py::array array_of(Eigen::MatrixXd matrix) {
  const auto owner = std::make_shared<Eigen::MatrixXd>(std::move(matrix));
  return array_over({owner->rows(), owner->cols()}, {kDouble, owner->rows() * kDouble}, owner->data(), owner);
}

py::array array_of(Eigen::VectorXd vector) {
  const auto owner = std::make_shared<Eigen::VectorXd>(std::move(vector));
  return array_over({owner->size()}, {kDouble}, owner->data(), owner);
}

}  // namespace birefit::python
