#include "samples/disc/disc.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include "instrument/channel_light.h"
#include "instrument/coherence.h"
#include "instrument/exposure.h"

namespace birefit {

template <class S>
DiscOptics<S>::DiscOptics(const Scene& scene, const Values<S>& value) {
  const StressedDisc& disc = std::get<StressedDisc>(scene.sample);
  const S radius_um = 0.5 * value(disc.diameter_um);
  const S k0 = wavenumber_per_um(scene, value), optic = value(disc.stress_optic_brewster);
  center_x_px = value(scene.view.center_x_px);
  center_y_px = value(scene.view.center_y_px);
  px_per_radius_inverse = value(scene.view.pixel_size_um) / radius_um;
  sin_cos(value.radians(disc.load_azimuth_deg, 90) + value.radians(scene.view.rotation_deg), load_sin, load_cos);
  // 1 brewster = 1e-12/Pa, 1 N/um^2 = 1e12 Pa: the powers of ten cancel, and so does the thickness.
  load_phase = k0 * optic * value(disc.load_n) / radius_um;
  residual_phase = k0 * optic * value(disc.thickness_um) * 1e-6;
  for (ParameterRef ref : disc.residual_normal_mpa) residual_normal.push_back(value(ref));
  for (ParameterRef ref : disc.residual_shear_mpa) residual_shear.push_back(value(ref));
  if (!disc.illumination.empty()) illumination.push_back(S(1.0));
  for (ParameterRef ref : disc.illumination) illumination.push_back(value(ref));
}

DiscMargins disc_margins(const StressedDisc& disc, double radius_um) {
  return {disc.contact_radius_um > 0 ? disc.contact_radius_um / radius_um : 0.1,
          disc.rim_um > 0 ? disc.rim_um / radius_um : 0.02};
}

DiscZone::DiscZone(const Scene& scene, const Theta& theta) {
  const StressedDisc& disc = std::get<StressedDisc>(scene.sample);
  const auto value = [&](ParameterRef ref, double otherwise = 0) { return ref ? ref.in(theta) : otherwise; };
  lengths_ = {disc.diameter_um, scene.view.pixel_size_um, scene.view.center_x_px, scene.view.center_y_px};
  azimuths_ = {disc.load_azimuth_deg, scene.view.rotation_deg};
  const double radius_um = 0.5 * value(disc.diameter_um);
  margins_ = disc_margins(disc, radius_um);
  radius_px_ = radius_um / value(scene.view.pixel_size_um);
  center_x_px_ = value(scene.view.center_x_px), center_y_px_ = value(scene.view.center_y_px);
  const double load = (value(disc.load_azimuth_deg, 90) + value(scene.view.rotation_deg)) * std::numbers::pi / 180;
  load_cos_ = std::cos(load), load_sin_ = std::sin(load);
}

bool DiscZone::fitted(double column, double row) const {
  const double x = (column - center_x_px_) / radius_px_, y = (center_y_px_ - row) / radius_px_;
  const double to_force = std::min(std::hypot(x - load_cos_, y - load_sin_), std::hypot(x + load_cos_, y + load_sin_));
  // Whole pixels: what of one lies outside changes by jumps with the centre and the diameter.
  const double half_pixel = std::numbers::sqrt2 / 2 / radius_px_;
  return std::hypot(x, y) + half_pixel <= 1 - margins_.rim && to_force - half_pixel >= margins_.contact;
}

std::vector<Zone::Mover> DiscZone::movers() const {
  std::vector<Mover> movers;
  for (const ParameterRef length : lengths_)
    if (length) movers.push_back({length});
  for (const ParameterRef azimuth : azimuths_)
    if (azimuth) movers.push_back({azimuth, 0.5 * margins_.contact * 180 / std::numbers::pi, 180});
  return movers;
}

namespace {

/// (1 - e^-u)/u for u >= 0, with contrast = e^-u; by its Taylor series where the quotient cancels (next term 3e-14).
template <class S>
S lost_share(const S& u, const S& contrast) {
  const S series =
      1.0 -
      u * (1.0 / 2 -
           u * (1.0 / 6 - u * (1.0 / 24 - u * (1.0 / 120 - u * (1.0 / 720 - u * (1.0 / 5040 - u * (1.0 / 40320)))))));
  const auto small = plain(u) < PlainOf<S>(0.1);
  const S safe = select(small, S(1.0), u);
  return select(small, series, S((1.0 - contrast) * (1.0 / safe)));
}

template <class S>
class DiscImage final : public SampleImage<S> {
 public:
  DiscImage(const Scene& scene, const Values<S>& value, const BeamMaker& maker)
      : optics_(scene, value),
        coloured_(scene.microscope.bandwidth_nm),
        spread_(value.get(scene.microscope.bandwidth_nm, 0.0) /
                (2.3548200450309493 * value(scene.microscope.wavelength_nm))) {
    const StressedDisc& disc = std::get<StressedDisc>(scene.sample);
    const S load =
        value.radians(disc.load_azimuth_deg, 90) + value.radians(scene.view.rotation_deg) - 0.5 * std::numbers::pi;
    const Line<S> light = maker.in(value).line;
    S sin_twice, cos_twice;
    sin_cos(2.0 * load, sin_twice, cos_twice);
    form_ = light.form().in_frame(cos_twice, sin_twice);
    linear_ = light.linear();
    if (const WavelengthRule* rule = maker.rule()) {
      std::vector<double> per_um;
      for (const double nm : rule->wavelength_nm) per_um.push_back(1000 / nm);
      std::vector<std::vector<double>> rows{rule->weight};
      rows.insert(rows.end(), rule->slope.begin(), rule->slope.end());
      coherence_.emplace(std::move(rows), std::move(per_um), kReachUm);
      um_per_rad_ = value(scene.microscope.wavelength_nm) * (1e-3 / (2 * std::numbers::pi));
      for (std::size_t n = 0; n < rule->index.size(); ++n)
        for (std::size_t j = 0; j < value.active().size(); ++j)
          if (value.active()[j] == rule->index[n]) moved_.push_back({n + 1, j});
    }
  }
  void light(const PlainOf<S>& column, const PlainOf<S>& row, S* out) const override {
    S x, y;
    optics_.place(S(column), S(row), x, y);
    StressPair<S> pair = optics_.phases(x, y);
    const auto outside = plain(S(x * x + y * y)) > PlainOf<S>(1.0);
    pair.normal = select(outside, S(0.0), pair.normal);
    pair.shear = select(outside, S(0.0), pair.shear);
    // The retarder is cos(d/2) + i sin(d/2)/d [[normal, shear], [shear, -normal]], d^2 = normal^2 + shear^2. Over a
    // line of Gaussian shape, d goes as 1/wavelength, cos d and sin d lose contrast: means of cos^2, of sin^2/d^2, of
    // cos sin/d.
    const S d_sq = pair.normal * pair.normal + pair.shear * pair.shear;
    const CosSinc<S> f = cos_sinc_sq(S(0.25 * d_sq));
    const S half = 0.5 * f.sinc_sq;
    S cos_cos = f.cos_sq * f.cos_sq, sinc_sinc = half * half, cos_sinc = f.cos_sq * half;
    if (coherence_) {
      // cos d and sin d are the degree of coherence; away from 0, where they are divided by d.
      const S d = root(S(d_sq + 1e-12)), over = inverse(d);
      const MeanPhase<S> mean = mean_phase(min_of(S(d * um_per_rad_), S(kReachUm)));
      sinc_sinc = 0.5 * mean.loss * over * over;
      cos_sinc = 0.5 * mean.im * over;
      cos_cos = 1.0 - 0.5 * mean.loss;
    } else if (coloured_) {
      const S u = (0.5 * spread_ * spread_) * d_sq, contrast = exp(S(-u));
      sinc_sinc = contrast * sinc_sinc + (0.25 * spread_ * spread_) * lost_share(u, contrast);
      cos_sinc = contrast * cos_sinc;
      cos_cos = 1.0 - d_sq * sinc_sinc;
    }
    S& light = out[0];
    light = form_.ww * cos_cos + (pair.normal * (form_.zz * pair.normal + 2.0 * (form_.xz * pair.shear)) +
                                  form_.xx * (pair.shear * pair.shear)) *
                                     sinc_sinc;
    if (!linear_) light = light + 2.0 * (form_.wz * pair.normal + form_.wx * pair.shear) * cos_sinc;
    if (optics_.illumination.empty()) return;
    const S east = (column - optics_.center_x_px) * optics_.px_per_radius_inverse,
            north = (optics_.center_y_px - row) * optics_.px_per_radius_inverse;
    light = light * plane_polynomial<S>(optics_.illumination, east, north);
  }

 private:
  /// Of a path difference, with the derivatives by the light's numbers.
  MeanPhase<S> mean_phase(const S& um) const {
    MeanPhase<S> mean = coherence_->at(0, um);
    if constexpr (ScalarTraits<S>::derivatives > 0)
      for (const auto& [row, j] : moved_) {
        const MeanPhase<PlainOf<S>> slope = coherence_->at(row, plain(um));
        mean.loss.d[j] = mean.loss.d[j] + slope.loss, mean.im.d[j] = mean.im.d[j] + slope.im;
      }
    return mean;
  }
  /// Longer ways, next to the forces, are taken as this long: no colour has fringes there.
  static constexpr double kReachUm = 40;

  DiscOptics<S> optics_;
  bool coloured_, linear_;
  S spread_;              ///< standard deviation of the wavelength over the wavelength
  RetarderForm<S> form_;  ///< in the load's frame
  /// Of light of many wavelengths: rows of its weights and of their derivatives by its numbers.
  std::optional<Coherence> coherence_;
  S um_per_rad_;
  struct Moved {
    std::size_t row, derivative;
  };
  std::vector<Moved> moved_;
};

}  // namespace

bool disc_sums_wavelengths(const Scene& scene, const RenderPlan&, const Theta&) {
  const Microscope& m = scene.microscope;
  return m.channel_light && m.before.empty() && m.behind.empty();
}

template <class S>
std::unique_ptr<SampleImage<S>> make_disc_image(const Scene& scene, const RenderPlan&, const Values<S>& value,
                                                const BeamMaker& light) {
  return std::make_unique<DiscImage<S>>(scene, value, light);
}
#define BIREFIT_INSTANTIATE(S)                                                                                   \
  template struct DiscOptics<S>;                                                                                 \
  template std::unique_ptr<SampleImage<S>> make_disc_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                              const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

}  // namespace birefit
