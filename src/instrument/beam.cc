#include "instrument/beam.h"

#include <algorithm>
#include <numbers>

#include "instrument/plate_crystal.h"

namespace birefit {
namespace {

constexpr double kUmPerNm = 1e-3;

template <class S>
Field<S> along(const S& azimuth_rad) {
  S s, c;
  sin_cos(azimuth_rad, s, c);
  return {Complex<S>(c), Complex<S>(s)};
}
template <class S>
Field<S> across(const Field<S>& f) {
  return {-f.y, f.x};
}

/// A polarizer or analyser: the field it is made for with weight 1 and, where it leaks or is not there, the one across.
template <class S>
Side<S> polarizer(ParameterRef azimuth_deg, ParameterRef extinction_ratio, const Values<S>& value) {
  Side<S> side;
  side.field[0] = along(value.radians(azimuth_deg));
  side.field[1] = across(side.field[0]);
  side.weight = {S(1.0), S(0.0)};
  if (!azimuth_deg) side.weight[1] = S(1.0);
  if (azimuth_deg && extinction_ratio) side.weight[1] = 1.0 / value(extinction_ratio);
  side.count = azimuth_deg && !extinction_ratio ? 1 : 2;
  return side;
}

// Of every kind of part its phase, of what it makes of fringes, and its matrix, without common phase: a kind that lacks
// one does not compile.

template <class S>
S phase_of(const Retarder& retarder, const S& wavelength_nm, const Values<S>& value) {
  if (retarder.phase_deg) return value.radians(retarder.phase_deg);
  const S phase = 2 * std::numbers::pi * value(retarder.retardance_nm) / wavelength_nm;
  if (retarder.crystal == PlateCrystal::none) return phase;
  return phase * relative_birefringence(retarder.crystal, S(kUmPerNm * wavelength_nm), kUmPerNm * retarder.at_nm);
}
/// The field along the azimuth is behind the other by the phase.
template <class S>
Su2<S> plate_matrix(const S& phase, const S& azimuth) {
  S s, c, along, across;
  sin_cos(S(0.5 * phase), s, c);
  sin_cos(S(2.0 * azimuth), across, along);
  return {c, s * across, S(0.0), s * along};
}
template <class S>
Su2<S> matrix_of(const Retarder& retarder, const S& wavelength_nm, const Values<S>& value) {
  S azimuth = value.radians(retarder.azimuth_deg);
  if (retarder.turned_deg) azimuth += value.radians(retarder.turned_deg);
  return plate_matrix(phase_of(retarder, wavelength_nm, value), azimuth);
}

template <class S>
S phase_of(const TiltedPlate& plate, const S& wavelength_nm, const Values<S>& value) {
  S sine, cosine;
  sin_cos(value.radians(plate.tilt_deg), sine, cosine);
  const S um = kUmPerNm * wavelength_nm;
  return 2 * std::numbers::pi * value(plate.thickness_um) * tilted_retardance(plate.crystal, um, sine) / um;
}
template <class S>
Su2<S> matrix_of(const TiltedPlate& plate, const S& wavelength_nm, const Values<S>& value) {
  return plate_matrix(phase_of(plate, wavelength_nm, value), value.radians(plate.azimuth_deg));
}

template <class S>
S phase_of(const Rotator& rotator, const S& /*wavelength_nm*/, const Values<S>& value) {
  return 2 * value.radians(rotator.angle_deg);
}
template <class S>
Su2<S> matrix_of(const Rotator& rotator, const S& /*wavelength_nm*/, const Values<S>& value) {
  S s, c;
  sin_cos(value.radians(rotator.angle_deg), s, c);
  return {c, S(0.0), -s, S(0.0)};
}

template <class S>
Su2<S> matrix_of_part(const PolarizingPart& part, const S& wavelength_nm, const Values<S>& value) {
  return std::visit([&](const auto& one) { return matrix_of(one, wavelength_nm, value); }, part);
}

template <class S>
void pass(const Su2<S>& part, Side<S>& side) {
  const Mat2<S> m = matrix(part);
  for (int k = 0; k < side.count; ++k) {
    Field<S>& f = side.field[static_cast<std::size_t>(k)];
    f = {m.a * f.x + m.b * f.y, m.c * f.x + m.d * f.y};
  }
}

/// The side looks the same in a mirror y -> -y: no coherence between x and y.
template <class S>
bool mirrored_side(const Side<S>& side) {
  Complex<S> coherence;
  for (std::size_t k = 0; k < static_cast<std::size_t>(side.count); ++k)
    coherence = coherence + side.weight[k] * (side.field[k].x * conj(side.field[k].y));
  return stays_at(coherence.re, 0.0) && stays_at(coherence.im, 0.0);
}

}  // namespace

template <class S>
Line<S>::Line(const Microscope& microscope, const Values<S>& value)
    : in_(polarizer(microscope.polarizer_deg, microscope.polarizer_extinction_ratio, value)),
      out_(polarizer(microscope.analyzer_deg, microscope.analyzer_extinction_ratio, value)) {
  const S all = 1.0 / (in_.weight[0] + in_.weight[1]);
  for (S& weight : in_.weight) weight = weight * all;
  const auto is_retarder = [](const PolarizingPart& part) { return !std::holds_alternative<Rotator>(part); };
  linear_ = in_.count == 1 && out_.count == 1 &&
            std::none_of(microscope.before.begin(), microscope.before.end(), is_retarder) &&
            std::none_of(microscope.behind.begin(), microscope.behind.end(), is_retarder);
  const S wavelength_nm = value(microscope.wavelength_nm);
  for (const PolarizingPart& part : microscope.before) pass(matrix_of_part(part, wavelength_nm, value), in_);
  // What the parts behind make of a field is let through as what their adjoints make of the analyser's is.
  for (auto part = microscope.behind.rbegin(); part != microscope.behind.rend(); ++part) {
    const Su2<S> m = matrix_of_part(*part, wavelength_nm, value);
    pass(Su2<S>{m.w, -m.x, -m.y, -m.z}, out_);
  }

  form_ = {S(0.0), S(0.0), S(0.0), S(0.0), S(0.0), S(0.0), S(0.0), S(0.0), S(0.0), S(0.0)};
  const auto add = [](S& sum, const S& weight, const S& term) { sum = sum + weight * term; };
  for (std::size_t i = 0; i < static_cast<std::size_t>(in_.count); ++i)
    for (std::size_t o = 0; o < static_cast<std::size_t>(out_.count); ++o) {
      const Field<S>&a = in_.field[i], b{conj(out_.field[o].x), conj(out_.field[o].y)};
      Pair& p = pair_[static_cast<std::size_t>(pairs_++)];
      p = {in_.weight[i] * out_.weight[o], b.x * a.x, b.x * a.y, b.y * a.x, b.y * a.y};
      // The amplitude is w D + y Y + i (x X + z Z).
      const Complex<S> d = p.one(), x = p.x(), y = p.iy(), z = p.z();
      const auto re = [](const Complex<S>& f, const Complex<S>& g) { return f.re * g.re + f.im * g.im; };
      const auto im = [](const Complex<S>& f, const Complex<S>& g) { return f.re * g.im - f.im * g.re; };
      add(form_.ww, p.weight, norm(d)), add(form_.xx, p.weight, norm(x));
      add(form_.yy, p.weight, norm(y)), add(form_.zz, p.weight, norm(z));
      add(form_.wy, p.weight, re(d, y)), add(form_.xz, p.weight, re(x, z));
      add(form_.wx, p.weight, -im(d, x)), add(form_.wz, p.weight, -im(d, z));
      add(form_.xy, p.weight, im(x, y)), add(form_.yz, p.weight, im(z, y));
    }
  open_ = form_.ww;
  if (linear_) {
    const S &px = in_.field[0].x.re, &py = in_.field[0].y.re, &ax = out_.field[0].x.re, &ay = out_.field[0].y.re;
    between_ = {px * ax + py * ay, px * ay - py * ax};
    sum_ = {px * ax - py * ay, px * ay + py * ax};
  }
}

template <class S>
bool Line<S>::mirrored() const {
  return mirrored_side(in_) && mirrored_side(out_);
}

std::vector<double> part_phases(const Microscope& microscope, const Values<double>& value) {
  std::vector<double> phases;
  for (const auto* parts : {&microscope.before, &microscope.behind})
    for (const PolarizingPart& part : *parts)
      phases.push_back(
          std::visit([&](const auto& one) { return phase_of(one, value(microscope.wavelength_nm), value); }, part));
  return phases;
}

#define BIREFIT_INSTANTIATE(S) template class Line<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
