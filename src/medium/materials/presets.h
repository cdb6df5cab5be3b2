#pragma once
// Materials typed from published coefficients, each with its source and an honest uncertainty.

#include <array>
#include <span>
#include <string>
#include <vector>

namespace birefit {

struct MaterialPreset {
  std::string name;           ///< of configs: "5CB-li2005"
  std::string source;         ///< for reports
  double lower_nm, upper_nm;  ///< wavelengths the source covers
  /// Cauchy coefficients A, B, C of n = A + B/l^2 + C/l^4, l in um, at temperature_k; unused with four_parameter.
  std::array<double, 3> ordinary{}, extraordinary{};
  double temperature_k = 0;
  struct FourParameter {
    double wavelength_um, mean_index, mean_slope_per_k, birefringence_0k, exponent, clearing_k;
  };
  std::vector<FourParameter> four_parameter;
  double lower_k = 0, upper_k = 0;   ///< of the four-parameter law
  double birefringence_uncertainty;  ///< standard deviation of n_e - n_o over itself
};

/// All presets but E44-steinberg2020, which is a law of its own (materials/heat.h).
std::span<const MaterialPreset> material_presets();
/// The preset of that name; a bare "5CB", "E7" or "E44" is the one of Li 2005. nullptr when there is none.
const MaterialPreset* find_material_preset(const std::string& name);

}  // namespace birefit
