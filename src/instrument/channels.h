#pragma once
// What the channels of a camera record of an intensity that varies with the wavelength:
//
//     X_c = integral of w_c(l) I(l) dl,   w_c = lamp x filters x sensitivity, scaled so that I = 1 gives X_c = 1,
//
// as sums over wavelengths. Lamp and camera enter nowhere but by these weights. docs/methods.md, "Spectrum".

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "instrument/spectrum.h"

namespace birefit {

/// X_c = sum over k of weight[c][k] I(wavelength_um[k]) for every channel, and its derivatives by the numbers of lamp
/// and filters.
struct SpectralSum {
  std::vector<double> wavelength_um;                    ///< vacuum, growing
  std::vector<std::vector<double>> weight;              ///< [channel][wavelength]; of each channel they sum to 1
  std::vector<std::vector<std::vector<double>>> slope;  ///< [number][channel][wavelength]; they sum to 0

  std::size_t size() const { return wavelength_um.size(); }
  std::size_t channels() const { return weight.size(); }
  /// Of an intensity given by wavelength in um: a number a channel.
  std::vector<double> of(const std::function<double(double)>& intensity) const;
};

/// A lamp, the filters before and behind the sample, and the channels' sensitivities.
class Channels {
 public:
  /// Sensitivities are 0 outside of their tables, lamps and filters are not known there. UserError where one of the
  /// spectra is not one (check_spectrum), where nothing is left of a channel, and where more than `kUncovered` of what
  /// a channel would record lies outside of the lamp's or a filter's table.
  Channels(Spectrum lamp, std::vector<Spectrum> filters, std::vector<Spectrum> sensitivities, const Where& where = {});
  static constexpr double kUncovered = 1e-4;

  int count() const { return static_cast<int>(sensitivities_.size()); }
  /// What slopes are by: the numbers of the lamp, then of each filter, as "lamp.temperature_k", "filter1.centre_um".
  const std::vector<std::string>& numbers() const { return numbers_; }
  /// Outside of it no channel records anything, um.
  std::pair<double, double> range() const { return range_; }
  /// What each channel records without a sample, before weights are scaled: of the CIE's observer the lamp's white
  /// up to a factor.
  const std::vector<double>& white() const { return white_; }

  /// Four Gauss points within each piece between kinks of any of the spectra, pieces of a nanometre at most and shorter
  /// where the phase 2 pi G t of retardances up to |G| = reach_um asks for it: within 1e-9 for dispersions as strong as
  /// a nematic's. With the CIE's observer 1,880 wavelengths for 20 um and less.
  SpectralSum fine(double reach_um = 20) const;
  /// The middles of n equal intervals of 1/wavelength over the range, weights scaled anew: errs by the channels'
  /// coherence at path differences of n/(width of the range in 1/wavelength) less that of the intensity.
  SpectralSum uniform(int n) const;

 private:
  /// Weights at a wavelength, not scaled, times `share`, and their derivatives, as the last wavelength of the sum.
  void add(double wavelength_um, double share, SpectralSum& sum) const;
  /// Weights to a sum of 1, slopes with them.
  static void scale(SpectralSum& sum);
  /// fine() before it is scaled.
  SpectralSum integral(double reach_um) const;
  /// Finds the range, too.
  void check_cover(const Where&);

  std::vector<Spectrum> light_;  // lamp, then filters
  std::vector<Spectrum> sensitivities_;
  std::vector<std::string> numbers_;
  std::vector<std::size_t> first_;  // of numbers_, each part of the light's, and the end
  std::pair<double, double> range_;
  std::vector<double> white_;
};

/// The Gauss rule of n nodes, in 1/wavelength, of the sum of all channels, by Lanczos' recurrence from a finer sum;
/// each channel's weights integrate the polynomial through its intensities at the nodes, so that white stays 1 (and
/// slopes of it 0) to rounding. Weights may be negative. n of at least 1, at most a quarter of the finer sum's
/// wavelengths.
SpectralSum gauss_sum(const SpectralSum& fine, int n);

/// Cycles of phase per um of retardance over the middle of the spectrum that all channels together record (all but a
/// thousandth at either end), t = D(l)/l at the sum's wavelengths: what the counts of nodes below go by. Under E the
/// CIE's observer has 1.03 times the difference of t between 400 and 700 nm.
double cycles_per_um(const SpectralSum&, const std::vector<double>& t);
/// Nodes of gauss_sum for an intensity with so many cycles (retardance times cycles_per_um), to hold an error of the
/// intensity in [1e-6, 1e-3] of white: 7 + 3.8 cycles for 1e-3, 12 + 4.3 for 1e-4, and on in proportion to the
/// logarithm; less for each cycle above 14. Measured on twisted cells, the CIE's observer and a camera, up to 30
/// cycles.
int gauss_nodes(double cycles, double error);
/// Nodes of gauss_sum for 1e-4 with a Gaussian line as lamp or filter, by the standard deviation of the phase over the
/// line (rad), up to 6. More where the line's foot reaches an absorption.
int line_nodes(double phase_deviation);
/// Wavelengths of Channels::uniform for 1e-3, 42 + 1.6 cycles: fewer than gauss_nodes above 20 cycles. Spectra as
/// smooth as the CIE's observer under E are done with 20 + 1.9 cycles, fewer than gauss_nodes above 7. Errors do not
/// fall steadily where tables have kinks: ask `difference`.
int uniform_nodes(double cycles);
/// Largest difference between two sums in any channel: of n Gauss nodes and n + 3, the error of the former within a
/// factor of three.
double difference(const SpectralSum&, const SpectralSum&, const std::function<double(double)>& intensity);

}  // namespace birefit
