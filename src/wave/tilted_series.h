#pragma once
// The exact series' image in light of one direction: the picture of a condenser is a sum over such directions.

#include <array>
#include <memory>
#include <vector>

#include "wave/radial_series.h"

namespace birefit {

/// scattering_amplitudes() from 0 to an angle, interpolated to about 1e-9 of their largest value.
template <class S>
class ScatteringTable {
 public:
  ScatteringTable(const RadialSeries<S>& series, double largest_angle_rad);
  /// 0 <= angle, plain(angle) within the table.
  ScatteringAmplitudes<S> operator()(const S& angle_rad) const;

 private:
  static constexpr std::size_t kPoints = 14;
  struct Panel {
    std::array<Complex<S>, kPoints> s1, s2;  ///< by powers of the place in it, -1 to 1
  };
  std::vector<Panel> panels_;
  double per_panel_;
};

/// The transverse field along the image's x axis, for light of unit amplitude that comes from one direction, in the
/// components that `pupil` makes of plane waves (scattered_spectrum()). Shares the table with other directions.
template <class S>
class TiltedRadialImage {
 public:
  /// kappa: transverse wavevector of the light over k0, below n_host; objective_na and the rest as of RadialImage.
  TiltedRadialImage(const RadialSeries<S>& series, const ScatteringTable<S>& amplitudes, const std::array<S, 2>& kappa,
                    const S& objective_na, const S& defocus_um, double x_max_um, Pupil pupil);
  /// Rows: seen x, y; columns: incident x, y; the incident wave included, where the objective collects it.
  /// 0 <= x_um <= x_max_um.
  Mat2<S> operator()(double x_um) const;

 private:
  struct Node {
    S kx_per_um;
    Mat2<S> field;  ///< summed along y
  };
  std::vector<Node> nodes_;
  S incident_kx_per_um_;
  bool collected_;
};

}  // namespace birefit
