#include "io/config/director.h"

#include <cmath>
#include <string>
#include <vector>

#include "io/config/described.h"

namespace birefit {
namespace {

/// A pitch of either hand; a fit must not pass through zero, where the helix turns infinitely fast.
void check_pitch(ConfigReader& reader, const Block& block, ParameterRef ref) {
  const YamlNode* node = block.find("pitch_um");
  if (!node || !ref) return;
  const Parameter& pitch = reader.table[ref];
  const auto [lower, upper] = reader.span_of(ref);
  if (lower <= 0 && upper >= 0)
    reader.problems.add(node->where,
                        block.path_of("pitch_um") + (pitch.free ? " is fitted through 0" : " = 0 has no meaning"),
                        "> 0 is right-handed, < 0 left-handed; leave it out for none");
}

}  // namespace

template <>
FreederickszDirector read_director<FreederickszDirector>(ConfigReader& reader, const Block& parent) {
  using Anchoring = FreederickszDirector::Anchoring;
  FreederickszDirector d;
  using D = FreederickszDirector;
  std::vector<std::string> keys = described_keys<D>();
  keys.push_back("anchoring");
  const Block block = reader.block(parent, D::kKey, keys, true);
  const auto given = [&](const char* key) { return reader.given(block, key); };
  const auto number = [&](const char* key) { return reader.number(block, key, described<D>(key)); };
  const auto superfluous = [&](const char* key, const std::string& why, const std::string& hint) {
    if (const YamlNode* node = block.find(key)) reader.problems.add(node->where, block.path_of(key) + " " + why, hint);
  };
  const std::string anchoring =
      reader.choice(block, "anchoring", {"planar", "homeotropic", "hybrid"}).value_or("planar");
  d.anchoring = anchoring == "homeotropic" ? Anchoring::homeotropic
                : anchoring == "hybrid"    ? Anchoring::hybrid
                                           : Anchoring::planar;

  // Elastic constants and permittivities: ratios, or the constants themselves.
  const bool constants = given("k11_pn") || given("k33_pn") || given("k22_pn");
  const bool permittivities = given("eps_parallel") || given("eps_perpendicular");
  const bool twisted = given("twist_deg") || given("pitch_um");
  if (constants) {
    for (const char* key : {"k33_over_k11", "k22_over_k11"})
      superfluous(key, "is given beside elastic constants in pN", "give one of the two");
    d.k11_pn = number("k11_pn");
    d.k33_pn = number("k33_pn");
    if (twisted || given("k22_pn")) d.k22_pn = number("k22_pn");
  } else {
    d.k33_over_k11 = number("k33_over_k11");
    if (twisted || given("k22_over_k11")) d.k22_over_k11 = number("k22_over_k11");
  }
  if (!twisted)
    for (const char* key : {"k22_over_k11", "k22_pn"})
      superfluous(key, "has no effect without twist_deg or pitch_um", "leave it out");
  if (permittivities) {
    superfluous("eps_ratio", "is given beside eps_parallel and eps_perpendicular", "give one of the two");
    d.eps_parallel = number("eps_parallel");
    d.eps_perpendicular = number("eps_perpendicular");
  } else {
    d.eps_ratio = number("eps_ratio");
  }

  // A voltage, and the threshold it is measured by.
  if (given("reduced_voltage") && given("voltage_v"))
    superfluous("voltage_v", "is given beside reduced_voltage", "give one of the two");
  if (given("voltage_v") && !given("reduced_voltage")) {
    d.voltage_v = number("voltage_v");
    if (given("threshold_v")) {
      d.threshold_v = number("threshold_v");
      if (constants && permittivities)
        superfluous("threshold_v", "follows from the elastic constants and permittivities",
                    "leave it out, or give k33_over_k11 and eps_ratio");
    } else if (block.node && !(constants && permittivities)) {
      reader.missing(block, "threshold_v", "or k11_pn, k33_pn, eps_parallel and eps_perpendicular, which give it");
    }
  } else {
    superfluous("threshold_v", "has no effect on a reduced voltage", "give voltage_v, or leave it out");
    if (!given("reduced_voltage") && block.node) {
      reader.missing(block, "reduced_voltage or voltage_v",
                     "reduced_voltage is V over the threshold of the untwisted cell");
      d.reduced_voltage = reader.constant(block.path_of("reduced_voltage"), described<D>("reduced_voltage"), 0);
    } else {
      d.reduced_voltage = number("reduced_voltage");
    }
  }

  // The sign of the dielectric anisotropy must be the one that lets the field do something, and stay so in a fit.
  if (const YamlNode* node = block.find(permittivities ? "eps_parallel" : "eps_ratio");
      node && reader.problems.empty()) {
    const auto range = [&](ParameterRef ref) { return reader.span_of(ref); };
    auto [low, high] = range(permittivities ? d.eps_parallel : d.eps_ratio);
    if (permittivities) {
      const auto [least, most] = range(d.eps_perpendicular);
      low /= most;
      high /= least;
    }
    if (d.anchoring == Anchoring::planar && low < 1)
      reader.problems.add(
          node->where, "eps_parallel below eps_perpendicular: a field along the normal leaves a planar cell as it is",
          "anchoring: homeotropic, or eps_ratio of 1 (a uniform field) and more");
    if (d.anchoring == Anchoring::homeotropic && high > 1)
      reader.problems.add(
          node->where,
          "eps_parallel above eps_perpendicular: a field along the normal leaves a homeotropic cell as it is",
          "anchoring: planar, or eps_ratio of 1 (a uniform field) and less");
    if (d.anchoring == Anchoring::hybrid && low < 1 && high > 1)
      reader.problems.add(
          node->where, "eps_parallel / eps_perpendicular is fitted through 1, where the field changes what it pulls at",
          "keep it on one side of 1");
  }

  d.pretilt_deg = reader.number(block, "pretilt_deg", described<D>("pretilt_deg"),
                                d.anchoring == Anchoring::hybrid ? 0 : described<D>("pretilt_deg").fallback);
  d.azimuth_deg = read_described<D>(reader, block, "azimuth_deg");
  if (d.anchoring != Anchoring::planar)
    for (const char* key : {"twist_deg", "pitch_um"})
      superfluous(key, "needs anchoring: planar", "an azimuth has no meaning at a homeotropic face");
  d.twist_deg = read_described<D>(reader, block, "twist_deg");
  d.pitch_um = read_described<D>(reader, block, "pitch_um");
  check_pitch(reader, block, d.pitch_um);
  return d;
}

template <>
HelixDirector read_director<HelixDirector>(ConfigReader& reader, const Block& parent) {
  HelixDirector d;
  const Block block = reader.block(parent, HelixDirector::kKey, described_keys<HelixDirector>(), true);
  read_numbers(reader, block, d);
  check_pitch(reader, block, d.pitch_um);
  return d;
}

template <>
UniformDirector read_director<UniformDirector>(ConfigReader& reader, const Block& parent) {
  UniformDirector director;
  const Block block = reader.block(parent, UniformDirector::kKey, described_keys<UniformDirector>(), true);
  const YamlNode* axis = block.find("axis");
  if (axis) {
    if (block.find("azimuth_deg") || block.find("tilt_deg"))
      reader.problems.add(axis->where, block.path + " has an axis and angles", "give one of the two");
    if (!axis->is_sequence() || axis->items.size() != 3) {
      reader.problems.add(axis->where,
                          "axis must be three components [x, y, z], found " +
                              (axis->is_sequence() ? std::to_string(axis->items.size()) + " items" : axis->describe()));
      return director;
    }
    double square = 0;
    for (int i = 0; i < 3; ++i) {
      const char* const letters[] = {"x", "y", "z"};
      director.axis[i] = reader.number_at(axis->items[i], block.path_of("axis") + "." + letters[i],
                                          described<UniformDirector>("axis"));
      square += std::pow(reader.table[director.axis[i]].value, 2);
    }
    if (square == 0) reader.problems.add(axis->where, "axis = [0, 0, 0] has no direction");
    return director;
  }
  if (block.node && !block.find("azimuth_deg") && !block.find("tilt_deg")) {
    reader.problems.add(block.where, block.path + " needs an axis: [x, y, z] or azimuth_deg and tilt_deg");
    return director;
  }
  read_numbers(reader, block, director);
  return director;
}

/// The reduced field, or the applied one with the two numbers that reduce it.
template <>
AxialDirector read_director<AxialDirector>(ConfigReader& reader, const Block& parent) {
  AxialDirector axial;
  std::vector<std::string> keys = described_keys<AxialDirector>();
  keys.push_back("branch");
  const Block block = reader.block(parent, AxialDirector::kKey, keys, true);
  const YamlNode *reduced = block.find("reduced_field"), *applied = block.find("field_v_per_um");
  if (reduced && applied)
    reader.problems.add(applied->where, block.path + " has a reduced field and an applied one", "give one of the two");
  if (!reduced && !applied)
    reader.missing(block, "reduced_field",
                   "radius over coherence length, 0 without a field; or field_v_per_um with coherence_voltage_v and "
                   "local_field_factor");
  for (const char* other : {"coherence_voltage_v", "local_field_factor"}) {
    const YamlNode* node = block.find(other);
    if (reduced && node)
      reader.problems.add(node->where, std::string(other) + " has no effect on a reduced field",
                          "leave it out, or give field_v_per_um");
    if (applied && !reduced && !reader.given(block, other)) reader.missing(block, other);
  }
  read_numbers(reader, block, axial);
  if (reduced) axial.field_v_per_um = axial.coherence_voltage_v = axial.local_field_factor = {};
  const std::string branch =
      reader.choice(block, "branch", {"hedgehog", "ring", "compare"}).value_or(axial.ring_radius ? "ring" : "hedgehog");
  axial.compare = branch == "compare";
  if (branch == "hedgehog" && axial.ring_radius)
    reader.problems.add(block.find("ring_radius")->where, "a hedgehog has no ring_radius",
                        "leave it out, or write branch: compare");
  if (branch != "hedgehog" && !axial.ring_radius)
    reader.missing(block, "ring_radius",
                   "the ring's radius over the droplet's, for example {value: 0.9, fit: [0.6, 0.99]}");
  return axial;
}

}  // namespace birefit
