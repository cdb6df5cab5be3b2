#pragma once
// A number of a config that is tied to others by arithmetic, as the reader finds it.

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "birefit/expression.h"
#include "birefit/number_spec.h"
#include "io/config/yaml.h"

namespace birefit {

/// A number that the config ties to others.
struct TiedNumber {
  int index = -1;  ///< its entry
  std::shared_ptr<Expression> law;
  NumberSpec spec;
  Where where;          ///< of the expression's first character
  std::vector<int> of;  ///< once names are looked up; empty before, and where one is not known
};

/// By path, what a tied number begins with and what it can reach within the bounds of what it follows from.
struct TieStart {
  double value = 0, low = 0, high = 0;
};
using TieStarts = std::map<std::string, TieStart>;

/// A place within a word of the config, counted from its first character, 1.
Where within(const YamlNode& word, int column);
/// The expression that a word is, where it reads other numbers; null for all else.
std::shared_ptr<Expression> tie_in(const YamlNode& word);

}  // namespace birefit
