#include "birefit/parameters.h"

#include <utility>

namespace birefit {

ParameterRef ParameterTable::add(Parameter parameter) {
  parameters_.push_back(std::move(parameter));
  return {size() - 1};
}

ParameterRef ParameterTable::add_constant(std::string name, double value, std::string unit) {
  Parameter parameter;
  parameter.name = std::move(name);
  parameter.unit = std::move(unit);
  parameter.value = value;
  return add(std::move(parameter));
}

ParameterRef ParameterTable::find(const std::string& name) const {
  for (int i = 0; i < size(); ++i)
    if (parameters_[i].name == name) return {i};
  return {};
}

Theta ParameterTable::values() const {
  Theta theta(parameters_.size());
  for (std::size_t i = 0; i < theta.size(); ++i) theta[i] = parameters_[i].value;
  follow(theta);
  return theta;
}

}  // namespace birefit
