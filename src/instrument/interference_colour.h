#pragma once
// Retardance from an interference colour: which path differences of a retarder between crossed polarizers, its axis at
// 45 degrees, would show a colour that was recorded. docs/methods.md, "Spectrum".

#include <vector>

#include "instrument/coherence.h"
#include "instrument/colour.h"

namespace birefit {

/// A path difference at which the recorded values are likelier than nearby.
struct RetardanceOfColour {
  double g_um = 0;        ///< at the wavelength where the dispersion is 1
  double error_um = 0;    ///< standard error by the curvature there; infinite at 0, where colours do not change
  double chi_square = 0;  ///< of the channels there
  double odds = 0;        ///< exp of half the chi-square that it has more than the best; 1 of the best
};

/// All such places in [0, chi.reach_um()], the best first, whose odds are at least `least_odds`. `recorded`: a value a
/// channel, fractions of white; `noise`: their standard deviations, above 0, independent. One candidate says the
/// retardance, several that a colour alone does not.
std::vector<RetardanceOfColour> retardances_of(const Coherence& chi, const std::vector<double>& recorded,
                                               const std::vector<double>& noise, double least_odds = 1e-3);

/// The colour of such a retarder: three channels that are the CIE's observer, `white` what they record without it.
Xyz interference_colour(const Coherence& chi, double g_um, const Xyz& white);

}  // namespace birefit
