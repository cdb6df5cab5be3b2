#include "instrument/spectrum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "instrument/cie_tables.h"

namespace birefit {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// Second radiation constant hc/k of the SI of 2019, um K.
constexpr double kSecondRadiation = 14387.76877;
constexpr double kPlanckUnitUm = 0.56;
/// Wavelengths that any part of a microscope is for, um: the range of light.wavelength_nm.
constexpr double kLeastUm = 0.1, kMostUm = 20;
/// 4 ln 2: exp(-4 ln 2 x^2) is 1/2 at x = 1/2.
constexpr double kHalfMaximum = 2.772588722239781;
/// Widths at half maximum from the centre to where a Gaussian counts as 0: it is 2.5e-16 there.
constexpr double kTailWidths = 3.6;

/// Overloads of lambdas, for std::visit.
template <class... F>
struct Either : F... {
  using F::operator()...;
};
template <class... F>
Either(F...) -> Either<F...>;

double table_at(const SpectralTable& table, double l) {
  const std::vector<double>& x = table.wavelength_um;
  if (!(l >= x.front() && l <= x.back())) return 0;
  const std::size_t i = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(
      std::upper_bound(x.begin(), x.end(), l) - x.begin() - 1, 0, static_cast<std::ptrdiff_t>(x.size()) - 2));
  const double f = (l - x[i]) / (x[i + 1] - x[i]);
  return (1 - f) * table.value[i] + f * table.value[i + 1];
}
/// Distance from the nearest corner outwards in edges: 0 within the flat part, 1 where nothing passes.
double along_edge(const FlatBand& band, double l) {
  return (std::abs(l - band.centre_um) - 0.5 * (band.width_um - band.edge_um)) / band.edge_um;
}
double planck_at(const Planck& body, double l) {
  const double c = kSecondRadiation / body.temperature_k;
  return std::pow(kPlanckUnitUm / l, 5) * std::expm1(c / kPlanckUnitUm) / std::expm1(c / l);
}
/// x/(1 - e^-x): -T dln/dT of 1/(e^x - 1), x = c2/(l T).
double planck_slope(double x) { return x / -std::expm1(-x); }

SpectralTable uniform_table(std::size_t count, double from, double step, const auto& value) {
  SpectralTable table;
  for (std::size_t i = 0; i < count; ++i) {
    // multiples of a nanometre as they are written, whatever the step's rounding
    table.wavelength_um.push_back(std::round((from + static_cast<double>(i) * step) * 1e3) / 1e3);
    table.value.push_back(value(i));
  }
  return table;
}

void check_table(const SpectralTable& table, const Where& where, const std::string& name) {
  const std::vector<double>&x = table.wavelength_um, &y = table.value;
  if (x.size() != y.size())
    throw UserError(where, fmt::format("{} has {} wavelengths and {} values", name, x.size(), y.size()));
  if (x.size() < 2)
    throw UserError(
        where, fmt::format("{} has {} entr{}, at least two are needed", name, x.size(), x.size() == 1 ? "y" : "ies"));
  Problems problems;
  // One complaint of each kind, at its first entry: a wrong unit or column makes all of them wrong.
  const auto first = [&](const auto& wrong) {
    std::size_t i = 0;
    while (i < x.size() && !wrong(i)) ++i;
    return i;
  };
  if (const std::size_t i = first([&](std::size_t k) { return !std::isfinite(x[k]) || !std::isfinite(y[k]); });
      i < x.size()) {
    problems.add(where,
                 fmt::format("{}, entry {}: {} is not a number", name, i + 1, std::isfinite(x[i]) ? y[i] : x[i]));
  } else {
    if (const std::size_t k = first([&](std::size_t j) { return x[j] < kLeastUm || x[j] > kMostUm; }); k < x.size())
      problems.add(
          where,
          fmt::format("{}, entry {}: a wavelength of {} um is outside [{}, {}]", name, k + 1, x[k], kLeastUm, kMostUm),
          x[k] >= 1e3 * kLeastUm && x[k] <= 1e3 * kMostUm
              ? fmt::format("{} looks like nanometres, which would be {} um", x[k], x[k] * 1e-3)
              : std::string());
    if (const std::size_t k = first([&](std::size_t j) { return j > 0 && x[j] <= x[j - 1]; }); k < x.size())
      problems.add(
          where, fmt::format("{}, entry {}: wavelengths must grow, {} um follows {} um", name, k + 1, x[k], x[k - 1]));
    if (const std::size_t k = first([&](std::size_t j) { return y[j] < 0; }); k < x.size())
      problems.add(where, fmt::format("{}, entry {}: {} is negative", name, k + 1, y[k]),
                   "set to 0 what a spectrometer's noise takes below");
    else if (first([&](std::size_t j) { return y[j] > 0; }) == x.size())
      problems.add(where, fmt::format("{} is 0 everywhere", name));
  }
  problems.throw_if_any();
}

}  // namespace

SpectralTable spectral_table(std::vector<double> wavelength_um, std::vector<double> value, const Where& where,
                             const std::string& name) {
  SpectralTable table{std::move(wavelength_um), std::move(value)};
  check_spectrum(table, where, name);
  return table;
}

void check_spectrum(const Spectrum& spectrum, const Where& where, const std::string& name) {
  const auto within = [&](double value, double least, double most, const char* what, const char* unit) {
    if (value >= least && value <= most) return;
    const bool nanometres =
        std::string(unit) == "um" && value >= 1 && value >= 1e3 * least && value > most && value <= 1e3 * most;
    throw UserError(where, fmt::format("{}: {} of {} {} is outside [{}, {}]", name, what, value, unit, least, most),
                    nanometres ? fmt::format("{} looks like nanometres", value) : std::string());
  };
  constexpr double kLeastWidth = 1e-6;  // a picometre
  std::visit(Either{[](const EqualEnergy&) {},
                    [&](const Planck& b) { within(b.temperature_k, 500, 30000, "a temperature", "K"); },
                    [&](const GaussianLine& g) {
                      within(g.centre_um, kLeastUm, kMostUm, "a centre", "um");
                      within(g.fwhm_um, kLeastWidth, g.centre_um, "a full width at half maximum", "um");
                    },
                    [&](const FlatBand& b) {
                      within(b.centre_um, kLeastUm, kMostUm, "a centre", "um");
                      within(b.width_um, kLeastWidth, b.centre_um, "a width", "um");
                      within(b.edge_um, kLeastWidth, b.width_um, "an edge", "um");
                    },
                    [&](const SpectralTable& t) { check_table(t, where, name); }},
             spectrum);
}

Planck illuminant_a() { return {2848 * kSecondRadiation / 14350}; }
const SpectralTable& illuminant_d65() {
  static const SpectralTable table =
      uniform_table(kDaylightCount, kDaylightFromUm, kDaylightStepUm, [](std::size_t i) { return kDaylight[i]; });
  return table;
}
const SpectralTable& colour_matching(int channel) {
  static const auto make = [](std::size_t c) {
    return uniform_table(kMatchingCount, kMatchingFromUm, kMatchingStepUm,
                         [c](std::size_t i) { return kMatching[i][c]; });
  };
  static const std::array<SpectralTable, 3> tables{make(0), make(1), make(2)};
  return tables.at(static_cast<std::size_t>(channel));
}

double value_at(const Spectrum& spectrum, double l) {
  return std::visit(Either{[](const EqualEnergy&) { return 1.0; }, [&](const Planck& b) { return planck_at(b, l); },
                           [&](const GaussianLine& g) {
                             const double x = (l - g.centre_um) / g.fwhm_um;
                             return std::abs(x) > kTailWidths ? 0.0 : std::exp(-kHalfMaximum * x * x);
                           },
                           [&](const FlatBand& b) { return std::clamp(1 - along_edge(b, l), 0.0, 1.0); },
                           [&](const SpectralTable& t) { return table_at(t, l); }},
                    spectrum);
}

std::vector<std::string> numbers_of(const Spectrum& spectrum) {
  using Names = std::vector<std::string>;
  return std::visit(Either{[](const EqualEnergy&) { return Names{}; }, [](const SpectralTable&) { return Names{}; },
                           [](const Planck&) { return Names{"temperature_k"}; },
                           [](const GaussianLine&) {
                             return Names{"centre_um", "fwhm_um"};
                           },
                           [](const FlatBand&) {
                             return Names{"centre_um", "width_um", "edge_um"};
                           }},
                    spectrum);
}

void slopes_at(const Spectrum& spectrum, double l, double* slope) {
  std::visit(Either{[](const EqualEnergy&) {}, [](const SpectralTable&) {},
                    [&](const Planck& b) {
                      const double c = kSecondRadiation / b.temperature_k;
                      slope[0] =
                          planck_at(b, l) * (planck_slope(c / l) - planck_slope(c / kPlanckUnitUm)) / b.temperature_k;
                    },
                    [&](const GaussianLine& g) {
                      const double x = (l - g.centre_um) / g.fwhm_um;
                      slope[0] = value_at(g, l) * 2 * kHalfMaximum * x / g.fwhm_um;
                      slope[1] = x * slope[0];
                    },
                    [&](const FlatBand& b) {
                      const double e = along_edge(b, l);
                      const bool on_edge = e > 0 && e < 1;
                      slope[0] = on_edge ? (l > b.centre_um ? 1 : -1) / b.edge_um : 0;
                      slope[1] = on_edge ? 0.5 / b.edge_um : 0;
                      slope[2] = on_edge ? (e - 0.5) / b.edge_um : 0;
                    }},
             spectrum);
}

std::pair<double, double> range_of(const Spectrum& spectrum) {
  using Range = std::pair<double, double>;
  return std::visit(
      Either{
          [](const EqualEnergy&) {
            return Range{0, kInfinite};
          },
          [](const Planck&) {
            return Range{0, kInfinite};
          },
          [](const GaussianLine& g) {
            return Range{std::max(0.0, g.centre_um - kTailWidths * g.fwhm_um), g.centre_um + kTailWidths * g.fwhm_um};
          },
          [](const FlatBand& b) {
            const double half = 0.5 * (b.width_um + b.edge_um);
            return Range{b.centre_um - half, b.centre_um + half};
          },
          [](const SpectralTable& t) {
            return Range{t.wavelength_um.front(), t.wavelength_um.back()};
          }},
      spectrum);
}

std::vector<double> kinks_of(const Spectrum& spectrum) {
  if (const auto* table = std::get_if<SpectralTable>(&spectrum)) return table->wavelength_um;
  if (const auto* b = std::get_if<FlatBand>(&spectrum)) {
    const double outer = 0.5 * (b->width_um + b->edge_um), inner = 0.5 * (b->width_um - b->edge_um);
    return {b->centre_um - outer, b->centre_um - inner, b->centre_um + inner, b->centre_um + outer};
  }
  return {};
}

double smooth_length(const Spectrum& spectrum) {
  if (const auto* line = std::get_if<GaussianLine>(&spectrum)) return line->fwhm_um / 8;
  if (std::holds_alternative<Planck>(spectrum)) return 0.01;
  return kInfinite;
}

}  // namespace birefit
