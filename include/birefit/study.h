#pragma once
// How fast and how accurate every transport method is, measured on fixed rays and frames: the charts of
// docs/methods.md.

#include <functional>
#include <string>
#include <vector>

namespace birefit {

/// One method at one effort on one ray. Errors are against a reference that two methods of different order agree on
/// (ChartScene::reference_agreement); not a number where a method does not offer the quantity.
struct ChartPoint {
  std::string scene, method;
  /// "n=64" steps, panels or layers (" order=3": series shorter or longer than the usual 7); "tol=1e-6" of an adaptive
  /// solver
  std::string effort;
  double seconds = 0;           ///< one ray in plain doubles
  double seconds_in_lanes = 0;  ///< one ray of a full pack of them
  double samples = 0;           ///< of the medium, per ray
  double jones_error = 0;       ///< |T - T_ref| / |T_ref|, Frobenius
  /// largest change of |q T p|^2 over 91 angles p of the polarizer, q crossed, unit field in
  double intensity_error = 0;
  /// the same as jones_error, of dT / d n_e; by differences of fourth order where a method has no derivatives
  double gradient_error = 0;
};

/// A scene of the chart: one ray of it, and how well its reference is known.
struct ChartScene {
  std::string name, what;
  double reference_agreement = 0;  ///< of two methods of different order, relative, Frobenius
  double phase_rad = 0;            ///< retardance along the ray, between its two modes
  /// Largest intensity error (as above, faces included, host on both sides) of a physics against all reflections.
  double e_only_error = 0, one_way_error = 0;
};

/// A whole 500 x 500 frame as the planner would compute it for an asked accuracy; errors against accuracy 1e-10.
struct ChartFrame {
  std::string scene, method;
  double asked = 0, seconds = 0, worst_error = 0, rms_error = 0;  ///< against pixels nine times finer
  int worst_column = 0, worst_row = 0;                            ///< the worst pixel
};

/// What measure_chart() measured.
struct MethodChart {
  std::vector<ChartScene> scenes;
  std::vector<ChartPoint> points;
  std::vector<ChartFrame> frames;
};

/// A picture of a radial droplet, 128 x 128 pixels over diameter + 4 um, 590 nm, crossed polarizers at 45 degrees, by
/// one model; the error is the RMS of the difference from the exact series over the RMS of that.
struct WavePoint {
  std::string sample;  ///< "dn 0.22 in 1.43"
  double radius_um = 0, objective_na = 0;
  std::string model;   ///< straight, eikonal, split_step, march; series with error 0
  std::string effort;  ///< "" as planned, else what was changed
  double seconds = 0, error = 0;
  double estimate = 0;  ///< what the planner says of it; not a number where it says nothing
};
/// Every model on a list of droplets; `quick` and `say` as of measure_chart().
std::vector<WavePoint> measure_waves(bool quick, const std::function<void(const std::string&)>& say = {});

/// `quick`: fewer efforts and no frames (seconds instead of a minute). `say` is told what is being measured.
MethodChart measure_chart(bool quick, const std::function<void(const std::string&)>& say = {});

/// A picture in white light (illuminant E, the CIE's observer of 1931) by one way to sum over the wavelengths; errors
/// are the worst of all pixels and of X, Y and Z, as fractions of white, against as many wavelengths as spectra and
/// fringes have detail. Of "echoes ..": a line of light through a layer, by [S4]'s M double reflections.
struct SpectrumPoint {
  std::string scene;
  std::string rule;     ///< "Gauss", "even in 1/wavelength", "even in wavelength", "planned", "closed form", "M"
  std::string effort;   ///< "n=12" wavelengths, "20 nm" apart, "1e-4" asked for, "M=1"
  int wavelengths = 0;  ///< 0: of a closed form
  double seconds = 0;   ///< a pixel, all three colours
  double error = 0, delta_e = 0;  ///< delta_e: CIEDE2000 against E's white, of the pixel where it is largest
};
/// Every rule on a plate, two twisted cells and a droplet, and the echoes; arguments as of measure_chart().
std::vector<SpectrumPoint> measure_spectra(bool quick, const std::function<void(const std::string&)>& say = {});

/// One method asked for 1e-6 (wei_norman: 1e-3) at one place of a sweep into a trap; in the sweeps of polarizers a
/// planned picture asked for 1e-4, in those that begin with "light_" one in light that is no line; in the sweeps that
/// begin with "wave_" the picture of a sphere by wave optics.
struct StressPoint {
  std::string sweep;
  double value = 0;
  std::string method;
  /// Relative, Frobenius (pictures: worst pixel, infinite where negative; propagation and march: RMS over that of the
  /// picture); not a number where flagged or where the truth itself is not known.
  double error = 0;
  double estimate = 0;  ///< what the method says of its error; infinite where flagged
  double samples = 0;   ///< of the medium (series: panels of its table, propagation: points of all slabs)
  std::string flag;     ///< why its answer must not be used; empty = it stands by the estimate
};
/// The law: error <= estimate, or flagged; never not a number, never unbounded work (tests/laws/stress_test.cc).
std::vector<StressPoint> measure_stress(bool quick, const std::function<void(const std::string&)>& say = {});

}  // namespace birefit
