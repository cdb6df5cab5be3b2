#include "io/kinds/from_image.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <regex>
#include <sstream>

#include <fmt/format.h>

#include "birefit/error.h"
#include "birefit/io.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

constexpr double kLeastContrast = 3;  ///< of a disc, DiscGuess::contrast

/// The lines of a config, to be found by how they begin.
class Lines {
 public:
  explicit Lines(const std::string& text) {
    std::istringstream stream(text);
    for (std::string line; std::getline(stream, line);) lines_.push_back(line);
  }

  /// The first line that begins with blanks and `start`, or nothing.
  std::optional<std::size_t> find(const std::string& start) const {
    for (std::size_t i = 0; i < lines_.size(); ++i)
      if (const std::size_t at = lines_[i].find_first_not_of(' ');
          at != std::string::npos && lines_[i].compare(at, start.size(), start) == 0)
        return i;
    return std::nullopt;
  }
  /// Replaces what follows the blanks of a line; several lines at once take its blanks.
  void replace(std::size_t i, const std::vector<std::string>& with) {
    const std::string blanks(lines_[i].find_first_not_of(' '), ' ');
    lines_.erase(lines_.begin() + static_cast<std::ptrdiff_t>(i));
    for (std::size_t k = 0; k < with.size(); ++k)
      lines_.insert(lines_.begin() + static_cast<std::ptrdiff_t>(i + k), blanks + with[k]);
  }
  void erase(std::size_t i) { lines_.erase(lines_.begin() + static_cast<std::ptrdiff_t>(i)); }
  const std::vector<std::string>& all() const { return lines_; }
  std::string text() const {
    std::string out;
    for (const std::string& line : lines_) out += line + "\n";
    return out;
  }

 private:
  std::vector<std::string> lines_;
};

std::string quoted(const std::string& path) {
  std::string out = "\"";
  for (const char c : path)
    if (c == '\n')
      out += "\\n";
    else
      out += (c == '"' || c == '\\') ? std::string("\\") + c : std::string(1, c);
  return out + "\"";
}

void fill_image(const std::string& file, const OpenedImage& opened, const Stated& stated, Lines& lines,
                FilledConfig& filled) {
  const LoadedImage& image = opened.image;
  std::vector<std::string> keys = {fmt::format("image: {}   # {} x {} pixels, {}", quoted(file), image.values.width(),
                                               image.values.height(),
                                               image.bits == 32 ? "floats" : fmt::format("{} bit", image.bits))};
  filled.found.push_back(fmt::format("{} x {} pixels of {}", image.values.width(), image.values.height(),
                                     image.bits == 32 ? "floats" : fmt::format("{} bit", image.bits)));
  if (opened.first_page) {
    keys.push_back("page: 0                    # the first of several");
    filled.found.push_back("several pages: the first is taken, page: 0");
  }
  if (const auto& region = stated.region)
    keys.push_back(fmt::format("roi_px: [{}, {}, {}, {}]   # x0, y0, x1, y1, end exclusive", region->x0, region->y0,
                               region->x1, region->y1));
  if (image.colour) {
    keys.push_back("channel: g                 # r, g, b or mean");
    filled.found.push_back("colour channels: green is taken, channel: g");
    filled.missing.push_back(
        "was there a filter or a laser? Then state microscope.light.wavelength_nm and bandwidth_nm. A channel of a "
        "colour camera passes light about 100 nm wide: white light is fitted in all colours by channel: rgb, light: "
        "{lamp: A} and camera: {sensitivity: nikon_d5100}");
    if (image.bits == 8) {
      keys.push_back("transfer: srgb             # how codes follow light: linear where the camera wrote raw values");
      filled.missing.push_back(
          "are the codes sRGB? Those of photographs of 8 bit are, which transfer: srgb takes them for; of a camera "
          "that wrote raw values state transfer: linear");
    }
  }
  if (const auto line = lines.find("image: ")) return lines.replace(*line, keys);
  // A list names its images itself; what is said of how they are read stands in the block they share.
  const auto block = lines.find("micrograph:");
  if (!block) return;
  keys.erase(keys.begin());
  for (std::string& key : keys) key = "  " + key;
  keys.insert(keys.begin(), lines.all()[*block]);
  lines.replace(*block, keys);
}

/// The pixel's size; 0 when the file does not state it.
double fill_pixel_size(const LoadedImage& image, const Stated& stated, Lines& lines, FilledConfig& filled) {
  const auto line = lines.find("pixel_size_um:");
  if (!line) return 0;
  if (stated.pixel_um > 0) {
    lines.replace(*line, {fmt::format("pixel_size_um: {:.6g}   # on the sample", stated.pixel_um)});
    return stated.pixel_um;
  }
  if (image.pixel_size_um > 0) {
    lines.replace(
        *line, {fmt::format("pixel_size_um: {:.6g}   # as the file states it: on the sample?", image.pixel_size_um)});
    filled.found.push_back(fmt::format("pixels of {:.6g} um", image.pixel_size_um));
    return image.pixel_size_um;
  }
  lines.replace(*line, {"# pixel_size_um: 0.05      # MISSING: size of a pixel on the sample, um"});
  filled.missing.push_back("micrograph.pixel_size_um: the file does not state how large a pixel is on the sample");
  return 0;
}

/// Where the object is: as it was drawn, or as it is found in the image or its region.
DiscGuess disc_of(const LoadedImage& image, const Stated& stated) {
  if (const auto& circle = stated.circle) return {(*circle)[0], (*circle)[1], (*circle)[2], kLeastContrast};
  const PixelRect whole{0, 0, image.values.width(), image.values.height()};
  const PixelRect region = stated.region.value_or(whole);
  if (region.x0 < 0 || region.y0 < 0 || region.x1 > whole.x1 || region.y1 > whole.y1 || region.width() < 1 ||
      region.height() < 1)
    throw UserError({}, "the region is not within the picture", "draw it anew");
  DiscGuess disc = find_disc(cropped(image.values, region), Mask(region.width(), region.height(), 1));
  disc.center_x_px += region.x0, disc.center_y_px += region.y0;
  return disc;
}

void fill_disc(const Kind& kind, const LoadedImage& image, const Stated& stated, double pixel_um, Lines& lines,
               FilledConfig& filled) {
  const auto line = lines.find("diameter_um:");
  if (!line) return;
  const DiscGuess disc = disc_of(image, stated);
  if (!(disc.contrast >= kLeastContrast)) {
    filled.missing.push_back("no disc is visible: state micrograph.center_px and sample." + kind.name + ".diameter_um");
    return;
  }
  const std::string whose = stated.circle ? "of the circle drawn" : "of the disc found";
  filled.found.push_back(fmt::format("a {} of {:.4g} px around ({:.4g}, {:.4g})", stated.circle ? "circle" : "disc",
                                     2 * disc.radius_px, disc.center_x_px, disc.center_y_px));
  // What was drawn is a start: the picture knows better by a few pixels.
  if (const auto centre = lines.find("center_px:"); centre && stated.circle && kind.name != "disc") {
    const double x = disc.center_x_px, y = disc.center_y_px, room = std::max(2.0, 0.3 * disc.radius_px);
    lines.replace(*centre, {fmt::format("center_px: [{{value: {:.1f}, fit: [{:.1f}, {:.1f}]}}, {{value: {:.1f}, fit: "
                                        "[{:.1f}, {:.1f}]}}]   # as drawn",
                                        x, x - room, x + room, y, y - room, y + room)});
  }
  if (kind.name == "disc") {
    if (const auto centre = lines.find("center_px:"))
      lines.replace(*centre,
                    {fmt::format("center_px: [{:.1f}, {:.1f}]   # {}", disc.center_x_px, disc.center_y_px, whose)});
  }
  if (!(pixel_um > 0)) {
    lines.replace(*line, {kind.name == "disc"
                              ? fmt::format("diameter_um: 12000         # MISSING: {:.4g} px times the pixel's size",
                                            2 * disc.radius_px)
                              : std::string("diameter_um: {fit: auto}   # from the disc found")});
    if (kind.name == "disc") filled.missing.push_back("sample.disc.diameter_um: it follows from the pixel's size");
    return;
  }
  const double diameter = 2 * disc.radius_px * pixel_um;
  lines.replace(*line,
                {kind.name == "disc" ? fmt::format("diameter_um: {:.4g}   # {}", diameter, whose)
                                     : fmt::format("diameter_um: {{value: {:.4g}, fit: [{:.4g}, {:.4g}]}}   # {}",
                                                   diameter, 0.8 * diameter, 1.25 * diameter, whose)});
}

/// `micrographs:` of one image, with the numbers of the first.
void fill_list(const std::string& file, Lines& lines, FilledConfig& filled) {
  const auto list = lines.find("micrographs:");
  if (!list) return;
  std::size_t at = *list + 1;
  static const std::regex name("image: [^,}]*");
  std::string item = lines.all().at(at);
  if (std::smatch found; std::regex_search(item, found, name))
    item.replace(static_cast<std::size_t>(found.position()), static_cast<std::size_t>(found.length()),
                 "image: " + quoted(file));
  while (at < lines.all().size() && lines.all()[at].starts_with("  ")) lines.erase(at);
  lines.replace(*list, {lines.all()[*list], item,
                        "  # - {image: .., set: {..}}   # and so on: one image tells less than the fit asks for"});
  filled.missing.push_back("micrographs: more images, each with what it was taken with under `set`");
}

/// Numbers of the sample and the microscope that stand there as known.
void list_assumed(const Lines& lines, FilledConfig& filled) {
  static const std::regex number("([a-z_0-9]+): (-?[0-9.]+)");
  bool of_image = false;
  for (const std::string& line : lines.all()) {
    if (line.starts_with("micrograph") || line.starts_with("calibration")) of_image = true;
    if (line.starts_with("sample") || line.starts_with("microscope")) of_image = false;
    const std::string read = line.substr(0, line.find('#'));
    if (of_image) continue;
    for (auto it = std::sregex_iterator(read.begin(), read.end(), number); it != std::sregex_iterator(); ++it)
      if ((*it)[1] != "value") filled.assumed.push_back((*it)[1].str() + " " + (*it)[2].str());
  }
}

}  // namespace

OpenedImage open_image(const std::string& file) {
  std::optional<UserError> first;
  for (const bool page : {false, true})
    for (const char* channel : {"", "g"}) {
      ImageRequest request{file, page ? std::optional<int>(0) : std::nullopt, channel, {file}};
      try {
        return {load_image(request), page};
      } catch (const UserError& error) {
        if (!first) first = error;
      }
    }
  throw *first;
}

FilledConfig config_from_image(const Kind& kind, const std::string& file, const Stated& stated) {
  Lines lines(kind.config);
  if (!lines.find("micrograph:") && !lines.find("micrographs:") && kind.command != "series")
    throw UserError({}, "new " + kind.name + ": its config reads no image", "birefit new " + kind.name + " prints it");
  const OpenedImage opened = open_image(file);
  const std::string name = stated.file_name.empty() ? file : stated.file_name;
  FilledConfig filled;
  if (kind.command == "series") {
    const fs::path path(name);
    const std::string pattern = (path.parent_path() / ("*" + path.extension().string())).string();
    lines.replace(*lines.find("files:"), {fmt::format("files: {}   # * any letters, ? one", quoted(pattern))});
  } else {
    fill_list(name, lines, filled);
  }
  fill_image(name, opened, stated, lines, filled);
  const double pixel_um = fill_pixel_size(opened.image, stated, lines, filled);
  fill_disc(kind, opened.image, stated, pixel_um, lines, filled);
  for (const std::string& note : opened.image.notes) filled.found.push_back(note);
  list_assumed(lines, filled);
  filled.text = lines.text();
  return filled;
}

}  // namespace birefit
