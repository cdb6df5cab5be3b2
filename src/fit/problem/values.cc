// From the model's intensity to a picture's values, and from changes of the one to those of the other.

#include <optional>
#include <vector>

#include "core/threads.h"
#include "fit/problem/effects.h"
#include "fit/problem/least_squares.h"

namespace birefit::estimation {

/// Sum of the coefficients of the intensity, or of those by themselves, at these pixels.
Eigen::VectorXd LeastSquares::light(const Frame& frame, bool of_intensity, Eigen::Index begin,
                                    Eigen::Index rows) const {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(rows);
  for (const Term& term : frame.terms) {
    if (term.of_intensity != of_intensity) continue;
    const double coefficient = term.coefficient_in(theta_);
    if (term.shape || term.effect)
      sum += coefficient * term.at_pixels.segment(begin, rows);
    else
      sum.array() += coefficient;
  }
  return sum;
}

/// How this light changes by the frame's effects.
void LeastSquares::set_effects(Frame& frame, const Eigen::Ref<const Eigen::VectorXd>& intensity) const {
  if (std::none_of(frame.terms.begin(), frame.terms.end(), [](const Term& term) { return term.effect.has_value(); }))
    return;
  const View& view = task_.picture(static_cast<int>(&frame - frames_.data())).scene.view;
  const KnownLight known(view, theta_, frame.set.pixels, intensity);
  for (Term& term : frame.terms) {
    if (!term.effect) continue;
    term.at_pixels.resize(frame.count);
    for (Eigen::Index i = 0; i < frame.count; ++i) {
      const auto [x, y] = frame.set.pixels[static_cast<std::size_t>(i)];
      term.at_pixels[i] = effect_at(*term.effect, known, x, y);
    }
    term.whitened = term.at_pixels;
    whiten(frame, term.whitened, 1);
  }
}

/// Changes of a frame's intensity, a column each, become those of its values: gain times them, and what they do to
/// effects. `searched`: the unknown that each column is by; others move no centre.
void LeastSquares::to_values(const Frame& frame, Eigen::Ref<Eigen::MatrixXd> columns, const std::vector<int>& searched,
                             int threads) const {
  const View& view = task_.picture(static_cast<int>(&frame - frames_.data())).scene.view;
  const Eigen::VectorXd gain = light(frame, true, 0, frame.count);
  std::vector<const Term*> effects;
  for (const Term& term : frame.terms)
    if (term.effect && term.coefficient_in(theta_) != 0) effects.push_back(&term);
  std::optional<KnownLight> known;
  if (!effects.empty()) known.emplace(view, theta_, frame.set.pixels, intensity_.segment(frame.begin, frame.count));
  parallel_for(static_cast<int>(columns.cols()), threads, [&](int j) {
    auto column = columns.col(j);
    if (effects.empty()) {
      column.array() *= gain.array();
      return;
    }
    LightChange change{Image(view.width, view.height)};
    for (Eigen::Index i = 0; i < frame.count; ++i) {
      const auto [x, y] = frame.set.pixels[static_cast<std::size_t>(i)];
      change.light(x, y) = column[i];
    }
    const int unknown = j < std::ssize(searched) ? searched[static_cast<std::size_t>(j)] : -1;
    const int moved = unknown >= 0 ? unknowns_.searched[static_cast<std::size_t>(unknown)] : -1;
    const auto by_moved = [&](ParameterRef centre) {
      for (const TieSlope& slope : centre ? job_.parameters.slopes(centre.index, theta_) : std::vector<TieSlope>{})
        if (slope.index == moved) return slope.by;
      return 0.0;
    };
    change.center_x = by_moved(view.center_x_px);
    change.center_y = by_moved(view.center_y_px);
    for (Eigen::Index i = 0; i < frame.count; ++i) {
      const auto [x, y] = frame.set.pixels[static_cast<std::size_t>(i)];
      double by_effects = 0;
      for (const Term* term : effects)
        by_effects += term->coefficient_in(theta_) * effect_change_at(*term->effect, *known, change, x, y);
      column[i] = gain[i] * column[i] + by_effects;
    }
  });
}

}  // namespace birefit::estimation
