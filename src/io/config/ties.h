#pragma once
// From the names in tied numbers and in `report:` to entries of the table.

#include <memory>
#include <string>
#include <vector>

#include "birefit/fit.h"
#include "io/config/reader.h"

namespace birefit {

/// `report:` of a config, its names not yet looked up.
struct Wanted {
  std::string name;
  std::shared_ptr<Expression> law;
  Where where;
};
std::vector<Wanted> read_report(ConfigReader& reader, const Block& root);

/// Looks up all names, checks units, finds circles; a picture or row that has a number of its own has its own of what
/// is tied to it, too. From then on reader.table knows the ties. Returns what the tied numbers begin with: those that
/// wait for what is found in a picture are not finite.
TieStarts bind_ties(ConfigReader& reader, const std::vector<Scene*>& scenes, const std::vector<Wanted>& wanted,
                    std::vector<Derived>& derived);
/// Values of what is tied, now that more is known of what it follows from.
void refresh_ties(ConfigReader& reader);
/// The same, and problems where they are outside of what they may be.
void check_ties(ConfigReader& reader);

}  // namespace birefit
