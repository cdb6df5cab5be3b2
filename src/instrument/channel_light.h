#pragma once
// The wavelengths by which a picture in other light than a single line is summed: each is a picture of its own, and all
// that lamp, filters and camera do is to weigh them. docs/methods.md, "Spectrum".

#include <array>
#include <memory>
#include <vector>

#include "birefit/microscope.h"
#include "birefit/parameters.h"
#include "core/scalar.h"
#include "instrument/channels.h"

namespace birefit {

/// Picture = sum over k of weight[k] picture(wavelength_nm[k]), at the values that the light's numbers have.
struct WavelengthRule {
  std::vector<double> wavelength_nm, weight;
  /// d weight / d theta[index], by each number of the light; both as long as the numbers are.
  std::vector<int> index;
  std::vector<std::vector<double>> slope;
  std::vector<double> made_for;  ///< theta[index]
  /// How it is made: by the Gauss rule of a sum that is fine enough for path differences of reach_um (Channels::fine),
  /// or, 0, in equal steps (Channels::uniform).
  double reach_um = 0;

  std::size_t size() const { return wavelength_nm.size(); }
};

/// The weight of a wavelength with its derivatives: `active` as Values have them.
template <class S>
S weight_in(const WavelengthRule& rule, std::size_t k, const std::vector<int>& active) {
  S weight(rule.weight[k]);
  if constexpr (ScalarTraits<S>::derivatives > 0)
    for (std::size_t n = 0; n < rule.index.size(); ++n)
      for (std::size_t j = 0; j < active.size(); ++j)
        if (active[j] == rule.index[n]) weight.d[j] = weight.d[j] + PlainOf<S>(rule.slope[n][k]);
  return weight;
}

/// The one channel that the microscope's light makes (of its channel_light, else of its line with a bandwidth above
/// 0) as a sum that is fine enough for path differences of reach_um, other channels' light in it included. UserError as
/// Channels has it.
SpectralSum channel_of(const Microscope&, const Theta&, double reach_um = 20, const Where& = {});
/// The microscope's channel_light by other sensitivities than its own.
Channels channels_of(const ChannelLight&, const Theta&, std::vector<Spectrum> sensitivities, const Where& = {});
/// n wavelengths, at most a quarter of the finer sum's.
std::shared_ptr<const WavelengthRule> wavelength_rule(const Microscope&, const Theta&, double reach_um, int n);
/// The rule with as many wavelengths at these values: the same where no number of the light is another.
std::shared_ptr<const WavelengthRule> rule_at(const std::shared_ptr<const WavelengthRule>&, const Microscope&,
                                              const Theta&);
/// Wavelengths between which all but a thousandth at either end is recorded, of the only channel; um.
std::array<double, 2> band_um(const SpectralSum&);
/// The mean of the wavelengths that the only channel records, um.
double mean_um(const SpectralSum&);
/// Theta at another wavelength, um.
Theta at_wavelength(const Microscope&, Theta, double um);

}  // namespace birefit
