#include "transport/methods/wei_norman.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/quadrature.h"
#include "transport/by_lane.h"
#include "transport/gauss_moments.h"
#include "transport/modes.h"

namespace birefit {
namespace {

constexpr MethodInfo kPaperInfo{"wei_norman",
                                1,
                                false,
                                false,
                                "product of exponentials, coupling integrals in closed form",
                                "Steinberg, ACM Trans. Graph. 39 (2020), eqs. 25-37; docs/methods.md"};
constexpr MethodInfo kExpInfo{"wei_norman_exp",
                              2,
                              false,
                              false,
                              "closed coupling integrals about layer centres, one exponential of both",
                              "Steinberg, ACM Trans. Graph. 39 (2020); docs/methods.md"};

using C = Complex<double>;
using ComplexSeries = Complex<Series<double>>;

/// The last term of a geometric series at half its radius of convergence, beyond which more terms gain little.
double largest_tail(int order) { return std::ldexp(1.0, -order); }

/// What a layer needs to know of the medium, for any scalar that holds values.
template <class S>
struct LayerMedium {
  double at, from, to;  ///< point of expansion and faces, in u
  OpticalPoint<Series<S>> series;
  OpticalPoint<S> entry, exit;
  std::vector<OpticalPoint<Slope<S>>> nodes;  ///< none, or half of them before `at` and half behind
  std::vector<double> weight;
};

template <class S>
bool constant_slope(const OpticalPoint<Series<S>>& p) {
  for (std::size_t k = 1; k < p.depth_slope_um.c.size(); ++k)
    for (int l = 0; l < kRaysOf<S>; ++l)
      if (lane(p.depth_slope_um.c[k], l) != 0) return false;
  return true;
}

/// 8 nodes in each quarter of the layer: 16 on either side of the expansion point, or all behind it.
template <class S>
LayerMedium<S> sample_layer(const Column<S>& column, double from, double to, const WeiNormanForm& form, bool check) {
  LayerMedium<S> m;
  m.from = from;
  m.to = to;
  m.at = form.centred ? 0.5 * (from + to) : from;
  column.sample_taylor(m.at, form.order + 1, &m.series);  // the coupling needs the derivative of the medium
  // A hair before the exit: at a break the layer ends on its own side.
  const double ends[2] = {from, std::nextafter(to, from)};
  OpticalPoint<S> faces[2];
  column.sample(ends, faces);
  m.entry = faces[0];
  m.exit = faces[1];
  if (check || !form.phase_series || !constant_slope(m.series)) {
    std::vector<double> u;
    const double q = 0.25 * (to - from);
    gauss8_nodes({from, from + q, from + 2 * q, from + 3 * q, to}, u, m.weight);
    m.nodes.resize(u.size());
    column.sample_with_slope(u, m.nodes.data());
  }
  return m;
}

template <class S>
LayerMedium<double> lane_of(const LayerMedium<S>& m, int l) {
  LayerMedium<double> r{m.at, m.from,  m.to, lane_of(m.series, l), lane_of(m.entry, l), lane_of(m.exit, l),
                        {},   m.weight};
  for (const auto& p : m.nodes) r.nodes.push_back(lane_of(p, l));
  return r;
}

C at(const ComplexSeries& s, double z) { return {s.re(z), s.im(z)}; }
double magnitude(const C& z) { return std::sqrt(norm(z)); }
ComplexSeries integral(const ComplexSeries& s) { return {birefit::integral(s.re), birefit::integral(s.im)}; }

/// Terms of a series without their phase: their sum, and the last one. Of a function that is odd or even about the
/// point of expansion every other term vanishes: half of the last but one, which is as much for a series that falls by
/// halves, speaks then.
struct Sizes {
  double sum = 0, last = 0;
  void add(double size) {
    sum += size;
    last = std::max(size, 0.5 * before_);
    before_ = size;
  }
  Sizes& operator+=(const Sizes& o) {
    sum += o.sum;
    last += o.last;
    return *this;
  }

 private:
  double before_ = 0;
};
/// int_0^end of envelope(z) exp(-2 i (c1 z + c2 z^2)) dz, end of either sign, and the sizes of its terms.
C coupling_integral(const ComplexSeries& envelope, double c1, double c2, double end, int order, Sizes& sizes) {
  if (end == 0) return C();
  std::array<C, kMaxMoment + 1> moments;
  gauss_moments(order, 2 * c1 * end, 2 * c2 * end * end, moments.data());
  C sum;
  Sizes terms;
  double power = end;
  for (int m = 0; m <= order; ++m, power *= end) {
    const C term = power * C(envelope.re.c[m], envelope.im.c[m]);
    sum = sum + term * moments[m];
    terms.add(magnitude(term) / (m + 1));
  }
  sizes += terms;
  return sum;
}
/// Couplings too small to be seen are not judged: their series is rounding.
constexpr double kInvisible = 1e-9;
double tail_of(const Sizes& s) { return s.sum > kInvisible ? s.last / s.sum : 0; }
/// The terms of f or g3 behind the linear one.
Sizes varying_part(const ComplexSeries& phase, double end, int order) {
  Sizes sizes;
  for (int k = 2; k <= order + 1; ++k) sizes.add(magnitude(C(phase.re.c[k], phase.im.c[k])) * std::pow(end, k));
  return sizes;
}

WeiNormanLayer closed_layer(const LayerMedium<double>& m, const Ray<double>& ray, const WeiNormanForm& form) {
  const OpticalPoint<Series<double>> medium = by_depth(m.series);
  const ModalGenerator<Series<double>> series = modal_generator(medium, ray);
  // Depths of the faces from the point of expansion, before <= 0 <= behind, and what the quadrature gives on the way.
  double before = 0, behind = 0;
  C f_nodes, g3_before, g3_behind;
  std::vector<ModalGenerator<double>> at_nodes;
  std::vector<double> dz;
  for (std::size_t i = 0; i < m.nodes.size(); ++i) {
    const bool first = form.centred && 2 * i < m.nodes.size();
    dz.push_back(m.weight[i] * m.nodes[i].depth_slope_um.value);
    at_nodes.push_back(modal_generator(by_depth(m.nodes[i]), ray));
    (first ? before : behind) += first ? -dz.back() : dz.back();
    f_nodes = f_nodes + dz.back() * at_nodes.back().a;
    C& g3 = first ? g3_before : g3_behind;
    g3 = g3 + dz.back() * at_nodes.back().b3;
  }
  if (m.nodes.empty()) {
    before = (m.from - m.at) * medium.depth_slope_um.c[0];
    behind = (m.to - m.at) * medium.depth_slope_um.c[0];
  }

  WeiNormanLayer layer;
  layer.length_um = behind - before;
  // f and g3 up to the order of the paper's eqs. 32, 33: integrals of a, b3 to z^n.
  ComplexSeries a = series.a, b3 = series.b3;
  const int beyond = form.order + 1;
  a.re.c[beyond] = a.im.c[beyond] = b3.re.c[beyond] = b3.im.c[beyond] = 0;
  const ComplexSeries f = integral(a), g3 = integral(b3);
  C g3_first;  // entry face to the point of expansion
  if (form.phase_series) {
    layer.f = at(f, behind) - at(f, before);
    g3_first = -at(g3, before);
    layer.g3 = g3_first + at(g3, behind);
  } else {
    layer.f = f_nodes;
    g3_first = g3_before;
    layer.g3 = g3_before + g3_behind;
  }

  const double c1 = series.b3.im.c[0], c2 = 0.5 * series.b3.im.c[1];
  layer.c1_per_um = c1;
  layer.c2_per_um2 = c2;
  // The envelopes of eqs. 34, 35; the real part of g3 is attenuation and normalisation, no phase.
  const Series<double> growth = exp(2.0 * integral(series.b3).re);
  const ComplexSeries first = inverse(growth) * series.b1, second = growth * series.b2;
  Sizes sizes[2];
  const auto couple = [&](const ComplexSeries& envelope, double sign, Sizes& s) {
    return coupling_integral(envelope, sign * c1, sign * c2, behind, form.order, s) -
           coupling_integral(envelope, sign * c1, sign * c2, before, form.order, s);
  };
  const C from_face[2] = {exp(-2.0 * g3_first), exp(2.0 * g3_first)};
  layer.G1 = from_face[0] * couple(first, 1, sizes[0]);
  layer.G2 = from_face[1] * couple(second, -1, sizes[1]);
  layer.taylor_tail = std::max(tail_of(sizes[0]), tail_of(sizes[1]));
  layer.truncation = magnitude(from_face[0]) * sizes[0].last + magnitude(from_face[1]) * sizes[1].last;
  if (form.phase_series)
    for (const ComplexSeries* s : {&f, &g3}) {
      const Sizes terms = varying_part(*s, std::max(behind, -before), form.order);
      layer.taylor_tail = std::max(layer.taylor_tail, tail_of(terms));
      layer.truncation += terms.last;
    }

  for (std::size_t i = 0; i < at_nodes.size(); ++i) {
    const double b1 = magnitude(at_nodes[i].b1), b2 = magnitude(at_nodes[i].b2), b3_size = magnitude(at_nodes[i].b3);
    layer.peak_coupling = std::max(layer.peak_coupling, std::max(b1, b2) * layer.length_um);
    layer.estimate += dz[i] * b1 * b2 * std::min(0.5 * layer.length_um, 0.5 / std::max(b3_size, 1e-300));
  }
  if (!at_nodes.empty()) {
    const auto residual = [&](double phase, double z) { return std::fabs(phase - (c1 + c2 * z) * z); };
    layer.phase_residual_rad = std::max(residual(g3_behind.im, behind), residual(-g3_before.im, before));
  }
  return layer;
}

bool finite(const Mat2<double>& m) {
  for (const C& z : {m.a, m.b, m.c, m.d})
    if (!std::isfinite(z.re) || !std::isfinite(z.im)) return false;
  return true;
}

/// T = M(exit) U M(entry)^-1: the normalisation of the modes cancels.
Mat2<double> layer_transfer(const LayerMedium<double>& m, const Ray<double>& ray, const WeiNormanForm& form) {
  const Mat2<double> first = unit_modes(m.entry, ray.kx, ray.ky).fields,
                     last = unit_modes(m.exit, ray.kx, ray.ky).fields;
  return last * closed_layer(m, ray, form).mode_transfer(form.exponential) * inverse(first);
}

template <class S>
Mat2<S> transfer_of(const MethodInfo& info, const Column<S>& column, const Ray<S>& ray, const Mesh& mesh,
                    const WeiNormanForm& form) {
  return checked_transfer(info, transfer_by_lanes(
                                    info, column, ray, mesh,
                                    [&](auto from, auto to) { return sample_layer(column, from, to, form, false); },
                                    [&](const auto& medium, int l, const Ray<double>& one) {
                                      return layer_transfer(lane_of(medium, l), one, form);
                                    }));
}

}  // namespace

Mat2<double> WeiNormanLayer::mode_transfer(bool exponential) const {
  const C up = exp(f + g3), down = exp(f - g3);
  const C product = G1 * G2;
  if (!exponential) return {up * (C(1.0) + product), up * G1, down * G2, down};
  // cosh s and sinh(s)/s are entire in s^2 = G1 G2 = -q
  const ComplexCosSinc<double> h = cos_sinc_sq(-product);
  return {up * h.cos_sq, up * (h.sinc_sq * G1), down * (h.sinc_sq * G2), down * h.cos_sq};
}

WeiNormanLayer wei_norman_layer(const Column<double>& column, const Ray<double>& ray, double from, double to,
                                const WeiNormanForm& form, bool check) {
  return closed_layer(sample_layer(column, from, to, form, check), ray, form);
}

WeiNormanReport wei_norman_report(const Column<double>& column, const Ray<double>& ray, const Mesh& mesh,
                                  const WeiNormanForm& form) {
  WeiNormanReport report;
  const auto refuse = [&](const char* reason) {
    if (report.valid) report.reason = reason;
    report.valid = false;
  };
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i) {
    const LayerMedium<double> medium = sample_layer(column, mesh[i], mesh[i + 1], form, true);
    const WeiNormanLayer layer = closed_layer(medium, ray, form);
    const auto at = [&](double u) {
      OpticalPoint<double> p;
      column.sample({&u, 1}, &p);
      return p;
    };
    if (modes_turn_over(at, ray, mesh[i], mesh[i + 1], 16))
      refuse("the axis passes the wavevector, where the modes change places");
    if (!finite(layer_transfer(medium, ray, form)) || !std::isfinite(layer.estimate)) {
      refuse("not finite: the axis is parallel to the wavevector, or a layer far too thick");
      continue;
    }
    report.estimate += layer.estimate;
    report.truncation += layer.truncation;
    report.phase_residual_rad = std::max(report.phase_residual_rad, layer.phase_residual_rad);
    report.taylor_tail = std::max(report.taylor_tail, layer.taylor_tail);
    report.peak_coupling = std::max(report.peak_coupling, layer.peak_coupling);
    report.min_v22 = std::min(report.min_v22, magnitude(cos_sinc_sq(-(layer.G1 * layer.G2)).cos_sq));
  }
  // The bounds are those of the measurements in docs/methods.md, all per layer.
  if (report.peak_coupling > 1) refuse("the modes turn by more than 1 rad in a layer");
  if (report.taylor_tail > largest_tail(form.order)) refuse("a layer is longer than half the radius of convergence");
  if (report.min_v22 < 0.3) refuse("close to a pole of g1 inside a layer");
  return report;
}

#define BIREFIT_WEI_NORMAN(Method, Info)                                                            \
  template <class S>                                                                                \
  const MethodInfo& Method<S>::info() const {                                                       \
    return Info;                                                                                    \
  }                                                                                                 \
  template <class S>                                                                                \
  Mat2<S> Method<S>::transfer(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const { \
    return transfer_of(Info, column, ray, mesh, form_);                                             \
  }                                                                                                 \
  template <class S>                                                                                \
  Su2<S> Method<S>::retarder(const Column<S>& column, const Ray<S>& ray, const Mesh& mesh) const {  \
    return nearest_retarder(column, ray, transfer(column, ray, mesh));                              \
  }
BIREFIT_WEI_NORMAN(WeiNorman, kPaperInfo)
BIREFIT_WEI_NORMAN(WeiNormanExp, kExpInfo)

#define BIREFIT_INSTANTIATE(S) \
  template class WeiNorman<S>; \
  template class WeiNormanExp<S>;
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
