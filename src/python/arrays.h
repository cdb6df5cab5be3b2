#pragma once
// Between NumPy's arrays and what birefit computes with.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include "birefit/image.h"
#include "birefit/in_memory.h"
#include "birefit/parameters.h"

namespace birefit::python {

namespace py = pybind11;
using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// (rows, columns) or (rows, columns, channels), read where it lies; a type that pictures do not have is converted.
/// `name`: for errors. Throws UserError for another shape, or no numbers.
ArrayImage image_of(const py::array& array, const std::string& name);

/// An array over memory that belongs to `owner`: no copy. `owner` goes when the last array over it does.
template <class Owner>
py::array array_over(std::vector<py::ssize_t> shape, std::vector<py::ssize_t> strides, const double* data,
                     std::shared_ptr<Owner> owner) {
  auto* kept = new std::shared_ptr<Owner>(std::move(owner));
  const py::capsule capsule(kept, [](void* pointer) { delete static_cast<std::shared_ptr<Owner>*>(pointer); });
  return py::array(py::dtype::of<double>(), std::move(shape), std::move(strides), data, capsule);
}

/// Images of one size as (rows, columns) where there is one, else as (rows, columns, images). One is moved from.
py::array array_of(std::vector<Image> images);
/// A picture that belongs to `owner`, to read only.
py::array view_of(const Image& image, const std::shared_ptr<const void>& owner);
/// The same of numbers in columns.
py::array array_of(Eigen::MatrixXd matrix);
py::array array_of(Eigen::VectorXd vector);

}  // namespace birefit::python
