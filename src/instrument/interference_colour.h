#pragma once
// Retardance from an interference colour: which path differences of a retarder between polarizers would show a colour
// that was recorded. docs/methods.md, "Spectrum".

#include <vector>

#include "birefit/microscope.h"
#include "instrument/coherence.h"
#include "instrument/colour.h"
#include "scene/values.h"

namespace birefit {

/// What passes of a retarder of the phase d at one wavelength, a + b cos d + c sin d.
struct FringeOfLine {
  double a = 0.5, b = -0.5, c = 0;  ///< by default: crossed polarizers, the retarder's axis at 45 degrees
};
/// Of a retarder whose slow axis is 45 degrees from the polarizer (from +x where there is none), between all that a
/// microscope has, at the wavelength that the values have.
FringeOfLine diagonal_fringe(const Microscope&, const Values<double>&);

/// What channels record of a retarder, by its path difference G (um) at the wavelength where the dispersion is 1.
class ColourCurve {
 public:
  /// `fringe`: at each wavelength of the sum; t = dispersion/wavelength there (1/um); for |G| up to reach_um.
  ColourCurve(const SpectralSum&, const std::vector<FringeOfLine>& fringe, const std::vector<double>& t,
              double reach_um);

  std::size_t channels() const { return open_.size(); }
  double reach_um() const { return chi_.reach_um(); }
  /// As a fraction of what the channel records without sample and polarizers.
  template <class S>
  S at(std::size_t channel, const S& g) const {
    return S(open_[channel]) - chi_.at(channel, g).loss + chi_.at(channels() + channel, g).im;
  }

 private:
  std::vector<double> open_;  // at G = 0
  Coherence chi_;             // rows: weights times b, weights times c
};

/// A path difference at which the recorded values are likelier than nearby.
struct RetardanceOfColour {
  double g_um = 0;        ///< at the wavelength where the dispersion is 1
  double error_um = 0;    ///< standard error by the curvature there; infinite where colours do not change
  double chi_square = 0;  ///< of the channels there
  double odds = 0;        ///< exp of half the chi-square that it has more than the best; 1 of the best
};

/// All such places in [0, reach_um()], the best first, whose odds are at least `least_odds`. `recorded`: a value a
/// channel, fractions of white; `noise`: their standard deviations, above 0, independent. One candidate says the
/// retardance, several that a colour alone does not.
std::vector<RetardanceOfColour> retardances_of(const ColourCurve& curve, const std::vector<double>& recorded,
                                               const std::vector<double>& noise, double least_odds = 1e-3);

/// The colour of such a retarder: three channels that are the CIE's observer, `white` what they record without it.
Xyz interference_colour(const ColourCurve& curve, double g_um, const Xyz& white);

}  // namespace birefit
