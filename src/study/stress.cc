// One-parameter sweeps into the places where methods fail.

#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "birefit/study.h"
#include "study/answer.h"
#include "study/rays.h"
#include "transport/methods.h"
#include "transport/methods/wei_norman.h"

namespace birefit {
namespace {

using namespace study;
constexpr double kDeg = std::numbers::pi / 180;

struct Trap {
  std::string sweep;
  double value;
  std::unique_ptr<Column<double>> column;
  Ray<double> ray;
};

template <class Law>
std::unique_ptr<Column<double>> column_of_law(Law law, bool planar = false, bool absorbing = false) {
  auto column = std::make_unique<LawColumn<double, Law>>(law);
  column->planar = planar;
  column->absorbing = absorbing;
  return column;
}

/// Tilt and azimuth linear in depth, indices constant, absorption by k on both.
struct TiltTwist {
  double tilt0, tilt1, azimuth0, azimuth1, n_o, n_e, k, thickness_um;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const T tilt = tilt0 + (tilt1 - tilt0) * u, azimuth = azimuth0 + (azimuth1 - azimuth0) * u;
    return {axis_from_angles<T>(tilt, azimuth), T(n_o * n_o - k * k), T(n_e * n_e - k * k), T(2 * n_o * k), T(2 * n_e * k), T(thickness_um)};
  }
};
/// In the layer plane, turning by pi about the middle within `width` of 5 um.
struct FastTurn {
  double width_um;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const T x = (u - 0.5) * (5 / width_um * 2), e = exp(x), f = inverse(e + inverse(e));
    const T tanh_x = (e - inverse(e)) * f;
    return {axis_from_angles<T>(T(0.0), 0.3 + (0.5 * std::numbers::pi) * tanh_x), T(1.52 * 1.52), T(1.74 * 1.74), T(0.0), T(0.0), T(5.0)};
  }
};
/// Uniform twist whose extraordinary index passes an extremum of the retardation rate: c2 = -k0 p/(4 d) at the entry.
struct StationaryRate {
  double p;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const T n = 1.70 + p * u + 0.02 * (u * u * u);
    return {axis_from_angles<T>(T(0.0), 0.3 + 0.4 * u), T(1.52 * 1.52), n * n, T(0.0), T(0.0), T(10.0)};
  }
};

std::vector<Trap> traps(bool quick) {
  std::vector<Trap> all;
  const double k0 = 2 * std::numbers::pi / 0.59;
  const auto add = [&](const std::string& sweep, double value, std::unique_ptr<Column<double>> column, double kx = 0, double ky = 0) {
    all.push_back({sweep, value, std::move(column), {k0, kx, ky, Continuity::e_only}});
  };
  const double radius = 4.5;
  const auto chord = [&](double impact) {
    const Chord<double> c{impact, std::sqrt(std::max(radius * radius - impact * impact, 1e-12)), radius};
    return column_of_law(TwistedRadialLaw<double>{c, 0.0, 1.0, 60 * kDeg, 1.52 * 1.52, 1.74 * 1.74});
  };
  for (double b : {1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-6, 0.0}) add("impact_um", b, chord(b));
  for (double gap : {1.0, 0.1, 1e-2, 1e-4, 1e-6, 1e-9}) add("rim_gap", gap, chord(radius * (1 - gap)));
  for (double offset : {0.3, 0.03, 3e-3, 1e-4, 1e-6, 0.0})
    add("axis_passes_ray", offset, column_of_law(TiltTwist{0.6, 2.1, offset, offset, 1.522, 1.739, 0, 5}), 0.3);
  for (double dn : {0.2, 1e-2, 1e-4, 1e-8, 0.0, -1e-4, -1e-2, -0.2})
    add("birefringence", dn, column_of_law(TiltTwist{0.2, 0.5, 0.3, 1.4, 1.6, 1.6 + dn, 0, 5}), 0.3);
  for (double d : {1.0, 10.0, 100.0, 1e3, 1e4}) add("thickness_um", d, column_of_law(TiltTwist{0.2, 0.5, 0.3, 1.4, 1.52, 1.74, 0, d}), 0.3);
  for (double pitch : {100.0, 10.0, 3.0, 1.0, 0.5, 0.36, 0.2})
    add("pitch_um", pitch, column_of_law(TiltTwist{0, 0, 0.3, 0.3 + 2 * std::numbers::pi * 10 / pitch, 1.52, 1.74, 0, 10}));
  for (double k : {1e-4, 1e-3, 1e-2, 0.1, 0.5})
    add("absorption_k", k, column_of_law(TiltTwist{0.2, 0.5, 0.3, 1.4, 1.52, 1.74, k, 20}, false, true), 0.3);
  for (double gap : {0.3, 0.1, 1e-2, 1e-3, 1e-5, 1e-8})
    add("gap_to_total_reflection", gap, column_of_law(TiltTwist{0.2, 0.5, 0.3, 1.4, 1.52, 1.74, 0, 5}), 1.52 - gap);
  for (double width : {2.0, 0.5, 0.1, 0.03}) add("turn_width_um", width, column_of_law(FastTurn{width}));
  for (double p : {0.1, 1e-3, 1e-6, 1e-12, 0.0, -1e-12, -1e-6, -1e-3, -0.1}) add("c2_parameter", p, column_of_law(StationaryRate{p}));
  if (quick) {  // the ends and the middle of each sweep
    std::vector<Trap> some;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const bool first = i == 0 || all[i - 1].sweep != all[i].sweep, last = i + 1 == all.size() || all[i + 1].sweep != all[i].sweep;
      if (first || last || i % 3 == 0) some.push_back(std::move(all[i]));
    }
    return some;
  }
  return all;
}

}  // namespace

std::vector<StressPoint> measure_stress(bool quick, const std::function<void(const std::string&)>& say) {
  constexpr double kTolerance = 1e-6;
  std::vector<StressPoint> points;
  std::string telling;
  for (const Trap& trap : traps(quick)) {
    if (say && trap.sweep != telling) say(telling = trap.sweep);
    // The truth: order 6, far beyond what the methods are allowed, checked by order 4.
    const Answer truth = by_halving(Magnus6<double>(), *trap.column, trap.ray, 1e-11, 1 << 17);
    const Answer check = by_halving(Magnus4<double>(), *trap.column, trap.ray, 1e-9, 1 << 17);
    const bool known = truth.flag.empty() && check.flag.empty() && relative_distance(check.transfer, truth.transfer) < 1e-8;
    const auto record = [&](const std::string& method, const Answer& answer) {
      StressPoint p{trap.sweep, trap.value, method, std::numeric_limits<double>::quiet_NaN(), answer.estimate, answer.samples, answer.flag};
      if (known && answer.flag.empty()) p.error = relative_distance(answer.transfer, truth.transfer);
      points.push_back(p);
    };
    for (const TransportMethod<double>* method : transport_methods<double>())
      if (!method->info().reflections && std::string(method->info().name) != "diagonal")
        record(method->info().name, by_halving(*method, *trap.column, trap.ray, kTolerance));
    record("diagonal", diagonal_answer(*trap.column, trap.ray, kTolerance));
    for (const int order : {kWeiNormanPaper.order, 3}) {
      const std::string ending = order == kWeiNormanPaper.order ? "" : fmt::format(" order {}", order);
      record("wei_norman" + ending, wei_norman_answer(false, order, *trap.column, trap.ray, 1e-3));
      record("wei_norman_exp" + ending, wei_norman_answer(true, order, *trap.column, trap.ray, 1e-3));
    }
    record("ode_scalar", ode_answer(true, *trap.column, trap.ray, kTolerance));
    if (trap.sweep != "thickness_um" || trap.value < 500) record("ode_operator", ode_answer(false, *trap.column, trap.ray, kTolerance));
  }
  return points;
}

}  // namespace birefit
