#pragma once
// The size of a pixel as a file states it: OME and ImageJ metadata, resolution tags.

#include <array>
#include <string>
#include <vector>

namespace birefit {

/// A positive number, else 0.
double number_or_zero(const std::string& text);

/// The value of `key=` on a line of its own in an ImageJ description.
std::string imagej_value(const std::string& description, const std::string& key);

/// What a file's tags say of its pixels: how many go into a unit of length along x and y; 0 = not stated.
struct StatedResolution {
  double x = 0, y = 0;
  std::string unit;
};

/// Micrometres per pixel, 0 when the file does not state it credibly; says in `notes` where it comes from. Sizes along
/// x and y that differ go to `uneven_um`.
double stated_pixel_size_um(const StatedResolution& tags, const std::string& description,
                            std::vector<std::string>& notes, std::array<double, 2>& uneven_um);

}  // namespace birefit
