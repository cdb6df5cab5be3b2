// birefit michel-levy: the interference colours of a microscope, and retardances from a photograph's colours.

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "app/commands.h"
#include "app/output.h"
#include "birefit/io.h"
#include "core/printable.h"
#include "io/files/file.h"
#include "io/report/colour_strip.h"
#include "io/results/work.h"
#include "study/interference_chart.h"

namespace birefit {
namespace {

struct MichelLevyArguments {
  std::string config;
  std::vector<std::string> set;
  std::string out = "out/michel_levy";
  std::string image;
  double up_to_um = 3, noise = 0.01;
  int threads = 0;
  bool quiet = false;
};

constexpr double kStepUm = 0.005;
constexpr double kNmPerUm = 1000;

std::string table_of(const std::vector<ChartColour>& chart) {
  std::string text = "retardance_nm";
  for (std::size_t c = 0; c < chart.front().channels.size(); ++c)
    text += chart.front().channels.size() == 3 ? fmt::format(",camera_{}", "rgb"[c]) : ",camera";
  text += ",L,a,b,srgb_r,srgb_g,srgb_b,double_nm,double_ciede2000\n";
  for (const ChartColour& one : chart) {
    text += fmt::format("{:g}", kNmPerUm * one.retardance_um);
    for (const double x : one.channels) text += fmt::format(",{:.6f}", x);
    text += fmt::format(",{:.3f},{:.3f},{:.3f}", one.eye.l, one.eye.a, one.eye.b);
    for (const double code : one.screen) text += fmt::format(",{:.4f}", code);
    text += fmt::format(",{:g},{:.3f}\n", kNmPerUm * one.double_um, one.distance);
  }
  return text;
}

ColourStrips strips_of(const std::vector<ChartColour>& chart) {
  ColourStrips picture;
  picture.title = "Interference colours of this lamp, these polarizers and this camera";
  picture.label = "retardance at 589.3 nm (nm)";
  picture.high = kNmPerUm * chart.back().retardance_um;
  ColourStrips::Strip eye{"to the eye", {}}, camera{"by the camera, white balanced", {}};
  for (const ChartColour& one : chart) {
    eye.colours.push_back(one.screen);
    if (one.channels.size() == 3)
      camera.colours.push_back({srgb_code(one.channels[0]), srgb_code(one.channels[1]), srgb_code(one.channels[2])});
  }
  picture.strips.push_back(std::move(eye));
  if (!camera.colours.empty()) picture.strips.push_back(std::move(camera));
  picture.doubles_label = "looks most like (nm)";
  picture.steps = {{1, "CIEDE2000 below 1: not told apart"}, {3, "below 3"}, {10, "below 10: side by side"}};
  for (const ChartColour& one : chart)
    picture.doubles.push_back({kNmPerUm * one.retardance_um, kNmPerUm * one.double_um, one.distance});
  return picture;
}

/// A band of the colours, three bytes a pixel.
std::vector<unsigned char> band_of(const std::vector<ChartColour>& chart, int height) {
  std::vector<unsigned char> row, all;
  for (const ChartColour& one : chart)
    for (const double code : one.screen)
      row.push_back(static_cast<unsigned char>(std::lround(255 * std::clamp(code, 0.0, 1.0))));
  for (int y = 0; y < height; ++y) all.insert(all.end(), row.begin(), row.end());
  return all;
}

/// Scenes of all channels of the light; UserError where there is a line.
std::vector<Scene> scenes_of(const Config& config) {
  if (!config.scene.microscope.channel_light)
    throw UserError({config.path.string()}, "michel-levy needs light of all wavelengths: a line has no colours",
                    "microscope: {light: {lamp: A}, camera: {sensitivity: nikon_d5100}}, micrograph: {channel: rgb}");
  std::vector<Scene> scenes = config.colours.empty() ? std::vector<Scene>{config.scene} : config.colours;
  for (const Scene& scene : scenes)
    if (!scene.microscope.crosstalk.empty())
      throw UserError({config.path.string()},
                      "michel-levy takes each channel for itself: camera.crosstalk is not known",
                      "take it out, or give the mixed channels as a camera of their own: sensitivity: FILE");
  return scenes;
}

/// The pictures of a fit as fractions of white, and the pixels that all of them have.
std::pair<std::vector<Image>, Mask> fractions_of_white(const Config& config) {
  std::vector<Image> channels;
  Mask mask;
  for (const Measurement& measurement : config.job.measurements) {
    const Picture* picture = std::get_if<Picture>(&measurement);
    if (!picture) continue;
    const Parameter &gain = config.job.parameters[picture->gain], &offset = config.job.parameters[picture->offset];
    if (gain.free || offset.free)
      throw UserError({config.path.string()}, "a colour is a retardance only against a known white and black",
                      "give calibration frames (dark, parallel), or micrograph.gain (counts of white) and offset");
    Image fraction = picture->values;
    for (double& value : fraction.values()) value = (value - offset.value) / gain.value;
    if (mask.empty()) mask = Mask(fraction.width(), fraction.height(), 1);
    if (mask.width() != fraction.width() || mask.height() != fraction.height())
      throw UserError({config.path.string()}, "the pictures of the channels differ in size");
    for (std::size_t i = 0; i < mask.size(); ++i) mask.values()[i] &= picture->mask.values()[i];
    channels.push_back(std::move(fraction));
  }
  return {std::move(channels), std::move(mask)};
}

Image times(Image image, double factor) {
  for (double& value : image.values()) value *= factor;
  return image;
}

int run_michel_levy(const MichelLevyArguments& arguments) {
  const bool maps = !arguments.image.empty();
  const std::optional<std::filesystem::path> image =
      maps ? std::optional<std::filesystem::path>(arguments.image) : std::nullopt;
  const Config config = load_config(arguments.config, maps ? ConfigUse::fit : ConfigUse::render, image, arguments.set);
  std::vector<Scene> scenes;
  if (maps) {
    for (const Measurement& measurement : config.job.measurements)
      if (const Picture* picture = std::get_if<Picture>(&measurement)) scenes.push_back(picture->scene);
    scenes_of(config);
  } else {
    scenes = scenes_of(config);
  }
  OutputFolder folder(arguments.out);
  const std::filesystem::path out = arguments.out;
  const Theta theta = config.job.parameters.values();
  const std::vector<ChartColour> chart = interference_chart(scenes, theta, arguments.up_to_um, kStepUm);
  constexpr int kBandHeight = 120;
  const std::vector<unsigned char> png =
      encode_png(band_of(chart, kBandHeight), static_cast<int>(chart.size()), kBandHeight, 3);
  std::vector<FileContent> files{{out / "michel_levy.csv", table_of(chart)},
                                 {out / "michel_levy.svg", svg_file(strips_of(chart))},
                                 {out / "michel_levy.png", std::string(png.begin(), png.end())}};
  if (!arguments.quiet) print_warnings(config.job.warnings);
  std::string said = fmt::format("{}: colours of retardances up to {:g} nm\n", printable(arguments.out),
                                 kNmPerUm * arguments.up_to_um);
  bool described = true;
  if (maps) {
    const auto [channels, mask] = fractions_of_white(config);
    const RetardanceMap map = retardance_map(camera_curve(scenes, theta, arguments.up_to_um), channels, mask,
                                             arguments.noise, arguments.threads);
    const std::pair<const char*, Image> pictures[] = {{"retardance_nm.tif", times(map.retardance_um, kNmPerUm)},
                                                      {"error_nm.tif", times(map.error_um, kNmPerUm)},
                                                      {"rival_nm.tif", times(map.rival_um, kNmPerUm)},
                                                      {"rival_odds.tif", map.rival_odds},
                                                      {"chi_square.tif", map.chi_square}};
    for (const auto& [name, picture] : pictures) files.push_back({out / name, encode_image(picture, out / name)});
    said += fmt::format(
        "retardances of {} pixels, {} of them without a rival of odds above 1 in 20 (noise of {:g} of white)\n",
        map.used, map.settled, arguments.noise);
    if (map.unlike > 0)
      said += fmt::format(
          "the colours of {} pixels are those of no retardance within that noise (chi-square beyond 1 in 1000): errors "
          "and rivals there allow for what is left. Are white and black right (exposure, white balance, transfer), the "
          "lamp and the camera?\n",
          map.unlike);
    described = 2 * map.unlike <= map.used;
    if (!described) said += "No answer: that is more than half of the picture.\n";
  }
  write_files(files);
  folder.keep();
  if (!arguments.quiet) std::cout << said;
  return described ? kExitDone : kExitNoAnswer;
}

}  // namespace

Command add_michel_levy_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("michel-levy", "interference colours of the config's lamp, polarizers and camera");
  auto arguments = std::make_shared<MichelLevyArguments>();
  command->add_option("CONFIG", arguments->config, "the config (YAML), with light.lamp")->required();
  add_set_option(*command, arguments->set);
  command->add_option("--out", arguments->out, "folder for chart and maps (default out/michel_levy)");
  command->add_option("--image", arguments->image, "a photograph: the retardance of every pixel from its colour");
  command->add_option("--largest", arguments->up_to_um, "largest retardance of the chart and of maps (um, default 3)")
      ->check(CLI::Range(0.2, 20.0));
  command->add_option("--noise", arguments->noise, "standard deviation of a pixel's channels, of white (default 0.01)")
      ->check(CLI::Range(1e-6, 1.0));
  add_threads_option(*command, arguments->threads);
  command->add_flag("-q,--quiet", arguments->quiet, "print nothing");
  return {command, [arguments] { return run_michel_levy(*arguments); }};
}

}  // namespace birefit
