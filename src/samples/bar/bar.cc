#include "samples/bar/bar.h"

#include <cmath>
#include <numbers>

#include "instrument/exposure.h"
#include "samples/kind.h"

namespace birefit {
namespace {

template <class S>
class BarImage final : public SampleImage<S> {
 public:
  BarImage(const Scene& scene, const Values<S>& value, const BeamMaker& maker)
      : along_y_(std::get<Crystal>(scene.sample).field_along_y) {
    const Crystal& crystal = std::get<Crystal>(scene.sample);
    const S across = value(crystal.bias_v) + value.get(crystal.built_in_bias_v, 0);
    phase_ = std::numbers::pi * across / value(crystal.half_wave_voltage_v);
    for (ParameterRef ref : crystal.field_legendre) legendre_.push_back(value(ref));
    const double middle = along_y_ ? scene.view.middle_y() : scene.view.middle_x(),
                 size = along_y_ ? scene.view.whole_height() : scene.view.whole_width();
    low_ = value.get(crystal.electrode_low_px, middle - 0.5 * size);
    high_ = value.get(crystal.electrode_high_px, middle + 0.5 * size);
    // A retarder cos(delta/2) + i sin(delta/2) sz in the frame of the induced axis. Between linear states this is Born
    // & Wolf 15.4.2, I = cos^2(A - P) - sin 2(A - f) sin 2(P - f) sin^2(delta/2), f the induced axis.
    const Line<S> light = maker.in(value).line;
    S sin_twice, cos_twice;
    sin_cos(2.0 * (value.radians(crystal.slow_axis_deg) + value.radians(scene.view.rotation_deg)), sin_twice,
            cos_twice);
    const RetarderForm<S> form = light.form().in_frame(cos_twice, sin_twice);
    bright_ = form.ww;
    modulation_ = form.zz - form.ww;
    turning_ = 2.0 * form.wz;
    linear_ = light.linear();
  }
  void light(const PlainOf<S>& column, const PlainOf<S>& row, S* out) const override {
    S field(1.0);
    if (!legendre_.empty()) {
      const S t = 2.0 * (S(along_y_ ? row : column) - low_) / (high_ - low_) - 1.0;
      S before(1.0), now = t;  // P_0, P_1; (j + 1) P_{j+1} = (2j + 1) t P_j - j P_{j-1}
      for (std::size_t j = 1; j <= legendre_.size(); ++j) {
        field = field + legendre_[j - 1] * now;
        const double order = static_cast<double>(j);
        const S next = (t * now * (2 * order + 1) - before * order) * (1 / (order + 1));
        before = now;
        now = next;
      }
    }
    if (linear_) {
      const S s = sin(0.5 * phase_ * field);
      out[0] = bright_ + modulation_ * s * s;
      return;
    }
    S s, c;
    sin_cos(0.5 * phase_ * field, s, c);
    out[0] = bright_ + (modulation_ * s + turning_ * c) * s;
  }

 private:
  bool along_y_, linear_;
  S phase_, low_, high_, bright_, modulation_;
  S turning_;  ///< of elliptic light
  std::vector<S> legendre_;
};

RenderPlan plan_bar(const Planning& planning) {
  check_closed_form(planning.demand, "a crystal bar");
  RenderPlan plan = planning.start();
  plan.method = "closed_form";
  plan.reasons.push_back("a crystal between electrodes is one retarder per pixel: sin^2 in closed form");
  return plan;
}

/// The retardance where the field is largest (rad).
std::vector<double> bar_phases(const Scene& scene, const Values<double>& value) {
  std::vector<double> result;
  const Crystal& crystal = std::get<Crystal>(scene.sample);
  double field = 1;
  for (ParameterRef c : crystal.field_legendre) field += value(c);
  result.push_back(std::numbers::pi * (value(crystal.bias_v) + value.get(crystal.built_in_bias_v, 0)) /
                   value(crystal.half_wave_voltage_v) * field);
  return result;
}

/// A bar's field varies along itself: strips follow each other across it.
Traits bar_traits(const Scene& scene) {
  const Crystal& crystal = std::get<Crystal>(scene.sample);
  Traits traits;
  if (crystal.field_legendre.empty())  // else the variation is the model's own
    traits.strips = crystal.field_along_y ? Traits::Strips::rows : Traits::Strips::columns;
  return traits;
}

}  // namespace

template <class S>
std::unique_ptr<SampleImage<S>> make_bar_image(const Scene& scene, const RenderPlan&, const Values<S>& value,
                                               const BeamMaker& light) {
  return std::make_unique<BarImage<S>>(scene, value, light);
}
#define BIREFIT_INSTANTIATE(S)                                                                                  \
  template std::unique_ptr<SampleImage<S>> make_bar_image<S>(const Scene&, const RenderPlan&, const Values<S>&, \
                                                             const BeamMaker&);
BIREFIT_FOR_EACH_SCALAR(BIREFIT_INSTANTIATE)

const SampleKind kBar{
    .name = "bar", .is = is_sample<Crystal>, .plan = plan_bar, .phases_rad = bar_phases, .traits = bar_traits};

}  // namespace birefit
