#include "wave/march.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "core/threads.h"

namespace birefit {
namespace {

using Number = std::complex<double>;

/// The generator's coefficients at the points of the box: eps_tt - g g/eps_zz (xx, yy, xy), g/eps_zz (x, y) and
/// 1/eps_zz.
struct Coefficients {
  std::vector<std::array<double, 6>> at;
  double index = 0;  ///< no mode has |q| above it: sqrt of the largest eigenvalue of eps, or more
};

/// sqrt of a bound of the largest eigenvalue (Gershgorin) of the medium with these coefficients. Throws unless eps -
/// cut is positive definite, by its leading minors. That suffices for real q: the flux form's matrix ((0, 1), (1, 0)) A
/// is then positive definite, being the least over Ez of E*.eps E - |kappa Ez|^2 - |kp.e|^2 + |h + kappa Ez|^2, with
/// |kappa|^2 < cut.
double checked_index(const std::array<double, 6>& c, double cut) {
  const double zz = 1 / c[5], xz = c[3] * zz, yz = c[4] * zz, xx = c[0] + xz * c[3], yy = c[1] + yz * c[4],
               xy = c[2] + xz * c[4];
  const double x = xx - cut, y = yy - cut, z = zz - cut;
  if (!(x > 0 && x * y > xy * xy && x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz) > 0))
    throw std::domain_error("march: eps is not above (limit n_host)^2 everywhere; lower the limit");
  return std::sqrt(
      std::max({xx + std::abs(xy) + std::abs(xz), yy + std::abs(xy) + std::abs(yz), zz + std::abs(xz) + std::abs(yz)}));
}

/// The two halves of a slab whose exponentials, one after the other, are right to the fourth order of its thickness:
/// means of the generator with weights 1 -+ 4 u, u = -1/2..1/2 the depth (S. Blanes, P. C. Moan, Appl. Numer. Math. 56,
/// 1519 (2006), their CF4:2). One mean for the whole slab would be of second order, and needs four times the slabs for
/// 3 % where the director twists.
std::array<Coefficients, 2> halves(const MarchGrid& grid, int slab, double limit, const DielectricAt& dielectric,
                                   int threads) {
  const double thickness = (grid.z1_um - grid.z0_um) / grid.slabs, gauss = std::sqrt(1.0 / 12);
  const std::size_t width = static_cast<std::size_t>(grid.nx), rows = static_cast<std::size_t>(grid.ny);
  std::array<Coefficients, 2> half;
  for (Coefficients& c : half) c.at.resize(width * rows);
  std::vector<std::array<double, 2>> index(rows, {0, 0});
  parallel_for(grid.ny, threads, [&](int j) {
    const double y = grid.ny == 1 ? 0 : (j + 0.5 - 0.5 * grid.ny) * grid.box_y_um / grid.ny;
    const std::size_t row = static_cast<std::size_t>(j);
    for (int i = 0; i < grid.nx; ++i) {
      const double x = (i + 0.5 - 0.5 * grid.nx) * grid.box_x_um / grid.nx;
      const std::size_t here = row * width + static_cast<std::size_t>(i);
      for (int sample = 0; sample < 2 * grid.subslices; ++sample) {
        const double u = (sample / 2 + 0.5 + (sample % 2 == 0 ? -gauss : gauss)) / grid.subslices - 0.5;
        const auto [xx, yy, zz, xy, xz, yz] = dielectric(x, y, grid.z0_um + thickness * (slab + 0.5 + u));
        const std::array<double, 6> values{xx - xz * xz / zz, yy - yz * yz / zz, xy - xz * yz / zz,
                                           xz / zz,           yz / zz,           1 / zz};
        for (std::size_t h = 0; h < 2; ++h)
          for (std::size_t k = 0; k < 6; ++k)
            half[h].at[here][k] += (1 + (h == 0 ? -4 : 4) * u) / (2 * grid.subslices) * values[k];
      }
      for (std::size_t h = 0; h < 2; ++h)
        index[row][h] = std::max(index[row][h], checked_index(half[h].at[here], limit * limit));
    }
  });
  for (const auto& row : index)
    for (std::size_t h = 0; h < 2; ++h) half[h].index = std::max(half[h].index, row[h]);
  return half;
}

/// One wave's field, by its spectrum inside the limit: ex, ey, hx, hy, one block after the other. Wavevectors are those
/// of the box plus the incident wave's (Bloch), so a tilted wave is the constant.
class Field {
 public:
  Field(const MarchGrid& grid, const Fft2& fft, double k0, double n_host, const MarchWave& wave)
      : fft_(fft), k0_(k0), n_host_(n_host), limit_(grid.limit * n_host), wave_(wave) {
    for (int j = 0; j < grid.ny; ++j)
      for (int i = 0; i < grid.nx; ++i) {
        const auto frequency = [](int m, int n) { return m < (n + 1) / 2 ? m : m - n; };
        const int mx = frequency(i, grid.nx), my = frequency(j, grid.ny);
        const double step = 2 * std::numbers::pi / k0;
        const double kx = wave.kappa[0] + mx * step / grid.box_x_um,
                     ky = wave.kappa[1] + (my == 0 ? 0 : my * step / grid.box_y_um);
        // The middle frequency of an even size stands for both signs and is not kept.
        if (kx * kx + ky * ky >= limit_ * limit_ || 2 * mx == -grid.nx || 2 * my == -grid.ny) continue;
        index_.push_back(static_cast<std::size_t>(j) * static_cast<std::size_t>(grid.nx) + static_cast<std::size_t>(i));
        kappa_.push_back({kx, ky});
      }
    if (index_.empty() || index_[0] != 0) throw std::domain_error("march: the incident wave is outside the limit");
    // h of a forward wave of the host: q h = n^2 e - kp (kp.e).
    const auto [kx, ky] = wave.kappa;
    const Number curl = ky * wave.e[0] - kx * wave.e[1];
    const Number phase = incident_phase(grid.z0_um);
    state_.assign(4 * count(), 0);
    state_[0] = phase * wave.e[0];
    state_[count()] = phase * wave.e[1];
    state_[2 * count()] = phase * (n_host * n_host * wave.e[0] - ky * curl) / q(0);
    state_[3 * count()] = phase * (n_host * n_host * wave.e[1] + kx * curl) / q(0);
    for (Plane& plane : planes_) plane.resize(fft_.size());
  }

  /// The field behind a layer of this medium: exp(i k0 h A) = sum_m (2 - delta_m0) i^m J_m(tau) T_m(A / index), tau =
  /// k0 h index.
  void advance(const Coefficients& medium, double thickness_um) {
    const double tau = k0_ * thickness_um * medium.index;
    Plane before = state_, now(state_.size()), next(state_.size());
    const auto add = [&](int m, const Plane& term) {
      constexpr Number turn[4] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
      const double bessel = std::cyl_bessel_j(static_cast<double>(m), tau);
      const Number weight = (m == 0 ? 1.0 : 2.0) * bessel * turn[m % 4];
      for (std::size_t i = 0; i < state_.size(); ++i)
        state_[i] = m == 0 ? weight * term[i] : state_[i] + weight * term[i];
      // Beyond m = tau the terms fall faster than any power.
      return m < tau || std::abs(bessel) > 1e-13;
    };
    apply(medium, before, now);
    add(0, before);
    for (Number& x : now) x /= medium.index;
    for (int m = 1; add(m, now); ++m) {
      apply(medium, now, next);
      for (std::size_t i = 0; i < next.size(); ++i) next[i] = 2 / medium.index * next[i] - before[i];
      before.swap(now);
      now.swap(next);
    }
  }

  double flux() const {
    double sum = 0;
    for (std::size_t i = 0; i < 2 * count(); ++i) sum += std::real(std::conj(state_[i]) * state_[i + 2 * count()]);
    return sum;
  }

  /// e+ = (e + Y^-1 h)/2, the forward waves of the host (h = +-Y e, Y^-1 = (1 - kappa kappa / n^2)/q), less the
  /// incident one.
  void exit(double z_um, MarchedField& out) {
    const std::size_t n = count();
    out.ex.assign(fft_.size(), 0);
    out.ey.assign(fft_.size(), 0);
    for (std::size_t i = 0; i < n; ++i) {
      const auto [kx, ky] = kappa_[i];
      const Number hx = state_[2 * n + i], hy = state_[3 * n + i],
                   divergence = (kx * hx + ky * hy) / (n_host_ * n_host_);
      out.ex[index_[i]] = 0.5 * (state_[i] + (hx - kx * divergence) / q(i));
      out.ey[index_[i]] = 0.5 * (state_[n + i] + (hy - ky * divergence) / q(i));
    }
    out.ex[0] -= incident_phase(z_um) * wave_.e[0];
    out.ey[0] -= incident_phase(z_um) * wave_.e[1];
    fft_.inverse(out.ex);
    fft_.inverse(out.ey);
  }

 private:
  std::size_t count() const { return index_.size(); }
  double q(std::size_t i) const {
    return std::sqrt(n_host_ * n_host_ - kappa_[i][0] * kappa_[i][0] - kappa_[i][1] * kappa_[i][1]);
  }
  Number incident_phase(double z_um) const { return std::polar(1.0, k0_ * q(0) * z_um); }

  /// out = A in, d/dz = i k0 A: the equations of the header. kappa acts on spectra, the medium at points.
  void apply(const Coefficients& medium, const Plane& in, Plane& out) {
    const std::size_t n = count();
    auto& [ex, ey, divergence] = planes_;
    for (Plane& plane : planes_) std::fill(plane.begin(), plane.end(), 0);
    for (std::size_t i = 0; i < n; ++i) {
      ex[index_[i]] = in[i];
      ey[index_[i]] = in[n + i];
      divergence[index_[i]] = kappa_[i][0] * in[2 * n + i] + kappa_[i][1] * in[3 * n + i];
    }
    for (Plane& plane : planes_) fft_.inverse(plane);
    const double scale = 1.0 / static_cast<double>(fft_.size());
    for (std::size_t p = 0; p < fft_.size(); ++p) {
      const auto [xx, yy, xy, vx, vy, eta] = medium.at[p];
      const Number a = scale * ex[p], b = scale * ey[p], c = scale * divergence[p];
      ex[p] = xx * a + xy * b - vx * c;              // Dx
      ey[p] = xy * a + yy * b - vy * c;              // Dy
      divergence[p] = -(vx * a + vy * b + eta * c);  // Ez
    }
    for (Plane& plane : planes_) fft_.forward(plane);
    const Plane& ez = divergence;
    for (std::size_t i = 0; i < n; ++i) {
      const auto [kx, ky] = kappa_[i];
      const std::size_t p = index_[i];
      const Number curl = ky * in[i] - kx * in[n + i];
      out[i] = in[2 * n + i] + kx * ez[p];
      out[n + i] = in[3 * n + i] + ky * ez[p];
      out[2 * n + i] = ex[p] - ky * curl;
      out[3 * n + i] = ey[p] + kx * curl;
    }
  }

  const Fft2& fft_;
  double k0_, n_host_, limit_;
  MarchWave wave_;
  std::vector<std::size_t> index_;            ///< of the frequencies kept, in a plane
  std::vector<std::array<double, 2>> kappa_;  ///< of the same
  Plane state_;
  std::array<Plane, 3> planes_;
};

}  // namespace

std::vector<MarchedField> march(const MarchGrid& grid, double k0_per_um, double n_host, const DielectricAt& dielectric,
                                const std::vector<MarchWave>& waves, int threads) {
  const Fft2 fft(grid.nx, grid.ny);
  std::vector<Field> fields;
  fields.reserve(waves.size());
  for (const MarchWave& wave : waves) fields.emplace_back(grid, fft, k0_per_um, n_host, wave);
  std::vector<MarchedField> out(waves.size());
  const int n = static_cast<int>(waves.size());
  for (std::size_t w = 0; w < waves.size(); ++w) out[w].flux_in = fields[w].flux();
  for (int slab = 0; slab < grid.slabs; ++slab) {
    const auto medium = halves(grid, slab, grid.limit * n_host, dielectric, threads);
    parallel_for(n, threads, [&](int w) {
      for (const Coefficients& half : medium)
        fields[static_cast<std::size_t>(w)].advance(half, 0.5 * (grid.z1_um - grid.z0_um) / grid.slabs);
    });
  }
  for (std::size_t w = 0; w < waves.size(); ++w) {
    out[w].flux_out = fields[w].flux();
    fields[w].exit(grid.z1_um, out[w]);
  }
  return out;
}

}  // namespace birefit
