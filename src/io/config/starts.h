#pragma once
// What an image tells of a scene before a fit: its view, starts, and whether the sample can be on it.

#include <string>

#include "birefit/fit.h"
#include "io/config/micrograph.h"

namespace birefit {

/// Starts and bounds of `fit: auto` from the image; the image's middle where there is none to look at. Of several discs
/// those that are not meant are left out of the mask.
void resolve_automatic(ConfigReader& reader, Scene& scene, const Image* values, Mask* mask, const std::string& name);
/// A droplet in a field is a hedgehog or has a ring: both are fitted.
void add_branches(FitJob& job);
/// A droplet that the image cannot show is a mistake in a unit or a centre.
void check_overlap(ConfigReader& reader, const Scene& scene, const std::string& name);
/// The view of a scene of this size (px); file_pixel_um: what the image states, 0 = nothing.
void set_view(ConfigReader& reader, int width, int height, double file_pixel_um, const std::string& name, Scene& scene);
/// What the settings take of the file's image, region and bins: the view is of that. Parameters stay those of the file.
void take_part(const MicrographSettings& settings, Scene& scene);
/// Where an electrode's edge is, in pixels of the file: read off the picture.
NumberSpec electrode_spec();
/// Electrodes that the config does not give are the edges of this part of the file.
void set_electrodes(ConfigReader& reader, const PixelRect& part, Scene& scene);

}  // namespace birefit
