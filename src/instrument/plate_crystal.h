#pragma once
// Indices of the crystals that plates are cut from: G. Ghosh, Opt. Commun. 163, 95 (1999), quartz and calcite; M. J.
// Dodge, Appl. Opt. 23, 1980 (1984), magnesium fluoride. Room temperature, 0.2 to 2 um.

#include <array>
#include <stdexcept>

#include "birefit/microscope.h"
#include "core/scalar.h"

namespace birefit {

/// n^2 = constant + sum of strength l^2 / (l^2 - pole), l in um.
struct SellmeierTerms {
  double constant;
  std::array<double, 3> strength, pole;
  template <class S>
  S index(const S& um) const {
    const S l2 = um * um;
    S n2(constant);
    for (std::size_t i = 0; i < 3; ++i)
      if (strength[i] != 0) n2 = n2 + strength[i] * l2 / (l2 - pole[i]);
    return sqrt(n2);
  }
};
struct CrystalTerms {
  SellmeierTerms ordinary, extraordinary;
};
/// Of a crystal that is one.
inline const CrystalTerms& terms_of(PlateCrystal crystal) {
  static constexpr CrystalTerms kQuartz{{1.28604141, {1.07044083, 1.10202242, 0}, {1.00585997e-2, 100, 0}},
                                        {1.28851804, {1.09509924, 1.15662475, 0}, {1.02101864e-2, 100, 0}}};
  static constexpr CrystalTerms kFluoride{{1,
                                           {0.48755108, 0.39875031, 2.3120353},
                                           {0.04338408 * 0.04338408, 0.09461442 * 0.09461442, 23.793604 * 23.793604}},
                                          {1,
                                           {0.41344023, 0.50497499, 2.4904862},
                                           {0.03684262 * 0.03684262, 0.09076162 * 0.09076162, 23.771995 * 23.771995}}};
  static constexpr CrystalTerms kCalcite{{1.73358749, {0.96464345, 1.82831454, 0}, {1.94325203e-2, 120, 0}},
                                         {1.35859695, {0.82427830, 0.14429128, 0}, {1.06689543e-2, 120, 0}}};
  switch (crystal) {
    case PlateCrystal::quartz:
      return kQuartz;
    case PlateCrystal::magnesium_fluoride:
      return kFluoride;
    case PlateCrystal::calcite:
      return kCalcite;
    case PlateCrystal::none:
      break;
  }
  throw std::logic_error("a plate of no crystal");
}

/// Birefringence over its value at another wavelength (um).
template <class S>
S relative_birefringence(PlateCrystal crystal, const S& um, double at_um) {
  const CrystalTerms& t = terms_of(crystal);
  return (t.extraordinary.index(um) - t.ordinary.index(um)) *
         (1 / (t.extraordinary.index(at_um) - t.ordinary.index(at_um)));
}

/// By how much further the wave that is polarized in the plane of incidence goes than the one across, per thickness of
/// a plate whose axis is its normal: sqrt(n_o^2 - s^2) of the ordinary, (n_o / n_e) sqrt(n_e^2 - s^2) of the other
/// along the normal, s the sine of the tilt in air.
template <class S>
S tilted_retardance(PlateCrystal crystal, const S& um, const S& sine) {
  const CrystalTerms& t = terms_of(crystal);
  const S no = t.ordinary.index(um), ne = t.extraordinary.index(um), s2 = sine * sine;
  return no * (sqrt(S(1.0 - s2 / (ne * ne))) - sqrt(S(1.0 - s2 / (no * no))));
}

}  // namespace birefit
