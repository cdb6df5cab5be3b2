#pragma once
// A heated plate of fixed optic axis in converging light, computed a second time from textbook plane waves: Fresnel's
// matching of tangential E and H at both faces, and two phase integrals between them. Shares nothing with src/.
//
// Waves of a uniaxial medium with wavevector (kx, ky, q) in units of k0: ordinary q^2 = n_o^2 - kk, E = a x k;
// extraordinary from n_o^2 k.k + (n_e^2 - n_o^2)(a.k)^2 = n_o^2 n_e^2, E = n_o^2 a - (a.k) k; H = k x E.

#include <array>
#include <cmath>
#include <complex>
#include <vector>

#include <Eigen/Dense>

namespace birefit::testing {

struct IndependentPlate {
  double thickness_um = 800, wavelength_um = 0.64, half_angle_deg = 15;
  Eigen::Vector3d axis{-0.353553, 0.353553, -0.866025};
  double fourier_number = 0.1, cold_k = 278, hot_k = 368;
  double polarizer_deg = 0, analyzer_deg = 90;
  int size_px = 64;

  /// Eigenfunction series; 40 terms are exact to rounding for fourier_number > 0.01.
  double temperature_k(double x) const {
    double u = x;
    for (int n = 1; n <= 40; ++n)
      u += 2 / (n * M_PI) * (n % 2 ? -1 : 1) * std::exp(-n * n * M_PI * M_PI * fourier_number) * std::sin(n * M_PI * x);
    return cold_k + (hot_k - cold_k) * u;
  }
  static double n_e_at(double temperature) { return 2.1942 - temperature / 750; }

  struct Wave {
    double q;
    Eigen::Vector4d field;  ///< Ex, Ey, Hx, Hy with unit |flux|
  };
  static Wave wave(const Eigen::Vector3d& k, const Eigen::Vector3d& e) {
    const Eigen::Vector3d h = k.cross(e);
    Wave w{k.z(), {e.x(), e.y(), h.x(), h.y()}};
    w.field /= std::sqrt(std::abs(e.x() * h.y() - e.y() * h.x()));
    return w;
  }
  double extraordinary_q(double kx, double ky, double n_e, double sign) const {
    const Eigen::Vector3d a = axis.normalized();
    const double eo = 1.53 * 1.53, de = n_e * n_e - eo, ak = a.x() * kx + a.y() * ky;
    const double aa = eo + de * a.z() * a.z(), b = de * a.z() * ak;
    const double c = eo * (kx * kx + ky * ky) + de * ak * ak - eo * n_e * n_e;
    return (-b + sign * std::sqrt(b * b - aa * c)) / aa;
  }
  /// forward o, forward e, backward o, backward e
  std::array<Wave, 4> waves(double kx, double ky, double n_e) const {
    const Eigen::Vector3d a = axis.normalized();
    const double eo = 1.53 * 1.53, qo = std::sqrt(eo - kx * kx - ky * ky);
    std::array<Wave, 4> w;
    for (int back = 0; back < 2; ++back) {
      const double sign = back ? -1 : 1;
      const Eigen::Vector3d ko(kx, ky, sign * qo), ke(kx, ky, extraordinary_q(kx, ky, n_e, sign));
      w[static_cast<std::size_t>(2 * back)] = wave(ko, a.cross(ko));
      w[static_cast<std::size_t>(2 * back + 1)] = wave(ke, eo * a - a.dot(ke) * ke);
    }
    return w;
  }

  std::vector<double> n_e;  ///< at Simpson's nodes, made by prepare()
  void prepare(int panels = 128) {
    n_e.clear();
    for (int i = 0; i <= panels; ++i) n_e.push_back(n_e_at(temperature_k(static_cast<double>(i) / panels)));
  }

  /// Intensity for one direction in air, tan(incidence) (tx, ty).
  double intensity(double tx, double ty) const {
    const double tan = std::hypot(tx, ty), c = 1 / std::hypot(1.0, tan), s = tan * c;
    const double cf = tan > 0 ? tx / tan : 1, sf = tan > 0 ? ty / tan : 0;
    const double kx = s * cf, ky = s * sf;
    // s and p of air, forward and backward, unit flux.
    const Eigen::Vector3d es(-sf, cf, 0), forward(kx, ky, c), backward(kx, ky, -c);
    const Wave air[4] = {wave(forward, es), wave(forward, es.cross(forward)), wave(backward, es),
                         wave(backward, es.cross(backward))};
    const auto first = waves(kx, ky, n_e.front()), last = waves(kx, ky, n_e.back());
    // entry: incident j + reflected = transmitted o, e
    Eigen::Matrix4d m;
    m << first[0].field, first[1].field, -air[2].field, -air[3].field;
    Eigen::Matrix<double, 4, 2> in;
    in << air[0].field, air[1].field;
    const Eigen::Matrix2d entry = (m.inverse() * in).topRows<2>();
    m << air[0].field, air[1].field, -last[2].field, -last[3].field;
    in << last[0].field, last[1].field;
    const Eigen::Matrix2d exit = (m.inverse() * in).topRows<2>();
    double path = 0;
    const std::size_t n = n_e.size() - 1;
    for (std::size_t i = 0; i <= n; ++i)
      path += (i == 0 || i == n ? 1
               : i % 2          ? 4
                                : 2) *
              extraordinary_q(kx, ky, n_e[i], 1) / (3.0 * static_cast<double>(n));
    const double k0d = 2 * M_PI / wavelength_um * thickness_um;
    const std::complex<double> delta = std::polar(1.0, k0d * (path - first[0].q));
    // polarizer into (s, p): the aplanatic unrolling is a turn by the azimuth
    const double pr = polarizer_deg * M_PI / 180, an = analyzer_deg * M_PI / 180;
    const Eigen::Vector2d pol(std::sin(pr) * cf - std::cos(pr) * sf, std::cos(pr) * cf + std::sin(pr) * sf);
    const Eigen::Vector2d ana(std::sin(an) * cf - std::cos(an) * sf, std::cos(an) * cf + std::sin(an) * sf);
    const Eigen::Vector2d modes = entry * pol;
    const Eigen::Vector2cd after(modes(0), modes(1) * delta);
    return std::norm(ana.cast<std::complex<double>>().dot(exit.cast<std::complex<double>>() * after));
  }
  /// Mean over a pixel: n x n cells of 3 x 3 Gauss points (error of the fringe's mean: (phase change a cell)^6 / 2e6).
  double pixel(int column, int row, int n) const {
    const double scale = std::tan(half_angle_deg * M_PI / 180) * 2 / size_px, middle = 0.5 * (size_px - 1);
    const double gauss[3] = {0.5 - 0.5 * std::sqrt(0.6), 0.5, 0.5 + 0.5 * std::sqrt(0.6)},
                 weight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    double sum = 0;
    for (int j = 0; j < 3 * n; ++j)
      for (int i = 0; i < 3 * n; ++i) {
        const double x = (i / 3 + gauss[i % 3]) / n - 0.5, y = (j / 3 + gauss[j % 3]) / n - 0.5;
        sum += weight[i % 3] * weight[j % 3] * intensity((column + x - middle) * scale, (middle - row - y) * scale);
      }
    return sum / (n * n);
  }
};

}  // namespace birefit::testing
