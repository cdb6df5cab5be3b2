#pragma once
// Spectra over the vacuum wavelength: lamps, filters and sensitivities, as closed forms and as tables. Their scale has
// no meaning; what a channel makes of them is in instrument/channels.h.

#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "birefit/error.h"
#include "birefit/light.h"

namespace birefit {

/// The same power in every interval of wavelength: the CIE's illuminant E, and a filter that lets all through.
struct EqualEnergy {};

/// A black body's power by wavelength, 1 at 560 nm. Illuminant A is one (illuminant_a).
struct Planck {
  double temperature_k = 0;  ///< 500 to 30,000
};

/// A Gaussian in wavelength, 1 at its centre, as makers of lines and of filters state it; 0 where it is below 2.3e-16.
struct GaussianLine {
  double centre_um = 0;  ///< 0.1 to 20
  double fwhm_um = 0;    ///< full width at half maximum, in (0, centre_um]
};

/// A filter that is 1 within a band and falls to 0 along straight edges. Edges are never sharp: what passes then has a
/// derivative by the band's place.
struct FlatBand {
  double centre_um = 0;  ///< 0.1 to 20
  double width_um = 0;   ///< between the two places where half passes, in (0, centre_um]
  double edge_um = 0;    ///< from 1 to 0, in (0, width_um]
};

using Spectrum = std::variant<EqualEnergy, Planck, GaussianLine, FlatBand, SpectralTable>;

/// A user's table, checked: at least two entries, wavelengths in um (0.1 to 20) that grow, values that are finite, not
/// negative and not all 0. `name` says what it is ("the lamp's table"). UserError of all that is wrong, by entry
/// from 1.
SpectralTable spectral_table(std::vector<double> wavelength_um, std::vector<double> value, const Where& where = {},
                             const std::string& name = "the table");
/// The numbers of a closed form are in their ranges; a table is one that spectral_table takes. UserError.
void check_spectrum(const Spectrum&, const Where& where = {}, const std::string& name = "the spectrum");

/// CIE standard illuminant A, ISO/CIE 11664-2: a black body of 2848 K with the second radiation constant of its time,
/// 1.435e-2 m K, which is one of 2855.5 K with today's.
Planck illuminant_a();
/// CIE standard illuminant D65, ISO/CIE 11664-2: its table of 5 nm, 300 to 830 nm.
const SpectralTable& illuminant_d65();
/// The CIE's 2 degree observer of 1931, ISO/CIE 11664-1: its table of 1 nm, 360 to 830 nm, for x (0), y (1) and z (2).
const SpectralTable& colour_matching(int channel);

/// What a spectrum says at a wavelength in um, its own scale.
double value_at(const Spectrum&, double wavelength_um);
/// The numbers of a closed form that a fit may ask for, by the keys of its struct, in their order: of tables none.
std::vector<std::string> numbers_of(const Spectrum&);
/// Derivatives of value_at by them, into as many places.
void slopes_at(const Spectrum&, double wavelength_um, double* slope);

/// Where a spectrum is known or above 0, um. Outside of a table nothing is known; whether it is 0 there is up to what
/// it describes (instrument/channels.h).
std::pair<double, double> range_of(const Spectrum&);
/// Where it is not smooth, um, growing: entries of a table, corners of a band. Within its range.
std::vector<double> kinks_of(const Spectrum&);
/// The length below which it is a parabola for all that matters, um; infinite for tables and bands, which are straight
/// between kinks.
double smooth_length(const Spectrum&);

}  // namespace birefit
