#pragma once
// The table of a plate's ring radii, which stands in for an image.

#include "io/config/reader.h"

namespace birefit {

/// view: {screen_distance_cm, ring_offset} of a plate.
void read_ring_view(ConfigReader& reader, const Block& view, Plate& plate);

bool has_ring_table(const Scene& scene);

/// Columns `m` and `r_cm`: one "pixel" a row, and the ring numbers into the observable. Mistakes go to the reader.
std::optional<LoadedImage> load_ring_table(ConfigReader& reader, const std::filesystem::path& path, const Where& where,
                                           const Scene& scene, Observable& observable);
/// Those of the rings that are usable.
Readings ring_readings(const Picture& table, const Observable& observable);

}  // namespace birefit
