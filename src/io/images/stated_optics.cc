#include "io/images/stated_optics.h"

#include <cmath>
#include <cstring>
#include <string>

#include <pugixml.hpp>

namespace birefit {
namespace {

/// Elements go by their names without the namespace's prefix: ome:Objective is an Objective.
bool is_called(const pugi::xml_node& node, const char* name) {
  const char* const colon = std::strrchr(node.name(), ':');
  return std::strcmp(colon ? colon + 1 : node.name(), name) == 0;
}

/// The same positive number wherever elements of this name have it, else 0; `id`: of those with this ID alone.
double only_value(const pugi::xml_node& root, const char* element, const char* attribute, double unit_nm,
                  const std::string& id = {}) {
  double value = 0;
  bool several = false;
  struct Walker final : pugi::xml_tree_walker {
    bool for_each(pugi::xml_node& node) override {
      if (is_called(node, element) && (id->empty() || *id == node.attribute("ID").as_string())) {
        double here = node.attribute(attribute).as_double();
        const std::string unit = node.attribute((std::string(attribute) + "Unit").c_str()).as_string("nm");
        if (unit_nm > 0 && unit != "nm") here *= unit == "\xc2\xb5m" || unit == "um" ? 1000 : 0;
        if (std::isfinite(here) && here > 0) *several = *several || (*value > 0 && here != *value), *value = here;
      }
      return true;
    }
    const char *element, *attribute;
    double unit_nm;
    const std::string* id;
    double* value;
    bool* several;
  } walker;
  walker.element = element, walker.attribute = attribute, walker.unit_nm = unit_nm;
  walker.id = &id, walker.value = &value, walker.several = &several;
  pugi::xml_node from = root;
  from.traverse(walker);
  return several ? 0 : value;
}

std::string used_objective(const pugi::xml_node& root) {
  const pugi::xml_node settings =
      root.find_node([](const pugi::xml_node& node) { return is_called(node, "ObjectiveSettings"); });
  return settings.attribute("ID").as_string();
}

}  // namespace

StatedOptics stated_optics(const std::string& description) {
  pugi::xml_document document;
  if (description.find("OME") == std::string::npos || !document.load_buffer(description.data(), description.size()))
    return {};
  StatedOptics stated;
  stated.objective_na = only_value(document, "Objective", "LensNA", 0, used_objective(document));
  stated.emission_nm = only_value(document, "Channel", "EmissionWavelength", 1);
  return stated;
}

}  // namespace birefit
