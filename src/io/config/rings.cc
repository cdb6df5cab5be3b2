#include "io/config/rings.h"

#include <algorithm>

#include "io/config/described.h"
#include "io/files/table.h"

namespace birefit {

void read_ring_view(ConfigReader& reader, const Block& view, Plate& plate) {
  plate.screen_distance_um = reader.number(view, "screen_distance_um", described<Plate>("view.screen_distance_um"));
  plate.ring_offset = reader.number(view, "ring_offset", described<Plate>("view.ring_offset"), 0);
}

bool has_ring_table(const Scene& scene) {
  const auto* plate = std::get_if<Plate>(&scene.sample);
  return plate && plate->screen_distance_um;
}

std::optional<LoadedImage> load_ring_table(ConfigReader& reader, const std::filesystem::path& path, const Where& where,
                                           const Scene& scene, Observable& observable) {
  PlacedTable table;
  try {
    table = load_placed_table(path, where, MissingNumbers::left_out);
  } catch (const UserError& error) {
    reader.problems.add(error);
    return std::nullopt;
  }
  const auto column = [&](const std::string& name) {
    const auto& columns = table.table.columns;
    const auto found = std::find(columns.begin(), columns.end(), name);
    if (found != columns.end()) return static_cast<int>(found - columns.begin());
    reader.problems.add({path.string(), table.header_line}, "has no column " + name,
                        "columns: m, the ring's number from the centre, and r_cm, its radius on the screen");
    return -1;
  };
  const int m = column("m"), r = column("r_cm");
  if (m < 0 || r < 0) return std::nullopt;
  reader.warnings.insert(reader.warnings.end(), table.notes.begin(), table.notes.end());
  if (!table.units.empty() && contradicts_unit(table.units[static_cast<std::size_t>(r)], "cm"))
    reader.problems.add({path.string(), table.header_line + 1},
                        "r_cm is in " + table.units[static_cast<std::size_t>(r)] + " by its line of units",
                        "give the radii in cm");
  const int rows = static_cast<int>(table.table.rows.size());
  if (rows < 2) {
    reader.problems.add({path.string(), table.header_line}, "has " + std::to_string(rows) + " rings",
                        "at least 2 are needed");
    return std::nullopt;
  }
  LoadedImage image;
  image.values = Image(rows, 1, 0);
  image.width = rows, image.height = 1;
  image.bits = 32;
  const Plate& plate = std::get<Plate>(scene.sample);
  observable = {Quantity::ring_radius_cm, {}};
  const double least = reader.span_of(plate.ring_offset).first;
  for (int i = 0; i < rows; ++i) {
    const std::vector<double>& row = table.table.rows[static_cast<std::size_t>(i)];
    const Where place{path.string(), table.lines[static_cast<std::size_t>(i)]};
    if (!(row[static_cast<std::size_t>(m)] + least > 0))
      reader.problems.add(place,
                          "ring number " + show(row[static_cast<std::size_t>(m)]) + " with ring_offset " + show(least) +
                              " is not above 0",
                          "the dark centre is number 0 and has no radius; raise the lower bound of ring_offset");
    if (!(row[static_cast<std::size_t>(r)] > 0))
      reader.problems.add(place, "the radius " + show(row[static_cast<std::size_t>(r)]) + " cm is not above 0");
    observable.ring_numbers.push_back(row[static_cast<std::size_t>(m)]);
    image.values(i, 0) = row[static_cast<std::size_t>(r)];
  }
  return image;
}

Readings ring_readings(const Picture& table, const Observable& observable) {
  Readings readings;
  readings.name = table.name;
  readings.rows = {table.scene};
  readings.gain = table.gain, readings.offset = table.offset;
  readings.noise = table.noise;
  readings.observable.quantity = Quantity::ring_radius_cm;
  std::vector<double> radii;
  for (int i = 0; i < table.values.width(); ++i)
    if (table.mask(i, 0)) {
      radii.push_back(table.values(i, 0));
      readings.observable.ring_numbers.push_back(observable.ring_numbers[static_cast<std::size_t>(i)]);
    }
  readings.values = Eigen::Map<const Eigen::VectorXd>(radii.data(), static_cast<Eigen::Index>(radii.size()));
  return readings;
}

}  // namespace birefit
