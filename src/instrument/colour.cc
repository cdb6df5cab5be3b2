#include "instrument/colour.h"

#include <cmath>
#include <numbers>

#include <Eigen/Dense>

namespace birefit {
namespace {

using Eigen::Matrix3d, Eigen::Vector3d;

Vector3d vector(const Xyz& c) { return {c.x, c.y, c.z}; }
/// Tristimulus values of Y = 1 by chromaticity.
Vector3d of_chromaticity(double x, double y) { return {x / y, 1, (1 - x - y) / y}; }
/// D65 as ASTM E308 has it. IEC 61966-2-1 says (0.3127, 0.3290), the same to the digits given: colours of either differ
/// by 1e-4.
Vector3d screen_white() { return {0.95047, 1, 1.08883}; }

/// From tristimulus values (white of Y = 1) to shares of the primaries of sRGB, IEC 61966-2-1, which make the white
/// with equal shares.
const Matrix3d& to_primaries() {
  static const Matrix3d matrix = [] {
    Matrix3d primaries;
    primaries << of_chromaticity(0.64, 0.33), of_chromaticity(0.30, 0.60), of_chromaticity(0.15, 0.06);
    const Vector3d shares = primaries.inverse() * screen_white();
    return Matrix3d((primaries * shares.asDiagonal()).inverse());
  }();
  return matrix;
}
/// Bradford's cone responses: Lam (1985); ICC.1, annex on chromatic adaptation.
const Matrix3d& bradford() {
  static const Matrix3d matrix{{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}};
  return matrix;
}

constexpr double kDegree = std::numbers::pi / 180;
double hue(double a, double b) {
  if (a == 0 && b == 0) return 0;
  const double degrees = std::atan2(b, a) / kDegree;
  return degrees < 0 ? degrees + 360 : degrees;
}
/// sqrt(c^7/(c^7 + 25^7)): 0 for greys, 1 for strong colours.
double chroma_share(double c) {
  const double c7 = std::pow(c, 7);
  return std::sqrt(c7 / (c7 + 6103515625.0));
}

}  // namespace

Lab lab_of(const Xyz& colour, const Xyz& white) {
  const auto f = [](double t) {
    constexpr double kKnee = 6.0 / 29;
    return t > kKnee * kKnee * kKnee ? std::cbrt(t) : t / (3 * kKnee * kKnee) + 4.0 / 29;
  };
  const double x = f(colour.x / white.x), y = f(colour.y / white.y), z = f(colour.z / white.z);
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

// Sharma, Wu & Dalal, Color Res. Appl. 30, 21 (2005): equations 2 to 22, the parametric weights 1.
double ciede2000(const Lab& p, const Lab& q) {
  // a is stretched for greys.
  const double stretch = 1.5 - 0.5 * chroma_share(0.5 * (std::hypot(p.a, p.b) + std::hypot(q.a, q.b)));
  const double a1 = stretch * p.a, a2 = stretch * q.a;
  const double c1 = std::hypot(a1, p.b), c2 = std::hypot(a2, q.b), h1 = hue(a1, p.b), h2 = hue(a2, q.b);
  const bool grey = c1 * c2 == 0;
  // The difference of hues the short way round, and their mean on that way; a grey has no hue.
  double turn = h2 - h1, mean_hue = h1 + h2;
  if (grey) {
    turn = 0;
  } else {
    const bool around = std::abs(turn) > 180;
    if (around) turn += turn > 0 ? -360 : 360;
    if (around) mean_hue += mean_hue < 360 ? 360 : -360;
    mean_hue *= 0.5;
  }
  const double dl = q.l - p.l, dc = c2 - c1, dh = 2 * std::sqrt(c1 * c2) * std::sin(0.5 * turn * kDegree);
  const double mean_l = 0.5 * (p.l + q.l), mean_c = 0.5 * (c1 + c2);
  const auto wave = [&](double times, double phase) { return std::cos((times * mean_hue + phase) * kDegree); };
  const double t = 1 - 0.17 * wave(1, -30) + 0.24 * wave(2, 0) + 0.32 * wave(3, 6) - 0.20 * wave(4, -63);
  const double from_grey = (mean_l - 50) * (mean_l - 50), from_blue = (mean_hue - 275) / 25;
  const double l = dl / (1 + 0.015 * from_grey / std::sqrt(20 + from_grey));
  const double c = dc / (1 + 0.045 * mean_c), h = dh / (1 + 0.015 * mean_c * t);
  const double rotation = -2 * chroma_share(mean_c) * std::sin(60 * std::exp(-from_blue * from_blue) * kDegree);
  return std::sqrt(std::fmax(0, l * l + c * c + h * h + rotation * c * h));
}

Rgb linear_srgb(const Xyz& colour, const Xyz& white) {
  const Vector3d from = bradford() * vector(white) / white.y, to = bradford() * screen_white();
  const Vector3d seen = bradford() * vector(colour) / white.y;
  const Vector3d rgb = to_primaries() * (bradford().inverse() * seen.cwiseProduct(to.cwiseQuotient(from)));
  return {rgb.x(), rgb.y(), rgb.z()};
}

double srgb_code(double light) {
  const double size = std::abs(light);
  const double code = size <= 0.0031308 ? 12.92 * size : 1.055 * std::pow(size, 1 / 2.4) - 0.055;
  return std::copysign(code, light);
}
double srgb_light(double code) {
  const double size = std::abs(code);
  const double light = size <= 0.04045 ? size / 12.92 : std::pow((size + 0.055) / 1.055, 2.4);
  return std::copysign(light, code);
}

}  // namespace birefit
