#include "io/config/microscope.h"

#include <algorithm>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

#include "io/config/described.h"
#include "io/config/light.h"
#include "scene/polariscope.h"

namespace birefit {
namespace {

/// What stands between a polarizer and the sample, by the words for it: the parts, and plates of whole parts of a wave.
const std::map<std::string, double> kWavePlates = {{"quarter_wave", 0.25}, {"half_wave", 0.5}, {"full_wave", 1}};
std::vector<std::string> part_words() {
  std::vector<std::string> words = KindsOf<PolarizingPart>::keys();
  for (const auto& [word, waves] : kWavePlates) words.push_back(word);
  return words;
}

const std::vector<std::string> kCrystals = {"quartz", "magnesium_fluoride", "calcite"};
/// The crystal a plate says it is of; `otherwise` where it says none.
PlateCrystal read_crystal(ConfigReader& reader, const Block& block, PlateCrystal otherwise) {
  const auto name = reader.choice(block, "crystal", kCrystals);
  if (!name) return otherwise;
  return *name == "quartz"    ? PlateCrystal::quartz
         : *name == "calcite" ? PlateCrystal::calcite
                              : PlateCrystal::magnesium_fluoride;
}

/// A plate of so many wavelengths: of the light's own where it is not said which, or of one that it is made for.
Retarder read_wave_plate(ConfigReader& reader, const Block& block, double waves) {
  Retarder plate;
  plate.azimuth_deg = read_described<Retarder>(reader, block, "azimuth_deg");
  plate.crystal = read_crystal(reader, block, PlateCrystal::none);
  if (const YamlNode* crystal = block.find("crystal"); crystal && !block.find("made_for_nm"))
    reader.problems.add(crystal->where, "a wave plate of a crystal is made for one wavelength", "add made_for_nm: 550");
  if (const auto wavelength = reader.plain(block, "made_for_nm", numbers::within(100, 20000, "nm"))) {
    plate.at_nm = *wavelength;
    plate.retardance_nm =
        reader.constant(block.path_of("retardance_nm"), described<Retarder>("retardance_nm"), waves * *wavelength);
  } else {
    plate.phase_deg = reader.constant(block.path_of("phase_deg"), described<Retarder>("phase_deg"), 360 * waves);
  }
  return plate;
}

/// The part of that key.
PolarizingPart read_part(ConfigReader& reader, const Block& item, const std::string& key) {
  PolarizingPart part;
  each_kind<PolarizingPart>([&]<class Part>(const Part*) {
    if (key != Part::kKey) return;
    Part read;
    std::vector<std::string> keys = described_keys<Part>();
    if constexpr (requires { read.crystal; }) keys.push_back("crystal");
    if constexpr (requires { read.at_nm; }) keys.push_back("at_nm");
    const Block block = reader.block(item, key, keys, true);
    read_numbers(reader, block, read);
    if constexpr (requires { read.crystal; }) read.crystal = read_crystal(reader, block, read.crystal);
    if constexpr (std::is_same_v<Part, Retarder>) {
      for (const char* of_retardance : {"crystal", "at_nm"})
        if (const YamlNode* node = block.find(of_retardance); node && read.phase_deg)
          reader.problems.add(node->where, std::string(of_retardance) + " is of a retardance, and a phase is given",
                              "give retardance_nm in place of phase_deg");
      if (const YamlNode* at = block.find("at_nm"); at && read.crystal == PlateCrystal::none)
        reader.problems.add(at->where, "at_nm is given, and the retardance is the same at all wavelengths",
                            "add crystal: quartz (or magnesium_fluoride, calcite), or leave at_nm out");
      read.at_nm = reader.plain(block, "at_nm", numbers::within(200, 2000, "nm")).value_or(read.at_nm);
      const YamlNode* phase = block.find("phase_deg");
      if (phase && read.retardance_nm)
        reader.problems.add(phase->where, "phase_deg is given beside retardance_nm", "give one of the two");
      if (block.node && !read.phase_deg && !read.retardance_nm) reader.missing(block, "phase_deg or retardance_nm");
    }
    part = read;
  });
  return part;
}

/// A list like [{quarter_wave: {azimuth_deg: 45}}, {rotator: {angle_deg: 10}}], in the order in which light meets them.
void read_parts(ConfigReader& reader, const Block& microscope, const std::string& key,
                std::vector<PolarizingPart>& to) {
  const YamlNode* list = microscope.find(key);
  if (!list) return;
  const std::string path = microscope.path_of(key);
  if (!list->is_sequence()) {
    reader.problems.add(list->where, path + " must be a list of parts, found " + list->describe(),
                        "write " + key + ": [{quarter_wave: {azimuth_deg: 45}}]");
    return;
  }
  for (std::size_t i = 0; i < list->items.size(); ++i) {
    const Block item = reader.block_of(list->items[i], path + "[" + std::to_string(i + 1) + "]", part_words());
    if (!item.node) continue;
    if (item.node->entries.size() != 1) {
      reader.problems.add(item.where,
                          item.path + " must hold one part, found " + std::to_string(item.node->entries.size()),
                          "one of " + list_words(part_words()) + "; the list has an item for each");
      continue;
    }
    const std::string& kind = item.node->entries[0].key;
    if (const auto plate = kWavePlates.find(kind); plate != kWavePlates.end())
      to.emplace_back(read_wave_plate(reader, reader.block(item, kind, {"azimuth_deg", "made_for_nm", "crystal"}, true),
                                      plate->second));
    else if (const std::vector<std::string> words = part_words();
             std::find(words.begin(), words.end(), kind) != words.end())
      to.push_back(read_part(reader, item, kind));
  }
}

/// The ratio of a polarizer that leaks; of one that is there.
ParameterRef read_extinction(ConfigReader& reader, const Block& block, const std::string& key, ParameterRef azimuth) {
  const YamlNode* node = block.find(key);
  if (!node) return {};
  if (!azimuth) {
    reader.problems.add(node->where, key + " is given of a polarizer that is not there", "leave one of the two out");
    return {};
  }
  return reader.number(block, key, described<Microscope>(key));
}

/// Short forms of parts: a circular polariscope, a compensator.
void read_short_forms(ConfigReader& reader, const Block& block, Microscope& microscope) {
  if (reader.choice(block, "quarter_wave", {"true", "false"}).value_or("false") == "true") {
    if (!microscope.polarizer_deg || block.find("before") || block.find("behind") || block.find("compensator"))
      reader.problems.add(block.find("quarter_wave")->where,
                          "quarter_wave: true stands for a polarizer and all parts of a circular polariscope",
                          "list its plates under before and behind, or leave out what else is there");
    else
      make_circular_polariscope(microscope, [&](const std::string& name, const NumberSpec& spec, double value) {
        return reader.constant("microscope.quarter_wave." + name, spec, value);
      });
  }
  if (block.find("compensator")) {
    const Block compensator = reader.block(block, "compensator", {"phase_deg", "azimuth_deg"}, true);
    Retarder retarder;
    retarder.phase_deg = reader.number(compensator, "phase_deg", described<Retarder>("phase_deg"));
    retarder.azimuth_deg = reader.number(compensator, "azimuth_deg", described<Retarder>("azimuth_deg"));
    microscope.behind.emplace_back(retarder);
  }
}

/// The block, or its short form.
void read_condenser(ConfigReader& reader, const Block& microscope, Microscope& to) {
  const YamlNode *block = microscope.find("condenser"), *na = microscope.find("condenser_na");
  if (block && na)
    reader.problems.add(na->where, "condenser_na is short for condenser: {na: ..}, which is given, too",
                        "give one of the two");
  else if (block)
    read_numbers(reader, reader.block(microscope, "condenser", described_keys<Condenser>(), true),
                 to.condenser.emplace());
  else if (na)
    to.condenser.emplace().na = reader.number(microscope, "condenser_na", described<Condenser>("na"));
}

/// The value under either of two spellings; both at once is a mistake. `none`: no such polarizer, an empty reference.
ParameterRef polarizing_element(ConfigReader& reader, const Block& block, const std::string& canonical,
                                const std::string& variant, bool required) {
  const YamlNode* node = block.find(canonical);
  const YamlNode* other = block.find(variant);
  if (node && other)
    reader.problems.add(other->where, variant + " and " + canonical + " are the same key", "give one of the two");
  if (!node) node = other;
  if (node && node->is_scalar() && node->text == "none") return {};
  const std::string path = block.path_of(canonical);
  if (node) return reader.number_at(*node, path, described<Microscope>(canonical));
  return reader.number(block, canonical, described<Microscope>(canonical),
                       required ? std::nullopt : std::optional<double>(0));
}

}  // namespace

void read_microscope(ConfigReader& reader, const Block& root, Scene& scene) {
  Microscope& microscope = scene.microscope;
  const Block block =
      reader.block(root, "microscope",
                   {"light", "polarizer_deg", "analyzer_deg", "polariser_deg", "analyser_deg", "objective_na",
                    "condenser", "condenser_na", "focus_um", "imaging", "directions", "quarter_wave", "compensator",
                    "before", "behind", "polarizer_extinction_ratio", "analyzer_extinction_ratio", "camera"},
                   true);
  read_light(reader, block, microscope);
  reader.camera = read_camera(reader, block);
  if (microscope.channel_light && std::holds_alternative<Crystal>(scene.sample))
    reader.problems.add(block.find("light")->where, "a lamp has all wavelengths, and a half-wave voltage is of one",
                        "state the line: light: {wavelength_nm: .., bandwidth_nm: ..}");
  if (!reader.camera.empty() && !microscope.channel_light)
    reader.problems.add(block.find("camera")->where,
                        "camera is given beside a single line, whose light it cannot change",
                        "state the light: {lamp: A}, or leave camera out");

  if (auto* constant = std::get_if<ConstantIndices>(&scene.material); constant && constant->resonance_nm) {
    const Parameter& resonance = reader.table[constant->resonance_nm];
    // A quarter of the light's wavelength away from the band its law stops to hold; 589.3 nm is where birefringence is
    // given.
    const double shortest = std::min(reader.span_of(microscope.wavelength_nm).first, 589.3);
    if (reader.span_of(constant->resonance_nm).second > 0.8 * shortest)
      reader.problems.add(
          resonance.where,
          resonance.name + " must stay below 0.8 of the wavelength (and of 589.3 nm, where birefringence is given)",
          "liquid crystals have 200 to 300");
  }
  const Slab* slab_sample = std::get_if<Slab>(&scene.sample);
  const bool slab = slab_sample && !slab_sample->half_angle_deg;
  microscope.polarizer_deg =
      polarizing_element(reader, block, "polarizer_deg", "polariser_deg", !slab && reader.polarizers);
  microscope.analyzer_deg =
      polarizing_element(reader, block, "analyzer_deg", "analyser_deg", !slab && reader.polarizers);
  for (const auto& [key, ref] :
       {std::pair("objective_na", &microscope.objective_na), std::pair("focus_um", &microscope.focus_um)})
    *ref = read_described<Microscope>(reader, block, key);
  read_condenser(reader, block, microscope);
  microscope.aplanatic = reader.choice(block, "imaging", {"focal_plane", "aplanatic"}).value_or("") == "aplanatic";

  microscope.polarizer_extinction_ratio =
      read_extinction(reader, block, "polarizer_extinction_ratio", microscope.polarizer_deg);
  microscope.analyzer_extinction_ratio =
      read_extinction(reader, block, "analyzer_extinction_ratio", microscope.analyzer_deg);
  read_parts(reader, block, "before", microscope.before);
  read_parts(reader, block, "behind", microscope.behind);
  read_short_forms(reader, block, microscope);
  if (const YamlNode* directions = block.find("directions")) {
    if (microscope.condenser)
      reader.problems.add(directions->where, "directions are given beside a condenser", "give one of the two");
    if (!slab)
      reader.problems.add(directions->where,
                          slab_sample ? "a slab with a view in a cone has a direction for every pixel"
                                      : "directions belong to slab scenes",
                          slab_sample ? "give one of the two" : "");
    if (!directions->is_sequence() || directions->items.empty()) {
      reader.problems.add(directions->where, "directions must be a list of {theta_deg, azimuth_deg}, found " +
                                                 (directions->is_sequence() ? "an empty one" : directions->describe()));
      return;
    }
    for (const YamlNode& item : directions->items) {
      const Block direction = reader.block_of(item, "microscope.directions", {"theta_deg", "azimuth_deg"});
      NumberSpec theta = numbers::angle(0, 90);
      theta.upper_open = true;
      if (direction.node && !direction.find("theta_deg")) reader.missing(direction, "theta_deg");
      microscope.directions.push_back({reader.plain(direction, "theta_deg", theta).value_or(0),
                                       reader.plain(direction, "azimuth_deg", numbers::angle()).value_or(0)});
    }
  } else if (slab) {
    microscope.directions = {{0, 0}};
  }
}

}  // namespace birefit
