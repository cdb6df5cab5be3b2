#pragma once
// The size of a pixel as a file states it: OME and ImageJ metadata, resolution tags.

#include <array>
#include <string>
#include <vector>

#include <OpenImageIO/imageio.h>

namespace birefit {

/// A positive number, else 0.
double number_or_zero(const std::string& text);

/// The value of `key=` on a line of its own in an ImageJ description.
std::string imagej_value(const std::string& description, const std::string& key);

/// Micrometres per pixel, 0 when the file does not state it credibly; says in `notes` where it comes from. Sizes along
/// x and y that differ go to `uneven_um`.
double stated_pixel_size_um(const OIIO::ImageSpec& spec, const std::string& description,
                            std::vector<std::string>& notes, std::array<double, 2>& uneven_um);

}  // namespace birefit
