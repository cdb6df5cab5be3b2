#pragma once
// Lamps, observers and dispersions that tests of white light share, written from their sources.

#include <cmath>
#include <string>
#include <vector>

#include "instrument/channels.h"
#include "reference_table.h"

namespace birefit::testing {

/// "E", "A" or "D65".
inline Spectrum lamp_of(const std::string& name) {
  if (name == "E") return EqualEnergy{};
  if (name == "A") return illuminant_a();
  return illuminant_d65();
}
inline std::vector<Spectrum> observer() { return {colour_matching(0), colour_matching(1), colour_matching(2)}; }
/// A camera's three sensitivities (tests/data/instrument/camera).
inline std::vector<Spectrum> camera() {
  const ReferenceTable table(data_path("instrument/camera/nikon_d5100.csv"));
  std::vector<double> um = table.numbers("wavelength_nm");
  for (double& l : um) l *= 1e-3;
  std::vector<Spectrum> channels;
  for (const char* channel : {"r", "g", "b"}) channels.push_back(spectral_table(um, table.numbers(channel)));
  return channels;
}

/// n_e - n_o of quartz: Ghosh, Opt. Commun. 163, 95 (1999).
template <class S>
S quartz(const S& um) {
  const S q = um * um;
  const S o = 1.28604141 + 1.07044083 * q / (q - 1.00585997e-2) + 1.10202242 * q / (q - 100.0);
  const S e = 1.28851804 + 1.09509924 * q / (q - 1.02101864e-2) + 1.15662475 * q / (q - 100.0);
  return sqrt(e) - sqrt(o);
}
/// Of 5CB at 25.1 C: Wu et al., Opt. Eng. 32, 1775 (1993), as refractiveindex.info writes it.
template <class S>
S nematic_5cb(const S& um) {
  const S v = 1.0 / (um * um);
  return (0.4552 - 0.4136) + (2.3250 - 1.3515) / (22.6757 - v) + (1.3970 - 0.4699) / (12.5748 - v);
}
/// Of E7 at 25 C: Li et al., J. Disp. Technol. 1, 51 (2005).
inline double nematic_e7(double um) {
  const double v = 1 / (um * um);
  return 0.1943 + 0.0006 * v + 0.0025 * v * v;
}
/// Dispersions as the tables name them, 1 at 589.3 nm.
template <class S>
S dispersion(const std::string& name, const S& um) {
  if (name == "quartz") return quartz(um) / quartz(0.5893);
  if (name == "5cb_wu1993") return nematic_5cb(um) / nematic_5cb(0.5893);
  return S(1.0);
}
/// t = D(l)/l at the wavelengths of a sum.
inline std::vector<double> turns(const SpectralSum& sum, const std::string& name) {
  std::vector<double> t;
  for (const double l : sum.wavelength_um) t.push_back(dispersion(name, l) / l);
  return t;
}

}  // namespace birefit::testing
