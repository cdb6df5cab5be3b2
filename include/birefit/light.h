#pragma once
// Light that is no single line, as one channel of a camera records it: a lamp, filters, and the channel's sensitivity.

#include <memory>
#include <vector>

#include "birefit/number_spec.h"
#include "birefit/parameters.h"

namespace birefit {

/// A spectrum over the vacuum wavelength: linear between its entries, 0 outside of them. Its scale has no meaning.
struct SpectralTable {
  std::vector<double> wavelength_um;  ///< growing, at least two
  std::vector<double> value;          ///< as many, none below 0, one above
};

/// What lights the sample: a black body, a table, or, with neither, the same power at all wavelengths.
struct Lamp {
  ParameterRef planck_k;  ///< the black body's temperature
  std::shared_ptr<const SpectralTable> table;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("planck_k", self.planck_k, numbers::within(500, 30000, "K").left_out().known_within_share(0.03),
                 "temperature of a lamp that is a black body");
  }
};

/// What stands in the light, before the sample or behind it: a line that is Gaussian in wavelength, or a table.
struct LightFilter {
  ParameterRef centre_nm, fwhm_nm;  ///< both, or neither
  std::shared_ptr<const SpectralTable> table;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("centre_nm", self.centre_nm, numbers::within(100, 20000, "nm").left_out().known_within_share(0.003),
                 "of the wavelengths that a filter passes");
    visit.number("fwhm_nm", self.fwhm_nm, numbers::within(0.1, 2000, "nm").left_out().known_within_share(0.1),
                 "full width at half maximum of what a filter passes");
  }
};

/// What of another channel's light is in a channel: what that one records of the same light, each as a fraction of what
/// it records without a sample. Channel c of a camera whose channels mix, up to a gain and an offset, is
/// (X_c + sum of share_d X_d) / (1 + sum of share_d); all three with gains and offsets free are a matrix of 3 x 4.
struct Crosstalk {
  std::shared_ptr<const SpectralTable> sensitivity;
  ParameterRef share;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("share", self.share, numbers::within(-0.45, 10).known_within(0.02),
                 "of another channel's light in this one, in units of its own");
  }
};

/// The light of a picture, where it is no line: what counts is the product of all that is given.
struct ChannelLight {
  Lamp lamp;
  std::vector<LightFilter> filters;
  std::shared_ptr<const SpectralTable> sensitivity;  ///< the camera's; null: the same at all wavelengths

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.inside("lamp", self.lamp);
    visit.inside("filters", self.filters);
  }
};

}  // namespace birefit
