#include "io/config/disc.h"

#include "io/config/described.h"
#include "samples/disc/disc.h"

namespace birefit {
namespace {

std::vector<ParameterRef> read_polynomial(ConfigReader& reader, const Block& block, const std::string& key,
                                          const std::string& terms, const NumberSpec& spec) {
  std::vector<ParameterRef> refs;
  const YamlNode* list = block.find(key);
  if (!list) return refs;
  if (!list->is_sequence() || list->items.empty() || list->items.size() > 36) {
    reader.problems.add(list->where,
                        key + " must be a list of 1 to 36 coefficients of " + terms + ", found " +
                            (list->is_sequence() ? std::to_string(list->items.size()) + " items" : list->describe()));
    return refs;
  }
  for (std::size_t i = 0; i < list->items.size(); ++i)
    refs.push_back(reader.number_at(list->items[i], block.path_of(key) + "[" + std::to_string(i + 1) + "]", spec));
  return refs;
}

}  // namespace

StressedDisc read_stressed_disc(ConfigReader& reader, const Block& parent) {
  StressedDisc disc;
  const Block block = reader.block(parent, "disc",
                                   {"diameter_um", "thickness_um", "load_n", "stress_optic_brewster",
                                    "load_azimuth_deg", "contact_radius_um", "rim_um", "residual", "illumination"},
                                   true);
  using D = StressedDisc;
  disc.diameter_um = read_described<D>(reader, block, "diameter_um");
  disc.load_n = read_described<D>(reader, block, "load_n");
  disc.stress_optic_brewster = read_described<D>(reader, block, "stress_optic_brewster");
  disc.load_azimuth_deg = read_described<D>(reader, block, "load_azimuth_deg");
  disc.contact_radius_um = reader.plain(block, "contact_radius_um", numbers::length_um(1e7)).value_or(0);
  disc.rim_um = reader.plain(block, "rim_um", numbers::length_um(1e7)).value_or(0);
  const bool residual = block.find("residual");
  if (residual) {
    const Block stress = reader.block(block, "residual", {"normal_mpa", "shear_mpa"}, true);
    const std::string terms = "1, X, Y, X^2, XY, Y^2, ..";
    disc.residual_normal_mpa =
        read_polynomial(reader, stress, "normal_mpa", terms, described<D>("residual.normal_mpa"));
    disc.residual_shear_mpa = read_polynomial(reader, stress, "shear_mpa", terms, described<D>("residual.shear_mpa"));
    if (stress.node && !stress.find("normal_mpa") && !stress.find("shear_mpa"))
      reader.missing(stress, "normal_mpa or shear_mpa", "coefficients of sxx - syy and 2 sxy");
  }
  disc.illumination =
      read_polynomial(reader, block, "illumination", "X, Y, X^2, XY, Y^2, ..", described<D>("illumination"));
  // The load's retardance does not depend on the thickness; the residual stress's does.
  const NumberSpec thickness = described<D>("thickness_um");
  disc.thickness_um = reader.number(block, "thickness_um", thickness, residual ? std::nullopt : thickness.fallback);
  return disc;
}

void check_stressed_disc(ConfigReader& reader, const Picture& micrograph) {
  const auto* disc = std::get_if<StressedDisc>(&micrograph.scene.sample);
  if (!disc || !reader.problems.empty()) return;
  const DiscZone zone(micrograph.scene, reader.table.values());
  const View& view = micrograph.scene.view;
  for (int row = 0; row < view.height; ++row)
    for (int column = 0; column < view.width; ++column)
      if (micrograph.mask(column, row) && zone.fitted(column, row)) return;
  const auto value = [&](ParameterRef ref) { return show(reader.table[ref].value); };
  reader.problems.add(reader.table[disc->diameter_um].where,
                      "no pixel of " + micrograph.name + " is left inside a disc of " + show(zone.radius_px()) +
                          " pixels radius at [" + value(view.center_x_px) + ", " + value(view.center_y_px) + "]",
                      "check diameter_um, pixel_size_um, center_px, contact_radius_um and rim_um");
}

}  // namespace birefit
