#pragma once
// Numbers of a config that a program gives by name, after the config was read.

#include <map>
#include <string>
#include <vector>

#include "birefit/io.h"
#include "birefit/number_spec.h"

namespace birefit {

/// The config path that a name means: itself, or the one that ends in it ("birefringence", "center_px.x"). Throws
/// UserError at `where`: there is none (with the nearest), or there are several.
std::string path_named(const std::vector<std::string>& paths, const std::string& name, const Where& where);
/// The parameter of a table that a name means in this way.
ParameterRef parameter_named(const ParameterTable& table, const std::string& name, const Where& where);

/// What the numbers of a config's scenes may be.
class ValueRanges {
 public:
  explicit ValueRanges(const Config& config);
  /// Throws UserError at `where`, of a table's entry and a value that it may not have.
  void check(const ParameterTable& table, int index, double value, const Where& where) const;
  /// Does a scene read that entry?
  bool reads(int index) const { return specs_.contains(index); }

 private:
  std::map<int, NumberSpec> specs_;
};

}  // namespace birefit
