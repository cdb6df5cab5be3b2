#pragma once
// `mosaic:` and `bayer:` of a micrograph: which pixels of each cell of 2 x 2 belong together.

#include <optional>
#include <string>
#include <vector>

#include "io/config/reader.h"

namespace birefit {

/// Every second pixel from (x0, y0) on: a picture of its own.
struct MosaicPart {
  int x0 = 0, y0 = 0;
  std::string name;                    ///< "90 deg", "g1": behind the picture's name
  std::optional<double> analyzer_deg;  ///< of a polarization mosaic
};

struct MosaicSettings {
  std::vector<MosaicPart> parts;  ///< empty: one picture of all pixels
  bool not_looked_for = false;    ///< `mosaic: none`
  std::string bayer;              ///< "rggb", ..
  Where where;
};

/// `channel`: that of the micrograph, which chooses the colour. What contradicts goes to the reader's problems.
MosaicSettings read_mosaic(ConfigReader& reader, const Block& micrograph, const std::string& channel);

/// The pixels of one colour ('r', 'g', 'b') in a mosaic whose first cell is `bayer`.
std::vector<MosaicPart> bayer_parts(const std::string& bayer, char colour);

/// Does the config state a polarization mosaic? Each of its pictures then has an analyser of its own.
bool states_polarization_mosaic(const YamlNode& root);

/// The pixels of a part in a picture of this size.
Mask part_of(const MosaicPart& part, int width, int height);

}  // namespace birefit
