#include "samples/curved/eikonal_image.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "instrument/channel_light.h"
#include "instrument/exposure.h"
#include "samples/choices.h"

namespace birefit {

template <class S>
EikonalImage<S>::EikonalImage(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                              const BeamMaker& light)
    : optics_(droplet_optics(scene, value)),
      fan_p_(optics_, true, optics_.objective_na),
      fan_s_(optics_, false, optics_.objective_na),
      light_(light.in(value).line),
      view_(scene, value, light_),
      aplanatic_(scene.microscope.aplanatic),
      symmetry_(round_symmetry(scene, value, light_.line(), false)),
      panels_(choices(plan).part_panels),
      allowed_tail_(std::max(0.05 * plan.demand.intensity_accuracy, 3 * plan.numerical_error)) {
  passing_ = PassingLight<S>(value(scene.view.pixel_size_um), optics_.radius_um, light_.line().open());
  if (const WavelengthRule* rule = light.rule()) {
    const double nm = lane(plain(value(scene.microscope.wavelength_nm)), 0);
    for (std::size_t k = 0; k < rule->size(); ++k)
      colours_.push_back({nm / rule->wavelength_nm[k], weight_in<S>(*rule, k, value.active())});
  }
  std::vector<S> ends = fan_p_.ends_um();
  ends.insert(ends.end(), fan_s_.ends_um().begin(), fan_s_.ends_um().end());
  const auto place = [](const S& end) { return lane(plain(end), 0); };
  std::sort(ends.begin(), ends.end(), [&](const S& a, const S& b) { return place(a) < place(b); });
  const double apart = 1e-6 * place(optics_.radius_um);  // as one, if closer
  S from(0.0);
  for (const S& to : ends) {
    if (place(to) - place(from) < apart) continue;
    const S middle = 0.5 * (from + to), inverse_span = inverse(middle - from);
    for (const bool outwards : {true, false}) {
      Part part{outwards ? from : to, outwards ? inverse_span : -inverse_span, place(middle), 0, outwards, {}, {}, {}};
      part.by_end = Sensitivity<S>(part.end_um);
      part.by_inverse_span = Sensitivity<S>(part.inverse_span);
      parts_.push_back(std::move(part));
    }
    from = to;
  }
  for (std::size_t k = 1; k < parts_.size(); k += 2) {
    double blur = std::min(0.25 * view_.pixel_um(), 2 * std::abs(place(parts_[k].end_um) - parts_[k].middle_um));
    if (k + 1 < parts_.size())
      parts_[k + 1].blur_um = blur =
          std::min(blur, 2 * std::abs(place(parts_[k + 1].end_um) - parts_[k + 1].middle_um));
    parts_[k].blur_um = blur;
  }
  // Ends that the planner's scene did not have: any part may be the one with the most fringes.
  if (panels_.size() != parts_.size()) panels_.assign(parts_.size(), choices(plan).radial_panels);
}

template <class S>
std::vector<double> EikonalImage<S>::ends_um() const {
  std::vector<double> ends;
  for (const Part& part : parts_)
    if (!part.outwards) ends.push_back(lane(plain(part.end_um), 0));
  return ends;
}

template <class S>
void EikonalImage<S>::terms_at(const S& rho_um, S* out) const {
  const EikonalRay<S> p = fan_p_.at(rho_um), s = fan_s_.at(rho_um);
  // |E|^2 is flux over the cosine; not aplanatic, only the transverse part of the p field counts.
  const S p_field = aplanatic_ ? p.amplitude : p.amplitude * root(p.cos_turn),
          s_field = aplanatic_ ? s.amplitude : s.amplitude * inverse_root(s.cos_turn);
  // The matrix is (p exp(i phase), s) in the (radial, azimuthal) frame.
  S sine, cosine;
  const S phase = p.phase_rad - s.phase_rad;
  if (colours_.empty()) {
    sin_cos(phase, sine, cosine);
  } else {
    // What passes is linear in both; their means stand for a retarder whose contrast is less than 1.
    sine = cosine = S(0.0);
    for (const Colour& colour : colours_) {
      S one_sine, one_cosine;
      sin_cos(S(colour.phase * phase), one_sine, one_cosine);
      sine = sine + colour.weight * one_sine, cosine = cosine + colour.weight * one_cosine;
    }
  }
  if (!light_.line().linear())
    return light_.terms({{p_field * cosine, p_field * sine}, {}, {}, {s_field}}, S(1.0), true, out);
  const S sum = 0.25 * (p_field * p_field + s_field * s_field), mixed = 0.5 * p_field * s_field * cosine;
  out[0] = sum - mixed;
  const S between = light_.line().cos_between();
  out[1] = (0.5 * between) * (p_field * p_field - s_field * s_field);
  out[2] = (between * between) * (sum + mixed);
}

template <class S>
RadialTable<S> EikonalImage<S>::table(const Part& part, int panels, int threads) const {
  const S span = inverse(part.inverse_span);
  return RadialTable<S>(panels, terms(), threads,
                        [&](const P& v, S* out) { terms_at(part.end_um + span * (v * v), out); });
}

template <class S>
double EikonalImage<S>::table_error(std::size_t which, int panels) const {
  const Part& part = parts_[which];
  const RadialTable<S> light = table(part, panels, 1);
  const S span = inverse(part.inverse_span);
  constexpr int kPlaces = 64;
  double error = 0;
  for (int i = 0; i < kPlaces; ++i) {
    const double turn = std::fmod((i + 0.5) * 0.6180339887498949, 1.0);
    const P v(i % 2 ? turn : turn * turn);  // more beside the end
    std::array<S, RoundView<S>::kMostTerms> direct;
    terms_at(part.end_um + span * (v * v), direct.data());
    for (std::size_t f = 0; f < static_cast<std::size_t>(terms()); ++f) {
      std::array<P, RoundView<S>::kMostTerms> basis;
      basis.fill(P(0.0));
      basis[f] = P(1.0);
      error = std::max(error, std::abs(lane(plain(light.sum(terms(), v, basis.data())) - plain(direct[f]), 0)));
    }
  }
  return error;
}

template <class S>
void EikonalImage<S>::tabulate(typename SampleImage<S>::Wanted, int threads) {
  // The planner's parts had other fringes, in a fit: by values alone, so that derivatives change nothing.
  constexpr int kMost = 64;
  for (std::size_t k = 0; k < parts_.size(); ++k) do
      parts_[k].light = table(parts_[k], panels_[k], threads);
    while (parts_[k].light.tail() > allowed_tail_ && (panels_[k] *= 2) <= kMost);
}

template <class S>
void EikonalImage<S>::share_at(const Part& part, const P& rho_um, P& share, P& slope) const {
  const P nothing(0.0), all(1.0);
  if (part.outwards) {
    share = select(rho_um < P(part.middle_um), all, nothing);
    if (part.blur_um == 0) return slope = nothing, void();
  } else {
    share = select(rho_um < P(part.middle_um), nothing, all);
  }
  const double rate = (part.outwards ? 1 : -1) / part.blur_um;
  const P ramp = (rho_um - plain(part.end_um)) * P(rate) + P(0.5), limited = min_of(max_of(ramp, nothing), all);
  slope = select(ramp == limited, share * P(rate), nothing);
  share = share * limited;
}

template <class S>
void EikonalImage<S>::light(const P& column, const P& row, S* out) const {
  constexpr bool kSlopes = ScalarTraits<S>::derivatives > 0;
  const auto place = view_.at(column, row);
  S& result = out[0];
  result = S(P(0.0));
  const auto basis = RoundView<S>::basis(place);
  [[maybe_unused]] std::array<P, RoundView<S>::kMostTerms> turned;
  if constexpr (kSlopes) turned = RoundView<S>::turned(place);
  const P rho_um = place.rho_um;
  const double nearest = smallest(rho_um), farthest = largest(rho_um);
  [[maybe_unused]] P by_rho(0.0), by_angle(0.0);
  for (const Part& part : parts_) {
    const double end = lane(plain(part.end_um), 0);
    if (part.outwards ? farthest < end - part.blur_um || nearest > part.middle_um
                      : farthest < part.middle_um || nearest > end + part.blur_um)
      continue;
    P share, slope;
    share_at(part, rho_um, share, slope);
    if (birefit::none(share > P(0.0))) continue;
    const P from_end = rho_um - plain(part.end_um), v2 = from_end * plain(part.inverse_span);
    const P v = root(min_of(max_of(v2, P(1e-30)), P(1.0)));
    if constexpr (kSlopes) {
      typename RadialTable<S>::Slopes slopes;
      const S light = part.light.sum(terms(), v, basis.data(), turned.data(), &slopes);
      const P by_v2 = select(v2 > P(1e-30), share * slopes.by_v * P(0.5) * inverse(v), P(0.0));
      const P outwards = by_v2 * plain(part.inverse_span) + plain(light) * slope;
      result = result + share * light;
      by_rho = by_rho + outwards;
      by_angle = by_angle + share * slopes.turned;
      part.by_end.add(-outwards, result);
      part.by_inverse_span.add(by_v2 * from_end, result);
    } else {
      result = result + share * part.light.sum(terms(), v, basis.data());
    }
  }
  if constexpr (kSlopes) view_.add_moves_and_turns(place, by_rho, by_angle, result);
}

bool eikonal_sums_wavelengths(const Scene& scene, const RenderPlan& plan, const Theta& theta) {
  const Microscope& m = scene.microscope;
  const bool plain_light = m.channel_light && m.before.empty() && m.behind.empty() && m.polarizer_deg &&
                           m.analyzer_deg && !m.polarizer_extinction_ratio && !m.analyzer_extinction_ratio;
  if (!plain_light) return false;
  const auto indices_at = [&](double nm) {
    const Theta there = at_wavelength(m, theta, 1e-3 * nm);
    const DropletOptics<double> o = droplet_optics(scene, Values<double>(there, {}, plan.demand.memo.get()));
    return std::array<double, 3>{o.n_o, o.n_e, o.n_host};
  };
  return indices_at(plan.wavelengths->wavelength_nm.front()) == indices_at(plan.wavelengths->wavelength_nm.back());
}

template <class S>
std::unique_ptr<SampleImage<S>> make_eikonal_image(const Scene& scene, const RenderPlan& plan, const Values<S>& value,
                                                   const BeamMaker& light) {
  return std::make_unique<EikonalImage<S>>(scene, plan, value, light);
}
#define BIREFIT_INSTANTIATE(S)                                                                                      \
  template class EikonalImage<S>;                                                                                   \
  template std::unique_ptr<SampleImage<S>> make_eikonal_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                                 const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
