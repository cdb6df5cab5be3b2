#pragma once
// All families of random problems by name.

#include <ostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "random_cells.h"
#include "random_field_cells.h"
#include "random_problems.h"
#include "random_round.h"

namespace birefit::testing {

struct Family {
  std::string name;
  void (*make)(RandomProblem&);
  int quick = 4;    ///< problems of the ordinary suite, seconds all together; 0 where one takes that long
  int many = 1000;  ///< of the long one: fewer where one takes ten seconds and more
};

inline std::ostream& operator<<(std::ostream& out, const Family& family) { return out << family.name; }

inline const std::vector<Family>& families() {
  static const std::vector<Family> all = {{"Droplet", radial_droplet},
                                          {"DropletInAField", droplet_in_a_field},
                                          {"Shell", shell, 0},
                                          {"Cell", cell},
                                          {"HeatedPlate", heated_plate},
                                          {"UniformCell", uniform_cell, 20},
                                          {"TwistedCell", twisted_cell, 20},
                                          {"FreederickszTable", freedericksz_table, 0, 300},
                                          {"FieldCell", field_cell, 2},
                                          {"HelixCell", helix_cell},
                                          {"BipolarDroplet", bipolar_droplet, 0, 300},
                                          {"DropletInAFieldAcross", droplet_in_a_field_across, 0, 300},
                                          {"EccentricShell", eccentric_shell, 0, 300},
                                          {"Disc", stressed_disc}};
  return all;
}
inline const Family& family(const std::string& name) {
  for (const Family& each : families())
    if (each.name == name) return each;
  throw std::runtime_error("no family " + name);
}

/// A problem of a family; the same for the same number.
inline RandomProblem draw(const Family& family, int number) {
  RandomProblem p;
  p.random.seed(static_cast<unsigned long>(number) * 104729);
  family.make(p);
  return p;
}

}  // namespace birefit::testing
