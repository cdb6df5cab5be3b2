#include "python/tree.h"

#include "birefit/error.h"
#include "io/config/overrides.h"
#include "io/config/yaml.h"

namespace birefit::python {
namespace {

namespace py = pybind11;

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw UserError({"config"}, (path.empty() ? "the tree" : path) + " " + what,
                  "a config holds dictionaries with keys of text, lists, numbers, text, True, False and None");
}

YamlNode scalar(std::string text) {
  YamlNode node;
  node.kind = YamlNode::Kind::scalar;
  node.text = std::move(text);
  return node;
}

/// As UTF-8, which half of a surrogate pair has none of.
std::string utf8(const py::handle& text, const std::string& path) {
  py::ssize_t size = 0;
  const char* const bytes = PyUnicode_Check(text.ptr()) ? PyUnicode_AsUTF8AndSize(text.ptr(), &size) : nullptr;
  if (bytes) return {bytes, static_cast<std::size_t>(size)};
  PyErr_Clear();
  refuse(path, "has text that is no Unicode");
}

/// Text that YAML would take for something else stays text.
YamlNode text_node(const py::handle& value, const std::string& path) {
  YamlNode node = scalar(utf8(value, path));
  const std::string& text = node.text;
  node.quoted = text.empty() || text == "null" || text == "~" || text == "true" || text == "false" ||
                text.find_first_of("0123456789.+-") == 0;
  return node;
}

YamlNode node_of(const py::handle& value, const std::string& path, int depth) {
  if (depth > kMaxYamlDepth) refuse(path, "is nested too deeply");
  if (value.is_none()) return {};
  if (py::isinstance<py::bool_>(value)) return scalar(value.cast<bool>() ? "true" : "false");
  if (py::isinstance<py::str>(value)) return text_node(value, path);
  if (py::isinstance<py::int_>(value) || py::isinstance<py::float_>(value))
    return scalar(py::repr(py::isinstance<py::int_>(value) ? py::object(py::int_(value.cast<py::int_>()))
                                                           : py::object(py::float_(value.cast<double>()))));
  YamlNode node;
  if (py::isinstance<py::dict>(value)) {
    node.kind = YamlNode::Kind::map;
    for (const auto& [key, of_key] : value.cast<py::dict>()) {
      if (!py::isinstance<py::str>(key)) refuse(path, "has a key that is no text");
      const std::string name = utf8(key, path);
      node.entries.push_back({name, {}, node_of(of_key, path.empty() ? name : path + "." + name, depth + 1)});
    }
    return node;
  }
  if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
    node.kind = YamlNode::Kind::sequence;
    for (const py::handle item : value.cast<py::sequence>())
      node.items.push_back(node_of(item, path + "[" + std::to_string(node.items.size()) + "]", depth + 1));
    return node;
  }
  if (py::hasattr(value, "tolist")) return node_of(value.attr("tolist")(), path, depth + 1);  // NumPy's
  if (py::hasattr(value, "__fspath__")) return text_node(value.attr("__fspath__")(), path);
  refuse(path, "is " + py::str(py::type::of(value).attr("__name__")).cast<std::string>());
}

}  // namespace

std::string text_of_tree(const py::dict& tree) { return text_of(node_of(tree, "", 0)); }

}  // namespace birefit::python
