#pragma once
// `microscope.light` and `microscope.camera` of a config: lines, lamps, filters, sensitivities.

#include <map>
#include <memory>
#include <string>

#include "birefit/microscope.h"
#include "io/config/reader.h"

namespace birefit {

struct Picture;  // birefit/measurement.h

/// What a camera's channels see, by their names (r, g, b); of one without colours under "".
using CameraTables = std::map<std::string, std::shared_ptr<const SpectralTable>>;

/// Reads a line, or a lamp with its filters; a lamp's wavelength_nm is a stand-in until a channel is known
/// (choose_channel).
void read_light(ConfigReader& reader, const Block& microscope, Microscope& to);
/// `camera: {sensitivity: NAME | FILE}`; empty without it, and with a problem.
CameraTables read_camera(ConfigReader& reader, const Block& microscope);
/// A scene with a lamp, as this channel of the camera records it ("" of one without colours, "mean"): its sensitivity
/// and the wavelength that stands for it. A problem where the camera has no such channel, or none of it is lit.
void choose_channel(ConfigReader& reader, const std::string& channel, const Where& where, Scene& scene);
/// Pictures of several colours have a gain, an offset and unevenness each: those that are fitted become this one's own.
void own_levels(ConfigReader& reader, const std::string& channel, Picture& picture);

}  // namespace birefit
