#include "io/config_director.h"

#include <algorithm>
#include <cmath>

namespace birefit {
namespace {

NumberSpec within(double lower, double upper, const char* unit = "") {
  NumberSpec spec;
  spec.unit = unit;
  spec.lower = lower;
  spec.upper = upper;
  return spec;
}

NumberSpec positive(double upper, const char* unit = "") {
  NumberSpec spec = within(0, upper, unit);
  spec.lower_open = true;
  return spec;
}

NumberSpec azimuth() { return within(-36000, 36000, "deg"); }

/// A pitch of either hand; a fit must not pass through zero, where the helix turns infinitely fast.
ParameterRef read_pitch(ConfigReader& reader, const Block& block) {
  const ParameterRef ref = reader.number(block, "pitch_um", within(-100000, 100000, "um"));
  const YamlNode* node = block.find("pitch_um");
  if (!node || !ref) return ref;
  const Parameter& pitch = reader.table[ref];
  const double lower = pitch.free ? pitch.lower : pitch.value, upper = pitch.free ? pitch.upper : pitch.value;
  if (lower <= 0 && upper >= 0)
    reader.problems.add(node->where,
                        block.path_of("pitch_um") + (pitch.free ? " is fitted through 0" : " = 0 has no meaning"),
                        "> 0 is right-handed, < 0 left-handed; leave it out for none");
  return ref;
}

}  // namespace

FreederickszDirector read_freedericksz(ConfigReader& reader, const Block& parent) {
  using Anchoring = FreederickszDirector::Anchoring;
  FreederickszDirector d;
  const Block block = reader.block(parent, "freedericksz",
                                   {"reduced_voltage", "voltage_v", "threshold_v", "k33_over_k11", "k22_over_k11",
                                    "eps_ratio", "k11_pn", "k22_pn", "k33_pn", "eps_parallel", "eps_perpendicular",
                                    "anchoring", "pretilt_deg", "azimuth_deg", "twist_deg", "pitch_um"},
                                   true);
  const auto given = [&](const char* key) {
    return block.find(key) ||
           std::count(reader.set_everywhere.begin(), reader.set_everywhere.end(), block.path_of(key)) > 0;
  };
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
    d.k11_pn = reader.number(block, "k11_pn", positive(1000, "pN"));
    d.k33_pn = reader.number(block, "k33_pn", positive(1000, "pN"));
    if (twisted || given("k22_pn")) d.k22_pn = reader.number(block, "k22_pn", positive(1000, "pN"));
  } else {
    d.k33_over_k11 = reader.number(block, "k33_over_k11", positive(20));
    if (twisted || given("k22_over_k11")) d.k22_over_k11 = reader.number(block, "k22_over_k11", positive(20));
  }
  if (!twisted)
    for (const char* key : {"k22_over_k11", "k22_pn"})
      superfluous(key, "has no effect without twist_deg or pitch_um", "leave it out");
  const NumberSpec ratio = positive(100), permittivity = positive(1000);
  if (permittivities) {
    superfluous("eps_ratio", "is given beside eps_parallel and eps_perpendicular", "give one of the two");
    d.eps_parallel = reader.number(block, "eps_parallel", permittivity);
    d.eps_perpendicular = reader.number(block, "eps_perpendicular", permittivity);
  } else {
    d.eps_ratio = reader.number(block, "eps_ratio", ratio);
  }

  // A voltage, and the threshold it is measured by.
  NumberSpec reduced = within(0, 50), volts = within(0, 1e5, "V");
  reduced.physical_lower = volts.physical_lower = 0;
  if (given("reduced_voltage") && given("voltage_v"))
    superfluous("voltage_v", "is given beside reduced_voltage", "give one of the two");
  if (given("voltage_v") && !given("reduced_voltage")) {
    d.voltage_v = reader.number(block, "voltage_v", volts);
    if (given("threshold_v")) {
      d.threshold_v = reader.number(block, "threshold_v", positive(1e4, "V"));
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
      d.reduced_voltage = reader.constant(block.path_of("reduced_voltage"), reduced, 0);
    } else {
      d.reduced_voltage = reader.number(block, "reduced_voltage", reduced);
    }
  }

  // The sign of the dielectric anisotropy must be the one that lets the field do something, and stay so in a fit.
  if (const YamlNode* node = block.find(permittivities ? "eps_parallel" : "eps_ratio");
      node && reader.problems.empty()) {
    const auto range = [&](ParameterRef ref) {
      const Parameter& p = reader.table[ref];
      return p.free ? std::pair(p.lower, p.upper) : std::pair(p.value, p.value);
    };
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

  NumberSpec pretilt = within(0, 45, "deg");
  pretilt.physical_lower = 0;
  d.pretilt_deg = reader.number(block, "pretilt_deg", pretilt, d.anchoring == Anchoring::hybrid ? 0 : 1);
  d.azimuth_deg = reader.number(block, "azimuth_deg", azimuth(), 0);
  if (d.anchoring != Anchoring::planar)
    for (const char* key : {"twist_deg", "pitch_um"})
      superfluous(key, "needs anchoring: planar", "an azimuth has no meaning at a homeotropic face");
  if (given("twist_deg")) d.twist_deg = reader.number(block, "twist_deg", within(-1440, 1440, "deg"));
  if (given("pitch_um")) d.pitch_um = read_pitch(reader, block);
  return d;
}

HelixDirector read_helix(ConfigReader& reader, const Block& parent) {
  HelixDirector d;
  const Block block = reader.block(parent, "helix", {"pitch_um", "azimuth_deg", "modulus"}, true);
  d.pitch_um = read_pitch(reader, block);
  d.azimuth_deg = reader.number(block, "azimuth_deg", azimuth(), 0);
  if (block.find("modulus")) {
    NumberSpec modulus = within(0, 1 - 1e-6);
    modulus.physical_lower = 0;
    d.modulus = reader.number(block, "modulus", modulus);
  }
  return d;
}

}  // namespace birefit
