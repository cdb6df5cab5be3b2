#include "instrument/channel_light.h"

#include <algorithm>
#include <utility>

namespace birefit {
namespace {

/// A number of the light and how much of the channel's own unit one of its own is.
struct LightNumber {
  ParameterRef ref;
  double unit;
};
constexpr double kUmPerNm = 1e-3;

/// In the order of Channels::numbers().
std::vector<LightNumber> numbers_of(const Microscope& microscope) {
  if (!microscope.channel_light) return {{microscope.wavelength_nm, kUmPerNm}, {microscope.bandwidth_nm, kUmPerNm}};
  std::vector<LightNumber> numbers;
  const ChannelLight& light = *microscope.channel_light;
  if (light.lamp.planck_k) numbers.push_back({light.lamp.planck_k, 1});
  for (const LightFilter& filter : light.filters) {
    if (filter.table) continue;
    numbers.push_back({filter.centre_nm, kUmPerNm});
    numbers.push_back({filter.fwhm_nm, kUmPerNm});
  }
  for (const Crosstalk& other : microscope.crosstalk) numbers.push_back({other.share, 1});
  return numbers;
}

/// The microscope's channel, and behind it those whose light is in it.
Channels unmixed(const Microscope& microscope, const Theta& theta, const Where& where = {}) {
  if (!microscope.channel_light)
    return Channels(
        GaussianLine{kUmPerNm * microscope.wavelength_nm.in(theta), kUmPerNm * microscope.bandwidth_nm.in(theta)}, {},
        {EqualEnergy{}}, where);
  const ChannelLight& light = *microscope.channel_light;
  std::vector<Spectrum> sensitivities{light.sensitivity ? Spectrum(*light.sensitivity) : Spectrum(EqualEnergy{})};
  for (const Crosstalk& other : microscope.crosstalk) sensitivities.emplace_back(*other.sensitivity);
  return channels_of(light, theta, std::move(sensitivities), where);
}

/// The sum's first channel with so much of the others in it; slopes by the shares behind those by the light's numbers.
SpectralSum mixed(SpectralSum sum, const Microscope& microscope, const Theta& theta) {
  if (microscope.crosstalk.empty()) return sum;
  double whole = 1;
  std::vector<double> share;
  for (const Crosstalk& other : microscope.crosstalk) share.push_back(other.share.in(theta)), whole += share.back();
  const auto mix = [&](std::vector<std::vector<double>>& of) {
    for (std::size_t k = 0; k < sum.size(); ++k) {
      for (std::size_t d = 0; d < share.size(); ++d) of[0][k] += share[d] * of[d + 1][k];
      of[0][k] /= whole;
    }
  };
  std::vector<std::vector<double>> others(sum.weight.begin() + 1, sum.weight.end());
  mix(sum.weight);
  for (auto& number : sum.slope) mix(number), number.resize(1);
  sum.weight.resize(1);
  for (std::vector<double>& other : others) {
    for (std::size_t k = 0; k < sum.size(); ++k) other[k] = (other[k] - sum.weight[0][k]) / whole;
    sum.slope.push_back({std::move(other)});
  }
  return sum;
}

/// A sum's place at which this share of the only channel is passed.
std::size_t place_of_share(const SpectralSum& sum, double share) {
  const std::vector<double>& weight = sum.weight.front();
  double passed = 0;
  std::size_t k = 0;
  while (k + 1 < weight.size() && passed + weight[k] < share) passed += weight[k++];
  return k;
}

}  // namespace

Channels channels_of(const ChannelLight& light, const Theta& theta, std::vector<Spectrum> sensitivities,
                     const Where& where) {
  Spectrum lamp = EqualEnergy{};
  if (light.lamp.table)
    lamp = *light.lamp.table;
  else if (light.lamp.planck_k)
    lamp = Planck{light.lamp.planck_k.in(theta)};
  std::vector<Spectrum> filters;
  for (const LightFilter& filter : light.filters) {
    if (filter.table)
      filters.emplace_back(*filter.table);
    else
      filters.emplace_back(GaussianLine{kUmPerNm * filter.centre_nm.in(theta), kUmPerNm * filter.fwhm_nm.in(theta)});
  }
  return Channels(std::move(lamp), std::move(filters), std::move(sensitivities), where);
}

SpectralSum channel_of(const Microscope& microscope, const Theta& theta, double reach_um, const Where& where) {
  return mixed(unmixed(microscope, theta, where).fine(reach_um), microscope, theta);
}

std::shared_ptr<const WavelengthRule> wavelength_rule(const Microscope& microscope, const Theta& theta, double reach_um,
                                                      int n) {
  // Nodes are those of all the channels in it, mixed or not: what of another is in one may be fitted.
  const Channels channel = unmixed(microscope, theta);
  SpectralSum sum;
  if (reach_um > 0) {
    const SpectralSum fine = channel.fine(reach_um);
    sum = gauss_sum(fine, std::min(n, static_cast<int>(fine.size()) / 4));
  } else {
    sum = channel.uniform(n);
  }
  sum = mixed(std::move(sum), microscope, theta);
  auto rule = std::make_shared<WavelengthRule>();
  rule->reach_um = reach_um;
  for (const double um : sum.wavelength_um) rule->wavelength_nm.push_back(um / kUmPerNm);
  rule->weight = sum.weight.front();
  const std::vector<LightNumber> numbers = numbers_of(microscope);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto& [ref, unit] = numbers[i];
    rule->index.push_back(ref.index);
    rule->made_for.push_back(theta.at(static_cast<std::size_t>(ref.index)));
    rule->slope.push_back(sum.slope.at(i).front());
    for (double& slope : rule->slope.back()) slope *= unit * ref.times;
  }
  return rule;
}

std::shared_ptr<const WavelengthRule> rule_at(const std::shared_ptr<const WavelengthRule>& rule,
                                              const Microscope& microscope, const Theta& theta) {
  bool same = true;
  for (std::size_t i = 0; i < rule->index.size(); ++i)
    same = same && theta.at(static_cast<std::size_t>(rule->index[i])) == rule->made_for[i];
  if (same) return rule;
  return wavelength_rule(microscope, theta, rule->reach_um, static_cast<int>(rule->size()));
}

std::array<double, 2> band_um(const SpectralSum& sum) {
  constexpr double kEnds = 0.001;
  return {sum.wavelength_um[place_of_share(sum, kEnds)], sum.wavelength_um[place_of_share(sum, 1 - kEnds)]};
}

double mean_um(const SpectralSum& sum) {
  return sum.of([](double um) { return um; }).front();
}

Theta at_wavelength(const Microscope& microscope, Theta theta, double um) {
  const ParameterRef ref = microscope.wavelength_nm;
  theta.at(static_cast<std::size_t>(ref.index)) = ref.stated(um / kUmPerNm);
  return theta;
}

}  // namespace birefit
