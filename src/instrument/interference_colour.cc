#include "instrument/interference_colour.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "instrument/beam.h"
#include "instrument/exposure.h"

namespace birefit {
namespace {

/// Places a um that are asked first. The chi-square of white light has a minimum a fringe of the shortest wavelength at
/// most, 0.2 um; ten to each find all but those that are as shallow as they are narrow.
constexpr double kPlacesPerUm = 50;

/// Chi-square, its derivative by G, and the sum of squares that stands for its second (Gauss and Newton).
struct Misfit {
  double value = 0, slope = 0, curvature = 0;
};
Misfit misfit(const ColourCurve& curve, const std::vector<double>& recorded, const std::vector<double>& noise,
              double g) {
  Misfit m;
  Dual<double, 1> at(g);
  at.d[0] = 1;
  for (std::size_t c = 0; c < curve.channels(); ++c) {
    const Dual<double, 1> x = curve.at(c, at);
    const double off = (x.value - recorded[c]) / noise[c], rate = x.d[0] / noise[c];
    m.value += off * off;
    m.slope += 2 * off * rate;
    m.curvature += 2 * rate * rate;
  }
  return m;
}

/// Rows of weights times b, then times c.
std::vector<std::vector<double>> rows_of(const SpectralSum& sum, const std::vector<FringeOfLine>& fringe) {
  if (fringe.size() != sum.size()) throw std::logic_error("ColourCurve: a fringe for every wavelength");
  std::vector<std::vector<double>> rows;
  for (const auto part : {&FringeOfLine::b, &FringeOfLine::c})
    for (const std::vector<double>& weight : sum.weight) {
      std::vector<double>& row = rows.emplace_back();
      for (std::size_t k = 0; k < weight.size(); ++k) row.push_back(weight[k] * (fringe[k].*part));
    }
  return rows;
}

}  // namespace

FringeOfLine diagonal_fringe(const Microscope& microscope, const Values<double>& value) {
  const Line<double> line = BeamMaker(microscope, {}).in(value).line;
  const double twice = 2 * (value.radians(microscope.polarizer_deg) + 0.25 * std::numbers::pi), x = std::sin(twice),
               z = std::cos(twice);
  const RetarderForm<double>& f = line.form();
  const double sines = f.xx * x * x + 2 * f.xz * x * z + f.zz * z * z;
  // cos^2, sin^2 and twice sin cos of half the phase
  return {0.5 * (f.ww + sines), 0.5 * (f.ww - sines), f.wx * x + f.wz * z};
}

ColourCurve::ColourCurve(const SpectralSum& sum, const std::vector<FringeOfLine>& fringe, const std::vector<double>& t,
                         double reach_um)
    : chi_(rows_of(sum, fringe), t, reach_um) {
  for (const std::vector<double>& weight : sum.weight) {
    double open = 0;
    for (std::size_t k = 0; k < weight.size(); ++k) open += weight[k] * (fringe[k].a + fringe[k].b);
    open_.push_back(open);
  }
}

std::vector<RetardanceOfColour> retardances_of(const ColourCurve& curve, const std::vector<double>& recorded,
                                               const std::vector<double>& noise, double least_odds) {
  if (recorded.size() != curve.channels() || noise.size() != curve.channels())
    throw std::logic_error("retardances_of: a value and its noise for every channel");
  for (const double sd : noise)
    if (!(sd > 0)) throw std::logic_error("retardances_of: noise is above 0");
  const int last = std::max(1, static_cast<int>(std::ceil(kPlacesPerUm * curve.reach_um())));
  const double step = curve.reach_um() / last;
  std::vector<RetardanceOfColour> found;
  const auto take = [&](double g) {
    const Misfit m = misfit(curve, recorded, noise, g);
    found.push_back(
        {g, m.curvature > 0 ? std::sqrt(2 / m.curvature) : std::numeric_limits<double>::infinity(), m.value, 0});
  };
  // A minimum lies where the slope turns from below 0 to above: bisection finds it whatever the shape. At either end of
  // the range it may lie without; at 0 itself every slope is 0.
  const auto slope = [&](double g) { return misfit(curve, recorded, noise, g).slope; };
  double from = 1e-3 * step, before = slope(from);
  if (before > 0) take(0);
  for (int i = 1; i <= last; ++i) {
    const double to = i * step, here = slope(to);
    if (before < 0 && here >= 0) {
      double low = from, high = to;
      for (int k = 0; k < 50; ++k) {
        const double middle = 0.5 * (low + high);
        (slope(middle) < 0 ? low : high) = middle;
      }
      take(0.5 * (low + high));
    } else if (i == last && here < 0) {
      take(to);
    }
    from = to;
    before = here;
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.chi_square < b.chi_square; });
  for (RetardanceOfColour& one : found) one.odds = std::exp(0.5 * (found.front().chi_square - one.chi_square));
  std::erase_if(found, [&](const RetardanceOfColour& one) { return one.odds < least_odds; });
  return found;
}

Xyz interference_colour(const ColourCurve& curve, double g, const Xyz& white) {
  if (curve.channels() != 3) throw std::logic_error("interference_colour: the observer has three channels");
  const auto share = [&](std::size_t c) { return curve.at(c, g); };
  return {white.x * share(0), white.y * share(1), white.z * share(2)};
}

}  // namespace birefit
