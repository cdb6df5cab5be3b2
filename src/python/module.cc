// The extension module birefit._birefit: what the package birefit is a cover of. Its types are documented there.

#include <cstdlib>
#include <exception>
#include <new>

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "birefit/error.h"
#include "birefit/render.h"
#include "core/printable.h"
#include "python/job.h"

namespace birefit::python {
namespace {

/// Of a file, as Python has names that are no UTF-8.
py::str given_name(const std::string& file) {
  return py::reinterpret_steal<py::str>(
      PyUnicode_DecodeFSDefaultAndSize(file.data(), static_cast<py::ssize_t>(file.size())));
}

/// Mistakes of the user's become birefit.Error.
void raise(const UserError& error) {
  py::list problems;
  for (const Problem& problem : error.problems()) {
    Problem place{problem.where, "", ""};
    std::string text = to_string(place);  // "FILE:LINE:COLUMN: "
    text = text.size() < 2 ? "" : text.substr(0, text.size() - 2);
    problems.append(py::make_tuple(text, printable(problem.what), printable(problem.hint),
                                   given_name(problem.where.file), problem.where.line, problem.where.column));
  }
  const py::object type = py::module_::import("birefit._errors").attr("Error");
  PyErr_SetObject(type.ptr(), type(problems).ptr());
}

}  // namespace
}  // namespace birefit::python

PYBIND11_MODULE(_birefit, module) {
  using namespace birefit::python;
  // OpenImageIO would make a thread for every core of the machine and fail where a container grants fewer.
  ::setenv("OPENIMAGEIO_THREADS", "1", 0);
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const birefit::UserError& error) {
      raise(error);
    }
  });
  module.attr("version") = BIREFIT_VERSION;
  module.attr("rays_side_by_side") = birefit::rays_side_by_side();
  define_job(module);
  define_result(module);
}
