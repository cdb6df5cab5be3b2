#pragma once
// What a file's OME metadata states of the optics that it was taken through.

#include <string>

namespace birefit {

struct StatedOptics {
  double objective_na = 0, emission_nm = 0;  ///< 0: not stated, or differently of several objectives or channels
};
StatedOptics stated_optics(const std::string& description);

}  // namespace birefit
