#pragma once
// Configs as Python writes them: dictionaries, lists, numbers and text.

#include <string>

#include <pybind11/pybind11.h>

namespace birefit::python {

/// The text of the config that a dictionary is, nested as the YAML would be. Numbers keep all of their digits. Throws
/// UserError for what no config holds.
std::string text_of_tree(const pybind11::dict& tree);

}  // namespace birefit::python
