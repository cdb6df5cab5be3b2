#pragma once
// Rays of geometrical optics through a nematic sphere, computed a second time from the textbook formulas alone, in
// three dimensions and Cartesian coordinates: shares nothing with src/. Slow on purpose: fixed Runge-Kutta steps,
// differences for gradients, bisection for surfaces.
//
// Extraordinary wavevectors w (over k0) lie on H = eo w^2 + (ee - eo) (n.w)^2 - eo ee = 0; r' = dH/dw, w' = -dH/dr, the
// optical path grows by w.r' (Kline & Kay, Electromagnetic Theory and Geometrical Optics; the ordinary ones on w^2 =
// eo). At a surface the tangential part of w stays, the normal part is the root of H that runs on. Flux passes by 4 Y1
// Y2 / (Y1 + Y2)^2, Y = H_t / E_t: eps/q of p waves where the axis is normal to the surface, q of s waves (q: normal
// part of w).

#include <array>
#include <cmath>
#include <functional>
#include <optional>

namespace birefit::testing {

struct IndependentRays {
  using Vector = std::array<double, 3>;
  double n_o = 1.52, n_e = 1.74, n_host = 1.52;
  double core = 0, core_index = 1.52;  ///< radius 1, that of the sphere
  bool extraordinary = true;
  std::function<Vector(const Vector&)> director;  ///< inside, outside the core; n and -n are one
  double step = 1e-3;

  struct Ray {
    /// mid plane, backwards along the outgoing ray; its angle from the view, > 0 away from the axis
    double image_radius, turn;
    double path;  ///< over that of the plane wave that the ray came with, both to the mid plane
    double flux;  ///< that surfaces pass
    Vector exit;
  };

  static double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
  static Vector sum(const Vector& a, double f, const Vector& b) {
    return {a[0] + f * b[0], a[1] + f * b[1], a[2] + f * b[2]};
  }

  double hamiltonian(const Vector& r, const Vector& w) const {
    const double eo = n_o * n_o, ee = n_e * n_e;
    if (!extraordinary) return dot(w, w) - eo;
    const double nw = dot(director(r), w);
    return eo * dot(w, w) + (ee - eo) * nw * nw - eo * ee;
  }
  struct State {
    Vector r, w;
    double path = 0;
  };
  /// By the length of the ray.
  State rate(const State& s) const {
    State out;
    for (std::size_t i = 0; i < 3; ++i) {
      constexpr double h = 1e-5;
      Vector up = s.r, down = s.r;
      up[i] += h, down[i] -= h;
      out.w[i] = -(hamiltonian(up, s.w) - hamiltonian(down, s.w)) / (2 * h);
      up = s.w, down = s.w;
      up[i] += h, down[i] -= h;
      out.r[i] = (hamiltonian(s.r, up) - hamiltonian(s.r, down)) / (2 * h);
    }
    const double speed = std::sqrt(dot(out.r, out.r));
    out.path = dot(s.w, out.r) / speed;
    for (std::size_t i = 0; i < 3; ++i) out.r[i] /= speed, out.w[i] /= speed;
    return out;
  }
  State stepped(const State& s, double h) const {
    const auto plus = [](const State& a, double f, const State& b) {
      return State{sum(a.r, f, b.r), sum(a.w, f, b.w), a.path + f * b.path};
    };
    const State a = rate(s), b = rate(plus(s, h / 2, a)), c = rate(plus(s, h / 2, b)), d = rate(plus(s, h, c));
    return plus(plus(plus(plus(s, h / 6, a), h / 3, b), h / 3, c), h / 6, d);
  }
  /// Into the liquid crystal (axis along the normal there): w with the tangential part of `w`, its normal part along
  /// `ahead`.
  std::optional<Vector> into_crystal(const Vector& w, const Vector& ahead) const {
    const Vector along = sum(w, -dot(w, ahead), ahead);
    // The axis is +-ahead: eo (t^2 + q^2) + (ee - eo) q^2 = eo ee.
    const double t2 = dot(along, along), q2 = extraordinary ? n_o * n_o * (1 - t2 / (n_e * n_e)) : n_o * n_o - t2;
    if (!(q2 > 0)) return {};
    return sum(along, std::sqrt(q2), ahead);
  }
  static std::optional<Vector> into_glass(const Vector& w, const Vector& ahead, double n) {
    const Vector along = sum(w, -dot(w, ahead), ahead);
    const double q2 = n * n - dot(along, along);
    if (!(q2 > 0)) return {};
    return sum(along, std::sqrt(q2), ahead);
  }
  double flux(double q_glass, double n, double q_crystal) const {
    const double y1 = extraordinary ? n * n / q_glass : q_glass, y2 = extraordinary ? n_o * n_o / q_crystal : q_crystal;
    return 4 * y1 * y2 / ((y1 + y2) * (y1 + y2));
  }
  /// From inside the crystal to where |r| is `radius`, within one step.
  State at_radius(const State& s, double radius, bool outwards) const {
    double low = 0, high = step;
    for (int i = 0; i < 50; ++i) {
      const double middle = 0.5 * (low + high);
      const Vector r = stepped(s, middle).r;
      ((std::sqrt(dot(r, r)) > radius) == outwards ? high : low) = middle;
    }
    return stepped(s, 0.5 * (low + high));
  }

  /// Coming in along z at distance b from the axis, in the plane of azimuth `azimuth`. None: totally reflected.
  std::optional<Ray> trace(double b, double azimuth = 0.7) const {
    const Vector out{std::cos(azimuth), std::sin(azimuth), 0};
    const double depth = std::sqrt(1 - b * b);
    State s{{b * out[0], b * out[1], -depth}, {0, 0, n_host}, -n_host * depth};  // path from the mid plane
    Ray ray;
    Vector inward{-s.r[0], -s.r[1], -s.r[2]};
    std::optional<Vector> next = into_crystal(s.w, inward);
    if (!next) return {};
    ray.flux = flux(dot(s.w, inward), n_host, dot(*next, inward));
    s.w = *next;
    for (int i = 0; i < 100000; ++i) {
      const State then = stepped(s, step);
      const double r = std::sqrt(dot(then.r, then.r));
      if (r > 1) {
        s = at_radius(s, 1, true);
        break;
      }
      if (r >= core) {
        s = then;
        continue;
      }
      s = at_radius(s, core, false);
      const Vector normal{-s.r[0] / core, -s.r[1] / core, -s.r[2] / core};
      next = into_glass(s.w, normal, core_index);
      if (!next) return {};
      ray.flux *= flux(dot(*next, normal), core_index, dot(s.w, normal));
      const double chord = 2 * core * dot(*next, normal) / core_index;
      s.r = sum(s.r, chord / core_index, *next);
      s.path += core_index * chord;
      const Vector leaving{s.r[0] / core, s.r[1] / core, s.r[2] / core};
      const Vector glass = *next;
      next = into_crystal(glass, leaving);
      if (!next) return {};
      ray.flux *= flux(dot(glass, leaving), core_index, dot(*next, leaving));
      s.w = *next;
    }
    ray.exit = s.r;
    next = into_glass(s.w, s.r, n_host);
    if (!next) return {};
    ray.flux *= flux(dot(*next, s.r), n_host, dot(s.w, s.r));
    const Vector k = *next;
    const Vector seen = sum(s.r, -s.r[2] / k[2], k);
    ray.image_radius = dot(seen, out);
    ray.turn = std::atan2(dot(k, out), k[2]);
    ray.path = s.path - n_host * n_host * s.r[2] / k[2];
    return ray;
  }
  /// Amplitude in the mid plane: flux, and the narrowing of the tube of rays, b db / (rho drho).
  double amplitude(double b) const {
    const double h = 1e-4;
    const Ray here = *trace(b), up = *trace(b + h), down = *trace(b - h);
    return std::sqrt(here.flux * b * 2 * h / (here.image_radius * (up.image_radius - down.image_radius)));
  }
};

}  // namespace birefit::testing
