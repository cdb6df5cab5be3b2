#pragma once
// Liquid crystals and plates as indices: of no wavelength, by wavelength, by temperature.

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "birefit/number_spec.h"
#include "birefit/parameters.h"

namespace birefit {

/// n_e = n_o + birefringence, neither depends on anything. Ranges: n_o in [1, 4], birefringence in [-1, 1].
struct ConstantIndices {
  ParameterRef ordinary;
  ParameterRef birefringence;
  /// If given, birefringence is that at 589.3 nm and varies as w^2 / (w^2 - resonance^2) with the wavelength w (one
  /// absorption band; Wu, Phys. Rev. A 33, 1270 (1986)); resonance below the wavelength.
  ParameterRef resonance_nm = {};

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("ordinary", self.ordinary, numbers::tabulated_index(), "n_o");
    visit.number("birefringence", self.birefringence, numbers::within(-1, 1).known_within_share(0.01), "n_e - n_o");
    visit.number("resonance_nm", self.resonance_nm, numbers::within(50, 20000, "nm").left_out().known_within(15),
                 "of the absorption band by which the birefringence varies, that given being of 589.3 nm");
  }
};

/// Steinberg TOG 2020 eq. 38, named preset "E44-steinberg2020": n_o = 1.53, n_e = 2.1942 - T / (750 K), 640 nm.
/// Not a physical E44 (docs/methods.md); T in [250, 373] K.
struct E44Steinberg2020 {
  ParameterRef temperature_k;  ///< ignored where the sample has its own temperature profile (heated plate)

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("temperature_k", self.temperature_k, numbers::within(250, 373, "K").known_within(0.2),
                 "of the preset; a sample with a temperature profile has its own");
  }
};

/// The index of one ray against wavelength: a formula of refractiveindex.info by its number there, or a table.
/// Wavelengths in um, vacuum; holds from lower_um to upper_um only (docs/methods.md, "Materials").
struct Dispersion {
  /// Formulas 1 to 9 by their number at refractiveindex.info, and a table, linear in between.
  enum class Form {
    sellmeier = 1,
    sellmeier_2,
    polynomial,
    refractiveindex_info,
    cauchy,
    gases,
    herzberger,
    retro,
    exotic,
    table
  };
  Form form = Form::cauchy;
  std::vector<double> coefficients;          ///< C1, C2, ..; exponents among them
  std::vector<ParameterRef> refs;            ///< empty, or as many: those given stand in for their coefficient
  std::vector<double> wavelength_um, index;  ///< of a table: growing, at least two
  /// Where it holds, vacuum wavelengths in um.
  double lower_um = 0, upper_um = 0;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.list("coefficients", self.refs, numbers::within(-1e4, 1e4).left_out(), "of the formula");
  }
};

/// Both rays against wavelength.
struct DispersiveIndices {
  Dispersion ordinary, extraordinary;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.inside("ordinary", self.ordinary);
    visit.inside("extraordinary", self.extraordinary);
  }
};

/// n_e = A - B T + 2/3 dn0 (1 - T/Tc)^b, n_o = A - B T - 1/3 dn0 (1 - T/Tc)^b (Li, Gauza, Wu 2004). Several sets: their
/// numbers are interpolated in 1/wavelength^2 between the wavelengths they were fitted at.
struct FourParameterIndices {
  /// The numbers of the law at one wavelength.
  struct Set {
    double wavelength_um = 0;       ///< 0: a single set, for the scene's wavelength
    ParameterRef mean_index;        ///< A
    ParameterRef mean_slope_per_k;  ///< B
    ParameterRef birefringence_0k;  ///< dn0, extrapolated to 0 K
    ParameterRef exponent;          ///< b
    ParameterRef clearing_k;        ///< Tc

    template <class Self, class Visit>
    static void describe(Self& self, Visit&& visit) {
      visit.number("mean_index", self.mean_index, numbers::index(), "A of the four-parameter law");
      visit.number("mean_slope_per_k", self.mean_slope_per_k, numbers::within(-0.1, 0.1).or_else(0), "B");
      visit.number("birefringence_0k", self.birefringence_0k, numbers::within(-2, 2), "extrapolated to 0 K");
      visit.number("exponent", self.exponent, numbers::within(0, 2), "b");
      visit.number("clearing_k", self.clearing_k, numbers::within(100, 2000, "K"), "clearing point");
    }
  };
  std::vector<Set> sets;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.inside("four_parameter", self.sets);
  }
};

/// Haller's law on indices known at one temperature: n_e - n_o is multiplied by ((1 - T/Tc)/(1 - T_ref/Tc))^exponent,
/// the mean (n_e + 2 n_o)/3 falls by mean_slope_per_k (T - T_ref). Both temperatures below the clearing point Tc.
struct HallerLaw {
  ParameterRef reference_k, clearing_k, exponent, mean_slope_per_k;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("reference_k", self.reference_k, numbers::within(100, 2000, "K"), "where the indices hold");
    visit.number("clearing_k", self.clearing_k, numbers::within(100, 2000, "K"), "clearing point");
    visit.number("exponent", self.exponent, numbers::within(0, 2), "of (1 - T / clearing point)");
    visit.number("mean_slope_per_k", self.mean_slope_per_k, numbers::within(-0.1, 0.1).or_else(0),
                 "by which the mean index falls");
  }
};

/// A material from the literature or a file: indices by wavelength, perhaps by temperature.
struct LawIndices {
  std::variant<ConstantIndices, DispersiveIndices, FourParameterIndices> indices;
  std::optional<HallerLaw> haller;    ///< of the first two
  ParameterRef temperature_k;         ///< where a temperature law needs one; ignored by a sample with its own profile
  ParameterRef birefringence_factor;  ///< n_e - n_o times this; not given: 1
  double lower_k = 0, upper_k = 0;    ///< where the temperature law holds; 0, 0: anywhere below the clearing point
  /// standard deviation of n_e - n_o over itself, 0 = not stated: enters the model error
  double birefringence_uncertainty = 0;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.inside("indices", self.indices);
    visit.inside("haller", self.haller);
    visit.number("temperature_k", self.temperature_k, numbers::within(100, 2000, "K").known_within(0.2).left_out(),
                 "where a law of temperature needs it");
    visit.number("birefringence_factor", self.birefringence_factor, numbers::within(0, 10).left_out(),
                 "n_e - n_o times this");
  }
};

/// Form birefringence: parts far smaller than a wavelength, isotropic in themselves, in a medium of another index. The
/// axis is the layers' normal, or along the rods. Layers: n_o^2 = f n1^2 + (1 - f) n2^2, 1/n_e^2 = f/n1^2 +
/// (1 - f)/n2^2; rods of round section: n_e^2 = f n1^2 + (1 - f) n2^2, n_o^2 = n2^2 ((1 + f) n1^2 + (1 - f) n2^2) /
/// ((1 - f) n1^2 + (1 + f) n2^2). Wiener (1912), in Born & Wolf, Principles of Optics, 15.5.2.
struct FormIndices {
  /// What the parts are.
  enum class Structure { layers, rods };
  Structure structure = Structure::layers;
  ParameterRef fraction, inside, between;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("fraction", self.fraction, numbers::within(0, 1), "f, of the volume, that the parts take up");
    visit.number("inside", self.inside, numbers::tabulated_index(), "n1, index of the layers or rods");
    visit.number("between", self.between, numbers::tabulated_index(), "n2, index of what is between them");
  }
};

/// What the anisotropic part of a sample is made of.
using Material = std::variant<ConstantIndices, E44Steinberg2020, LawIndices, FormIndices>;

}  // namespace birefit
