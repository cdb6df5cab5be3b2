#include "wave/imaging.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

#include "core/quadrature.h"
#include "core/threads.h"
#include "transport/method.h"

namespace birefit {
namespace {

using Z = std::complex<double>;
using Matrix = Eigen::MatrixXcd;
constexpr double kPi = std::numbers::pi;

template <class S>
double part(const S& x, int f) {
  if constexpr (ScalarTraits<S>::derivatives > 0)
    if (f > 0) return lane(x.d[static_cast<std::size_t>(f - 1)], 0);
  (void)f;
  return lane(plain(x), 0);
}

/// exp(sign i k x) for wavevectors (rows) and places (columns).
Matrix waves(const std::vector<double>& k, const std::vector<double>& x, double sign) {
  Matrix m(static_cast<long>(k.size()), static_cast<long>(x.size()));
  for (long i = 0; i < m.rows(); ++i)
    for (long j = 0; j < m.cols(); ++j)
      m(i, j) = std::polar(1.0, sign * k[static_cast<std::size_t>(i)] * x[static_cast<std::size_t>(j)]);
  return m;
}

/// Interpolation between points one apart of what has no frequency beyond 1/2.2 of the highest they can carry: sinc
/// under a window, twelve points, 1e-5 of the value at worst.
constexpr int kTaps = 12;
constexpr double kOversampling = 2.2;
template <class T>
T kernel(const T& x) {
  const T t = x * (2.0 / kTaps), inside = max_of(T(1.0) - t * t, T(1e-12));
  constexpr double kBeta = 9.5;
  return cos_sinc_sq(T(square(kPi * x))).sinc_sq * exp(T(kBeta * (root(inside) - 1.0)));
}

/// Means over pixels along one axis as sums over points: `slope` by the pixel's place (px), `growth` by the logarithm
/// of its size, with which its place grows.
struct PixelWeights {
  struct Row {
    int first = 0;
    std::vector<double> weight, slope, growth;
  };
  std::vector<Row> rows;
  /// Pixel p covers the points (offset + sign p +- 1/2) pixel from the object's centre.
  PixelWeights(int pixels, double offset, double sign, double pixel_um, double spacing_um, int half) {
    const double per_pixel = pixel_um / spacing_um;
    // Gauss nodes that integrate the finest wave the points carry, pi px / spacing radians a pixel.
    const int n = 3 + static_cast<int>(std::ceil(1.6 * per_pixel));
    std::vector<double> node, weight;
    legendre_nodes(n, node, weight);
    rows.resize(static_cast<std::size_t>(pixels));
    for (int p = 0; p < pixels; ++p) {
      Row& row = rows[static_cast<std::size_t>(p)];
      const double middle = (offset + sign * p) * per_pixel;  // in points
      const int low = std::max(-half, static_cast<int>(std::floor(middle - 0.5 * per_pixel)) - kTaps / 2 + 1);
      const int high = std::min(half, static_cast<int>(std::floor(middle + 0.5 * per_pixel)) + kTaps / 2);
      if (high < low) continue;
      row.first = low + half;
      row.weight.assign(static_cast<std::size_t>(high - low + 1), 0.0);
      row.slope = row.growth = row.weight;
      for (int i = 0; i < n; ++i) {
        const double at = middle + 0.5 * node[static_cast<std::size_t>(i)] * per_pixel,
                     share = 0.5 * weight[static_cast<std::size_t>(i)];
        const int cell = static_cast<int>(std::floor(at));
        for (int j = std::max(low, cell - kTaps / 2 + 1); j <= std::min(high, cell + kTaps / 2); ++j) {
          Dual<double, 1> x(at - j);
          x.d[0] = per_pixel;
          const Dual<double, 1> v = kernel(x);
          row.weight[static_cast<std::size_t>(j - low)] += share * v.value;
          row.slope[static_cast<std::size_t>(j - low)] += share * v.d[0];
          row.growth[static_cast<std::size_t>(j - low)] += share * v.d[0] * at / per_pixel;
        }
      }
    }
  }
};

}  // namespace

WaveImaging plan_imaging(const WaveGrid& g, double k0, double na, double reach_x_um, double reach_y_um) {
  WaveImaging r;
  const double box = std::max(g.nx, g.ny) * g.step_um;
  // The picture's period is three boxes, and more where the objective is weak: what it spreads from one does not meet
  // the next.
  const double period = std::max(3 * box, box + 24 * kPi / (k0 * na));
  r.pupil_step_per_um = 2 * kPi / period;
  // 5 %: the wavelength may be fitted
  r.pupil_half = static_cast<int>(std::ceil(1.05 * k0 * na / r.pupil_step_per_um)) + 1;
  // Intensity carries twice the field's wavevectors.
  r.spacing_um = kPi / (2 * 1.05 * k0 * na * kOversampling);
  const auto half = [&](double reach, int n) {
    return n == 1 ? 0
                  : static_cast<int>(
                        std::ceil(std::min(reach, std::max(0.75 * n * g.step_um, 0.25 * period)) / r.spacing_um)) +
                        kTaps / 2;
  };
  r.half_x = half(reach_x_um, g.nx);
  r.half_y = half(reach_y_um, g.ny);
  return r;
}

namespace {

std::vector<double> places(int half, double step) {
  std::vector<double> x;
  for (int i = -half; i <= half; ++i) x.push_back(i * step);
  return x;
}

/// Wavevectors of the pupil (1/um) and points of the picture (um), along x and y; one of each where nothing changes
/// along y.
struct ImagingAxes {
  std::vector<double> kx, ky, x, y;
  ImagingAxes(const WaveGrid& g, const WaveImaging& plan)
      : kx(places(plan.pupil_half, plan.pupil_step_per_um)),
        ky(g.ny == 1 ? std::vector<double>{0.0} : kx),
        x(places(plan.half_x, plan.spacing_um)),
        y(g.ny == 1 ? std::vector<double>{0.0} : places(plan.half_y, plan.spacing_um)) {}
};

/// Angular spectrum of the scattered fields, x and y component of each in turn; empty where there is no such field.
std::vector<Matrix> spectrum_of(const WaveGrid& g, const ImagingAxes& axes, double tilt_x, double tilt_y,
                                const std::vector<WaveField>& fields, int wanted, int threads) {
  const auto shifted = [](std::vector<double> k, double by) {
    for (double& x : k) x -= by;
    return k;
  };
  std::vector<double> gx, gy;
  for (int i = 0; i < g.nx; ++i) gx.push_back(g.x_um(i));
  for (int j = 0; j < g.ny; ++j) gy.push_back(g.y_um(j));
  const Matrix to_kx = waves(gx, shifted(axes.kx, tilt_x), -1) * g.step_um,
               to_ky = waves(shifted(axes.ky, tilt_y), gy, -1) * (g.ny == 1 ? 1.0 : g.step_um);
  std::vector<Matrix> spectrum(2 * static_cast<std::size_t>(wanted));
  parallel_for(2 * wanted, threads, [&](int job) {
    if (static_cast<std::size_t>(job / 2) >= fields.size()) return;
    using Rows = Eigen::Matrix<Z, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const Eigen::Map<const Rows> field(fields[static_cast<std::size_t>(job / 2)].a[job % 2].data(), g.ny, g.nx);
    spectrum[static_cast<std::size_t>(job)] = to_ky * (field * to_kx);
  });
  return spectrum;
}

/// What objective, focus and analyser make of a wavevector's field: the factors of its x and y component.
template <class S>
class Objective {
 public:
  Objective(const WaveGrid& g, const WaveImaging& plan, const WaveLight<S>& light, const WaveMicroscope<S>& m)
      : light_(light),
        m_(m),
        tilt_q_(root(light.n_host * light.n_host -
                     (square(light.kx_per_um) + square(light.ky_per_um)) * inverse(light.k0_per_um * light.k0_per_um))),
        depth_(m.focus_um - g.exit_um),
        inverse_k0_(inverse(light.k0_per_um)),
        per_ramp_(1 / (1.29 * plan.pupil_step_per_um)) {}
  std::array<Complex<S>, 2> operator()(double x, const Pack& y) const {
    const Pack k2 = y * y + Pack(x * x), f = inverse_root(max_of(k2, Pack(1e-30)));
    const auto centre = k2 < Pack(1e-20);
    const Pack px = select(centre, Pack(1.0), f * Pack(x)), py = select(centre, Pack(0.0), f * y);
    // Where the pupil ends within a step, about the part of the step that is inside; a cubic ramp, for derivatives
    // without steps.
    const S edge = (m_.objective_na * light_.k0_per_um - S(k2 * f)) * per_ramp_ + 0.5;
    const S inside = min_of(max_of(edge, S(0.0)), S(1.0)), open = inside * inside * (3.0 - 2.0 * inside);
    const S q = root(max_of(S(light_.n_host * light_.n_host - S(k2) * inverse_k0_ * inverse_k0_), S(1e-6)));
    // An aplanatic objective turns s and p into the plane and keeps their flux: a itself.
    const S s_over = m_.aplanatic ? S(1.0) : root(light_.n_host * inverse(q)),
            p_over = m_.aplanatic ? S(1.0) : inverse(s_over);
    S sn, cs;
    sin_cos(light_.k0_per_um * (q - tilt_q_) * depth_, sn, cs);
    const auto seen_of = [&](const S& ax, const S& ay) {
      const S on_p = S(px) * ax + S(py) * ay, on_s = S(px) * ay - S(py) * ax;
      return std::array<S, 2>{open * (p_over * on_p * S(px) - s_over * on_s * S(py)),
                              open * (p_over * on_p * S(py) + s_over * on_s * S(px))};
    };
    const auto real = seen_of(m_.ax.re, m_.ay.re), imaginary = seen_of(-m_.ax.im, -m_.ay.im);
    const Complex<S> delay(cs, sn);
    return {Complex<S>(real[0], imaginary[0]) * delay, Complex<S>(real[1], imaginary[1]) * delay};
  }

 private:
  const WaveLight<S>& light_;
  const WaveMicroscope<S>& m_;
  S tilt_q_, depth_, inverse_k0_;
  double per_ramp_;
};

/// The field behind the analyser by wavevector, and its derivatives.
template <class S>
std::vector<Matrix> pupil_field(const ImagingAxes& axes, const Objective<S>& objective,
                                const std::vector<Matrix>& spectrum, std::size_t fields, int threads) {
  constexpr int kFields = 1 + ScalarTraits<S>::derivatives;
  const long nkx = static_cast<long>(axes.kx.size()), nky = static_cast<long>(axes.ky.size());
  std::vector<Matrix> seen(kFields, Matrix::Zero(nky, nkx));
  parallel_for(static_cast<int>(nkx), threads, [&](int column) {
    alignas(64) double ky_lanes[kLanes];
    for (long row = 0; row < nky; row += kLanes) {
      const int count = static_cast<int>(std::min<long>(kLanes, nky - row));
      for (int k = 0; k < kLanes; ++k) ky_lanes[k] = axes.ky[static_cast<std::size_t>(row + std::min(k, count - 1))];
      const auto factor = objective(axes.kx[static_cast<std::size_t>(column)], Pack::load_aligned(ky_lanes));
      for (int k = 0; k < count; ++k) {
        const auto number = [&](std::size_t which, int plane) {
          const auto at = [&](const S& s) {
            if constexpr (kFields > 1)
              return plane == 0 ? s.value.get(static_cast<std::size_t>(k))
                                : s.d[static_cast<std::size_t>(plane - 1)].get(static_cast<std::size_t>(k));
            else
              return s.get(static_cast<std::size_t>(k));
          };
          return Z(at(factor[which].re), at(factor[which].im));
        };
        const Z base_x = spectrum[0](row + k, column), base_y = spectrum[1](row + k, column);
        for (int p = 0; p < kFields; ++p) {
          Z v(0);
          if (static_cast<std::size_t>(p) < fields)
            v = number(0, 0) * spectrum[static_cast<std::size_t>(2 * p)](row + k, column) +
                number(1, 0) * spectrum[static_cast<std::size_t>(2 * p + 1)](row + k, column);
          if (p > 0) v += number(0, p) * base_x + number(1, p) * base_y;
          seen[static_cast<std::size_t>(p)](row + k, column) = v;
        }
      }
    }
  });
  return seen;
}

/// Means over the pixels of what is known at points, added to images that hold `background`.
template <class S>
void add_pixels(const WaveImaging& plan, const WaveMicroscope<S>& m, const std::vector<Eigen::MatrixXd>& intensity,
                const S& background, int threads, const std::vector<Image*>& images) {
  const PixelWeights across(m.width, -part(m.center_x_px, 0), 1, part(m.pixel_um, 0), plan.spacing_um, plan.half_x);
  const PixelWeights down(m.height, part(m.center_y_px, 0), -1, part(m.pixel_um, 0), plan.spacing_um, plan.half_y);
  using Row = PixelWeights::Row;
  using Of = std::vector<double> Row::*;
  const auto along_x = [&](const Eigen::MatrixXd& from, Of of) {
    Eigen::MatrixXd to = Eigen::MatrixXd::Zero(from.rows(), m.width);
    parallel_for(m.width, threads, [&](int c) {
      const PixelWeights::Row& row = across.rows[static_cast<std::size_t>(c)];
      const std::vector<double>& w = row.*of;
      for (std::size_t k = 0; k < w.size(); ++k) to.col(c) += w[k] * from.col(row.first + static_cast<long>(k));
    });
    return Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>(to);
  };
  using Rows = decltype(along_x(intensity[0], &Row::weight));
  const auto along_y = [&](const Rows& from, Of of, double scale, Image& to) {
    parallel_for(m.height, threads, [&](int r) {
      const PixelWeights::Row& row = down.rows[static_cast<std::size_t>(r)];
      const std::vector<double>& w = row.*of;
      Eigen::Map<Eigen::RowVectorXd> out(to.row(r), m.width);
      for (std::size_t k = 0; k < w.size(); ++k) out += scale * w[k] * from.row(row.first + static_cast<long>(k));
    });
  };
  for (std::size_t p = 0; p < images.size(); ++p) {
    Image& image = *images[p];
    if (image.width() != m.width || image.height() != m.height) image = Image(m.width, m.height);
    std::fill(image.row(0), image.row(0) + static_cast<std::size_t>(m.width) * static_cast<std::size_t>(m.height),
              part(background, static_cast<int>(p)));
    along_y(along_x(intensity[p], &Row::weight), &Row::weight, 1.0, image);
    if (p == 0) continue;
    const int f = static_cast<int>(p);
    // The centre moves the weights: place = column - centre_x, and centre_y - row.
    if (const double by = part(m.center_x_px, f); by != 0)
      along_y(along_x(intensity[0], &Row::slope), &Row::weight, -by, image);
    if (const double by = part(m.center_y_px, f); by != 0)
      along_y(along_x(intensity[0], &Row::weight), &Row::slope, by, image);
    if (const double by = part(m.pixel_um, f) / part(m.pixel_um, 0); by != 0) {
      along_y(along_x(intensity[0], &Row::growth), &Row::weight, by, image);
      along_y(along_x(intensity[0], &Row::weight), &Row::growth, by, image);
    }
  }
}

}  // namespace

template <class S>
void form_image(const WaveGrid& g, const WaveImaging& plan, const WaveLight<S>& light, const WaveMicroscope<S>& m,
                const std::vector<WaveField>& fields, int threads, const std::vector<Image*>& images) {
  constexpr int kFields = 1 + ScalarTraits<S>::derivatives;
  const ImagingAxes axes(g, plan);
  const std::vector<Matrix> spectrum = spectrum_of(g, axes, light.kx_per_um, light.ky_per_um, fields, kFields, threads);
  std::vector<Matrix> seen = pupil_field(axes, Objective<S>(g, plan, light, m), spectrum, fields.size(), threads);
  // Back to space, at the points of the picture.
  const Matrix from_kx = waves(axes.kx, axes.x, 1) * (plan.pupil_step_per_um / (2 * kPi)),
               from_ky = waves(axes.y, axes.ky, 1) * (g.ny == 1 ? 1.0 : plan.pupil_step_per_um / (2 * kPi));
  parallel_for(kFields, threads, [&](int p) {
    Matrix& field = seen[static_cast<std::size_t>(p)];
    field = (from_ky * field * from_kx).eval();
  });
  const bool tilted = light.kx_per_um != 0 || light.ky_per_um != 0;
  const double k0 = part(light.k0_per_um, 0);
  const bool collected = std::hypot(light.kx_per_um, light.ky_per_um) <= part(m.objective_na, 0) * k0;
  Complex<S> lit_x = light.ex, lit_y = light.ey;
  if (m.aplanatic) field_to_flux(light, lit_x, lit_y);
  const Complex<S> direct = conj(m.ax) * lit_x + conj(m.ay) * lit_y;
  const auto direct_part = [&](int f) { return Z(part(direct.re, f), part(direct.im, f)); };
  // Intensity less that of the incident light, which is what remains outside.
  std::vector<Eigen::MatrixXd> intensity(
      kFields, Eigen::MatrixXd(static_cast<long>(axes.y.size()), static_cast<long>(axes.x.size())));
  parallel_for(static_cast<int>(axes.x.size()), threads, [&](int i) {
    for (long j = 0; j < static_cast<long>(axes.y.size()); ++j) {
      const Z wave = tilted ? std::polar(1.0, light.kx_per_um * axes.x[static_cast<std::size_t>(i)] +
                                                  light.ky_per_um * axes.y[static_cast<std::size_t>(j)])
                            : Z(1);
      const Z incident = collected ? direct_part(0) * wave : Z(0), field = incident + seen[0](j, i);
      intensity[0](j, i) = std::norm(field) - std::norm(incident);
      for (int p = 1; p < kFields; ++p) {
        const Z by = collected ? direct_part(p) * wave : Z(0);
        intensity[static_cast<std::size_t>(p)](j, i) =
            2 * std::real(std::conj(field) * (by + seen[static_cast<std::size_t>(p)](j, i)) - std::conj(incident) * by);
      }
    }
  });
  add_pixels(plan, m, intensity, collected ? norm(direct) : S(0.0), threads, images);
}

#define BIREFIT_INSTANTIATE(S)                                                                                    \
  template void form_image<S>(const WaveGrid&, const WaveImaging&, const WaveLight<S>&, const WaveMicroscope<S>&, \
                              const std::vector<WaveField>&, int, const std::vector<Image*>&);
BIREFIT_INSTANTIATE(Pack)
BIREFIT_INSTANTIATE(Dual1)
BIREFIT_INSTANTIATE(Dual2)
BIREFIT_INSTANTIATE(Dual4)

}  // namespace birefit
