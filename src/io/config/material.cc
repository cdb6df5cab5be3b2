#include "io/config/material.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "io/config/described.h"
#include "io/config/material_file.h"
#include "medium/indices.h"
#include "medium/materials/presets.h"
#include "medium/validity.h"
#include "samples/kind.h"

namespace birefit {
namespace {

/// Indices given for a temperature serve for one that differs by no more: n_e - n_o changes by about 1 % then.
constexpr double kTemperatureMargin_k = 1.01;
/// Absorption of less than this per um goes without saying.
constexpr double kFaintAbsorption_per_um = 1e-3;

const std::vector<std::string> kRayKeys = {"file", "cauchy", "sellmeier", "range_nm"};

bool is_ray_block(const YamlNode* node) {
  return node && node->is_map() &&
         std::any_of(kRayKeys.begin(), kRayKeys.end(), [&](const auto& key) { return node->find(key); });
}

/// A constant of the program's own: a parameter that the config cannot name.
ParameterRef hidden(ConfigReader& reader, const std::string& path, double value) {
  const ParameterRef ref = reader.constant(path, {}, value);
  reader.specs.erase(path);
  return ref;
}

struct RayIndices {
  Dispersion law;
  std::optional<double> temperature_k;
};

/// Reads a file once for all rays that name it; absorption is left out and said so when the wavelength is known.
RayIndices read_file(ConfigReader& reader, const Block& block) {
  RayIndices ray;
  const std::optional<std::string> name = reader.text(block, "file");
  if (!name) return ray;
  try {
    const MaterialFile file = load_material_file(reader.resolve(*name), block.find("file")->where);
    ray.law = file.law;
    ray.temperature_k = file.temperature_k;
    double most = 0;
    for (std::size_t i = 0; i < file.k.size(); ++i)
      if (file.k_wavelength_um[i] >= ray.law.lower_um && file.k_wavelength_um[i] <= ray.law.upper_um)
        most = std::max(most, 4 * std::numbers::pi * file.k[i] / file.k_wavelength_um[i]);
    if (most > kFaintAbsorption_per_um)
      reader.warnings.push_back(*name + " has absorption, up to " + show(most) + " per um of path: it is left out.");
  } catch (const UserError& error) {
    reader.problems.add(error);
  }
  return ray;
}

/// `cauchy: [A, B, C]` or `sellmeier: [[B1, C1], ..]`; every coefficient may be fitted.
RayIndices read_ray(ConfigReader& reader, const Block& parent, const std::string& key) {
  const Block block = reader.block(parent, key, kRayKeys, true);
  if (!block.node) return {};
  const YamlNode *file = block.find("file"), *cauchy = block.find("cauchy"), *sellmeier = block.find("sellmeier");
  if ((file != nullptr) + (cauchy != nullptr) + (sellmeier != nullptr) != 1) {
    reader.problems.add(block.where, block.path + " must have exactly one of file, cauchy and sellmeier");
    return {};
  }
  const YamlNode* range = block.find("range_nm");
  if (file) {
    if (range) reader.problems.add(range->where, "range_nm is given beside a file, which has its own", "leave it out");
    return read_file(reader, block);
  }
  RayIndices ray;
  const NumberSpec limit = numbers::within(100, 100000, "nm");
  if (!range) {
    reader.missing(block, "range_nm",
                   "[low, high], the wavelengths the coefficients hold for: nothing is extrapolated");
  } else if (!range->is_sequence() || range->items.size() != 2) {
    reader.problems.add(range->where, "range_nm must be [low, high], found " + range->describe());
  } else {
    const auto low = reader.value_of(range->items[0], "range_nm", limit),
               high = reader.value_of(range->items[1], "range_nm", limit);
    if (low && high && *low >= *high) reader.problems.add(range->where, "range_nm must grow: [low, high]");
    ray.law.lower_um = low.value_or(100) / 1000;
    ray.law.upper_um = high.value_or(100000) / 1000;
  }
  const auto coefficient = [&](const YamlNode& node, const std::string& path) {
    ray.law.refs.push_back(reader.number_at(node, path, numbers::within(-1e4, 1e4)));
    ray.law.coefficients.push_back(reader.table[ray.law.refs.back()].value);
  };
  const auto constant = [&](double value) {
    ray.law.refs.push_back({});
    ray.law.coefficients.push_back(value);
  };
  if (cauchy) {
    ray.law.form = Dispersion::Form::cauchy;
    if (!cauchy->is_sequence() || cauchy->items.empty() || cauchy->items.size() > 6) {
      reader.problems.add(cauchy->where, "cauchy must be [A, B, C], of n = A + B/l^2 + C/l^4 with l in um, found " +
                                             (cauchy->is_sequence() ? std::to_string(cauchy->items.size()) + " items"
                                                                    : cauchy->describe()));
      return ray;
    }
    for (std::size_t i = 0; i < cauchy->items.size(); ++i) {
      coefficient(cauchy->items[i], block.path_of("cauchy") + "[" + std::to_string(i + 1) + "]");
      if (i > 0) constant(-2.0 * static_cast<double>(i));
    }
    return ray;
  }
  ray.law.form = Dispersion::Form::sellmeier_2;
  constant(0);
  if (!sellmeier->is_sequence() || sellmeier->items.empty() || sellmeier->items.size() > 8) {
    reader.problems.add(
        sellmeier->where,
        "sellmeier must be [[B1, C1], [B2, C2], ..], of n^2 = 1 + sum B l^2/(l^2 - C) with l in um, found " +
            sellmeier->describe());
    return ray;
  }
  for (std::size_t i = 0; i < sellmeier->items.size(); ++i) {
    const YamlNode& pair = sellmeier->items[i];
    if (!pair.is_sequence() || pair.items.size() != 2) {
      reader.problems.add(pair.where, "a term of sellmeier must be [B, C], found " + pair.describe());
      continue;
    }
    const std::string path = block.path_of("sellmeier") + "[" + std::to_string(i + 1) + "]";
    coefficient(pair.items[0], path + "[1]");
    coefficient(pair.items[1], path + "[2]");
  }
  return ray;
}

void only_one(ConfigReader& reader, const Block& block, const std::string& chosen,
              const std::vector<std::string>& others) {
  for (const std::string& other : others)
    if (const YamlNode* node = block.find(other))
      reader.problems.add(node->where, other + " is given beside " + chosen, "give one of the two");
}

FourParameterIndices read_four_parameter(ConfigReader& reader, const Block& material) {
  using Set = FourParameterIndices::Set;
  const Block block = reader.block(material, "four_parameter", described_keys<Set>(), true);
  Set set;
  read_numbers(reader, block, set);
  return {{set}};
}

HallerLaw read_haller(ConfigReader& reader, const Block& material, std::optional<double> reference_k) {
  const Block block = reader.block(material, "haller", described_keys<HallerLaw>(), true);
  HallerLaw law;
  if (!reference_k && block.node && !block.find("reference_k"))
    reader.missing(block, "reference_k", "the temperature at which the indices hold");
  law.reference_k =
      reader.number(block, "reference_k", described<HallerLaw>("reference_k"), reference_k.value_or(298.15));
  for (const auto& [key, ref] : {std::pair("clearing_k", &law.clearing_k), std::pair("exponent", &law.exponent),
                                 std::pair("mean_slope_per_k", &law.mean_slope_per_k)})
    *ref = read_described<HallerLaw>(reader, block, key);
  return law;
}

/// Value and bounds of a parameter, the known ones of them.
std::vector<double> extremes(const ConfigReader& reader, ParameterRef ref) {
  const auto [low, high] = reader.span_of(ref);
  std::vector<double> values{reader.table[ref].value, low, high};
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  return values;
}

}  // namespace

const std::vector<std::string>& law_material_keys() {
  static const std::vector<std::string> keys = {"extraordinary", "file", "haller", "four_parameter",
                                                "birefringence_factor"};
  return keys;
}

const std::vector<std::string>& form_material_keys() {
  static const std::vector<std::string> keys = [] {
    std::vector<std::string> all = described_keys<FormIndices>();
    all.insert(all.begin(), "structure");
    return all;
  }();
  return keys;
}

Material read_form_material(ConfigReader& reader, const Block& block) {
  const auto& own = form_material_keys();
  for (const YamlEntry& entry : block.node->entries)
    if (std::find(own.begin(), own.end(), entry.key) == own.end() && entry.key != "absorption")
      reader.problems.add(entry.where, entry.key + " is given beside structure",
                          "form birefringence follows from fraction, inside and between alone");
  FormIndices form;
  if (reader.choice(block, "structure", {"layers", "rods"}).value_or("") == "rods")
    form.structure = FormIndices::Structure::rods;
  read_numbers(reader, block, form);
  return form;
}

bool is_law_material(const Block& material) {
  const auto& keys = law_material_keys();
  const YamlNode* name = material.find("name");
  return std::any_of(keys.begin(), keys.end(), [&](const auto& key) { return material.find(key); }) ||
         is_ray_block(material.find("ordinary")) || (name && (!name->is_scalar() || name->text != "E44-steinberg2020"));
}

Material read_law_material(ConfigReader& reader, const Block& block, const Sample& sample) {
  LawIndices law;
  std::optional<double> known_at_k;
  const MaterialPreset* preset = nullptr;
  const Plate* plate = std::get_if<Plate>(&sample);
  const bool heated = plate && std::holds_alternative<HeatStep>(plate->heat);
  if (const YamlNode* name = block.find("name")) {
    only_one(reader, block, "a material's name",
             {"ordinary", "extraordinary", "birefringence", "file", "four_parameter"});
    preset = name->is_scalar() ? find_material_preset(name->text) : nullptr;
    if (!preset) {
      std::vector<std::string> names{"E44-steinberg2020", "5CB", "E7", "E44"};
      for (const MaterialPreset& p : material_presets()) names.push_back(p.name);
      if (name->is_scalar() && name->text == "E44-steinberg2020")
        reader.problems.add(name->where, "E44-steinberg2020 has a law of temperature and an uncertainty of its own",
                            "leave haller and birefringence_factor out");
      else
        reader.choice(block, "name", names);
      return ConstantIndices{};
    }
    law.birefringence_uncertainty = preset->birefringence_uncertainty;
    if (preset->four_parameter.empty()) {
      const auto ray = [&](const std::array<double, 3>& c) {
        Dispersion d;
        d.coefficients = {c[0], c[1], -2, c[2], -4};
        d.lower_um = preset->lower_nm / 1000;
        d.upper_um = preset->upper_nm / 1000;
        return d;
      };
      law.indices = DispersiveIndices{ray(preset->ordinary), ray(preset->extraordinary)};
      known_at_k = preset->temperature_k;
    } else {
      FourParameterIndices four;
      for (const auto& s : preset->four_parameter) {
        const std::string path = "sample.material." + preset->name + show(1000 * s.wavelength_um);
        four.sets.push_back({s.wavelength_um, hidden(reader, path + ".mean_index", s.mean_index),
                             hidden(reader, path + ".mean_slope_per_k", s.mean_slope_per_k),
                             hidden(reader, path + ".birefringence_0k", s.birefringence_0k),
                             hidden(reader, path + ".exponent", s.exponent),
                             hidden(reader, path + ".clearing_k", s.clearing_k)});
      }
      law.indices = four;
      law.lower_k = preset->lower_k;
      law.upper_k = preset->upper_k;
    }
  } else if (block.find("file")) {
    only_one(reader, block, "a material's file",
             {"ordinary", "extraordinary", "birefringence", "four_parameter", "haller", "birefringence_factor"});
    const RayIndices ray = read_file(reader, block);
    known_at_k = ray.temperature_k;
    law.indices = DispersiveIndices{ray.law, ray.law};
  } else if (block.find("four_parameter")) {
    only_one(reader, block, "four_parameter", {"ordinary", "extraordinary", "birefringence", "haller"});
    law.indices = read_four_parameter(reader, block);
  } else if (is_ray_block(block.find("ordinary")) || block.find("extraordinary")) {
    only_one(reader, block, "laws of both rays", {"birefringence"});
    if (!block.find("ordinary"))
      reader.missing(block, "ordinary", "the ordinary ray: {file: ..}, {cauchy: ..} or {sellmeier: ..}");
    if (!block.find("extraordinary"))
      reader.missing(block, "extraordinary", "the extraordinary ray: {file: ..}, {cauchy: ..} or {sellmeier: ..}");
    DispersiveIndices both;
    if (block.find("ordinary") && block.find("extraordinary")) {
      const RayIndices o = read_ray(reader, block, "ordinary"), e = read_ray(reader, block, "extraordinary");
      both = {o.law, e.law};
      known_at_k = o.temperature_k ? o.temperature_k : e.temperature_k;
      if (o.temperature_k && e.temperature_k && std::abs(*o.temperature_k - *e.temperature_k) > kTemperatureMargin_k)
        reader.problems.add(
            block.where,
            "the two rays are given at " + show(*o.temperature_k) + " K and " + show(*e.temperature_k) + " K",
            "use files of one temperature");
    }
    law.indices = both;
  } else {
    law.indices = ConstantIndices{read_described<ConstantIndices>(reader, block, "ordinary"),
                                  read_described<ConstantIndices>(reader, block, "birefringence")};
  }
  if (block.find("haller")) {
    if (preset && !preset->four_parameter.empty())
      reader.problems.add(block.find("haller")->where, preset->name + " has a law of temperature of its own",
                          "leave haller out");
    else
      law.haller = read_haller(reader, block, known_at_k);
  }
  const bool by_temperature = law.haller || std::holds_alternative<FourParameterIndices>(law.indices);
  const YamlNode* temperature = block.find("temperature_k");
  NumberSpec spec = described<LawIndices>("temperature_k");
  if (law.upper_k > 0) {
    spec.lower = law.lower_k;
    spec.upper = law.upper_k;
  }
  if (heated) {
    if (temperature)
      reader.problems.add(temperature->where, "temperature_k is given beside a temperature profile (sample.plate.heat)",
                          "leave it out");
    if (!by_temperature && block.node)
      reader.problems.add(block.where, "sample.plate.heat has no effect on indices without a law of temperature",
                          "add haller: {clearing_k: .., exponent: ..}, or leave heat out");
  } else if (by_temperature) {
    law.temperature_k = reader.number(block, "temperature_k", spec);
  } else if (temperature) {
    const std::optional<double> given = reader.plain(block, "temperature_k", spec);
    if (given && !known_at_k)
      reader.problems.add(temperature->where, "temperature_k has no effect on these indices",
                          "leave it out, or add haller: {reference_k: .., clearing_k: .., exponent: ..}");
    else if (given && std::abs(*given - *known_at_k) > kTemperatureMargin_k)
      reader.problems.add(
          temperature->where,
          "temperature_k = " + show(*given) + ": these indices were measured at " + show(*known_at_k) + " K",
          "add haller: {clearing_k: .., exponent: ..}");
  }
  if (block.find("birefringence_factor"))
    law.birefringence_factor = read_described<LawIndices>(reader, block, "birefringence_factor");
  if (preset) {
    const bool fitted = law.birefringence_factor && reader.table[law.birefringence_factor].free;
    if (fitted) law.birefringence_uncertainty = 0;  // in the intervals, through the factor
    reader.warnings.push_back("Indices of " + preset->name + ": " + preset->source + "." +
                              (fitted ? "" : " Birefringences of different sources differ by several percent."));
  }
  return law;
}

std::optional<Dispersion> read_surround_file(ConfigReader& reader, const Block& surround) {
  if (const YamlNode* index = surround.find("index"))
    reader.problems.add(index->where, "index is given beside a surround's file", "give one of the two");
  const std::size_t before = reader.problems.all().size();
  const RayIndices ray = read_file(reader, surround);
  if (reader.problems.all().size() > before) return std::nullopt;
  return ray.law;
}

void check_material_ranges(ConfigReader& reader, const Block& root, const Scene& scene) {
  // Laws that could not be read have no range; why was said.
  if (!reader.problems.empty()) return;
  const Block sample{root.find("sample"), "sample", {}};
  const YamlNode* material = sample.find("material");
  const Parameter& wavelength = reader.table[scene.microscope.wavelength_nm];
  if (const auto range = wavelengths_um(scene.material, scene.surround_dispersion)) {
    const double lower = 1000 * range->lower, upper = 1000 * range->upper;
    const std::string limits = "[" + show(lower) + ", " + show(upper) + "]";
    if (lower > upper) {
      reader.problems.add(material ? material->where : sample.where,
                          "the ranges of this scene's indices have no wavelength in common");
      return;
    }
    for (double nm : extremes(reader, scene.microscope.wavelength_nm))
      if (nm < lower - 1e-9 * lower || nm > upper + 1e-9 * upper) {
        reader.problems.add(
            wavelength.where,
            "wavelength_nm: " + show(nm) + " is outside " + limits + ", where the indices of this scene are known",
            "nothing is extrapolated: use another source of the material");
        return;
      }
    // for `set:` of a micrograph
    if (const auto spec = reader.specs.find(wavelength.name); spec != reader.specs.end()) {
      spec->second.lower = std::max(spec->second.lower, lower);
      spec->second.upper = std::min(spec->second.upper, upper);
    }
  }
  const auto* law = std::get_if<LawIndices>(&scene.material);
  if (law) {
    for (ParameterRef t : temperatures(scene)) {
      const Parameter& at = reader.table[t];
      const Where where = at.where.line > 0 || !material ? at.where : material->where;
      double lowest_clearing = 1e9;
      for (ParameterRef tc : clearing_points(*law))
        for (double k : extremes(reader, tc)) lowest_clearing = std::min(lowest_clearing, k);
      const bool reference = law->haller && t == law->haller->reference_k;
      for (double k : extremes(reader, t)) {
        if (k > lowest_clearing - kClearingMargin_k) {
          reader.problems.add(where,
                              at.name + ": " + show(k) + " K is at or above the clearing point, " +
                                  show(lowest_clearing) + " K (less " + show(kClearingMargin_k) +
                                  " K): there the material is not birefringent",
                              at.free ? "lower the upper bound" : "");
          break;
        }
        if (law->upper_k > 0 && !reference && (k < law->lower_k || k > law->upper_k)) {
          reader.problems.add(where, at.name + ": " + show(k) + " K is outside [" + show(law->lower_k) + ", " +
                                         show(law->upper_k) + "] K, where this material's law holds");
          break;
        }
      }
    }
  }
  if (!reader.problems.empty()) return;
  // What a transparent medium can have, at the values given.
  const auto value = [&](ParameterRef ref) { return reader.table[ref].value; };
  struct Lookup {
    const ParameterTable& table;
    double operator()(ParameterRef ref) const { return table[ref].value; }
    double get(ParameterRef ref, double fallback) const { return ref ? table[ref].value : fallback; }
  };
  const Lookup lookup{reader.table};
  const double um = value(scene.microscope.wavelength_nm) / 1000;
  const auto plausible = [&](double n, const Where& where, const std::string& what) {
    if (!(n >= 1 && n <= 4))
      reader.problems.add(where, what + " is " + show(n) + " at " + show(1000 * um) + " nm, outside [1, 4]",
                          "no transparent medium has this index");
  };
  if (scene.surround_dispersion)
    plausible(index_at<double>(*scene.surround_dispersion, um, lookup), sample.find("surround")->where,
              "the index of the surround");
  const bool needs_temperature = law && !clearing_points(*law).empty() && !law->temperature_k;
  if (law && material && !needs_temperature) {
    const Indices<double> n = material_indices<double>(scene.material, lookup, um);
    plausible(n.ordinary, material->where, "the ordinary index");
    plausible(n.extraordinary, material->where, "the extraordinary index");
  }
}

}  // namespace birefit
