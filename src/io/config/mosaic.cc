#include "io/config/mosaic.h"

#include <array>

namespace birefit {
namespace {

/// Rows from the top, as the sensors of polarization cameras have them (Sony IMX250MZR, IMX264MZR and their kin).
constexpr std::array<std::array<double, 2>, 2> kUsualLayout = {{{90, 45}, {135, 0}}};

const YamlNode* find_mosaic_node(const YamlNode& root) {
  const YamlNode* micrograph = root.is_map() ? root.find("micrograph") : nullptr;
  return micrograph && micrograph->is_map() ? micrograph->find("mosaic") : nullptr;
}

std::string with_degrees(double angle) { return show(angle) + " deg"; }

/// [[90, 45], [135, 0]]: two rows of two angles.
void read_layout(ConfigReader& reader, const YamlNode& node, std::array<std::array<double, 2>, 2>& layout) {
  const std::string shape = "mosaic.polarization must be two rows of two angles, [[90, 45], [135, 0]]";
  const NumberSpec angle = numbers::angle(-360, 360);
  if (!node.is_sequence() || node.items.size() != 2) {
    reader.problems.add(node.where, shape + ", found " + (node.is_sequence() ? "a list" : node.describe()));
    return;
  }
  for (std::size_t y = 0; y < 2; ++y) {
    const YamlNode& row = node.items[y];
    if (!row.is_sequence() || row.items.size() != 2) {
      reader.problems.add(row.where, shape);
      return;
    }
    for (std::size_t x = 0; x < 2; ++x)
      layout[y][x] = reader.value_of(row.items[x], "mosaic.polarization", angle).value_or(layout[y][x]);
  }
}

}  // namespace

bool states_polarization_mosaic(const YamlNode& root) {
  const YamlNode* node = find_mosaic_node(root);
  return node && (node->is_map() || (node->is_scalar() && node->text == "polarization"));
}

MosaicSettings read_mosaic(ConfigReader& reader, const Block& micrograph, const std::string& channel) {
  MosaicSettings settings;
  const YamlNode *mosaic = micrograph.find("mosaic"), *bayer = micrograph.find("bayer");
  settings.where = mosaic ? mosaic->where : bayer ? bayer->where : micrograph.where;
  if (mosaic && bayer)
    reader.problems.add(bayer->where, "bayer is given beside mosaic", "a camera has one or the other");
  if (mosaic) {
    std::array<std::array<double, 2>, 2> layout = kUsualLayout;
    bool polarization = mosaic->is_map();
    if (polarization) {
      const Block block = reader.block(micrograph, "mosaic", {"polarization"}, true);
      if (const YamlNode* rows = block.find("polarization"))
        read_layout(reader, *rows, layout);
      else
        reader.missing(block, "polarization", "rows of angles, [[90, 45], [135, 0]]");
    } else {
      const auto word = reader.choice(micrograph, "mosaic", {"polarization", "none"});
      polarization = word == "polarization";
      settings.not_looked_for = word == "none";
    }
    if (polarization)
      for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 2; ++x) {
          const double angle = layout[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)];
          settings.parts.push_back({x, y, with_degrees(angle), angle});
        }
    if (polarization && !channel.empty())
      reader.problems.add(micrograph.find("channel")->where, "channel is given beside mosaic: polarization",
                          "its pixels have no colours: leave it out");
  } else if (bayer) {
    settings.bayer = reader.choice(micrograph, "bayer", {"rggb", "bggr", "grbg", "gbrg"}).value_or("");
    if (settings.bayer.empty()) return settings;
    if (channel != "r" && channel != "g" && channel != "b" && channel != "rgb") {
      const YamlNode* given = micrograph.find("channel");
      reader.problems.add(given ? given->where : bayer->where,
                          "bayer needs channel: r, g, b or rgb" + (channel.empty() ? "" : ", found " + channel),
                          "each colour is a picture of its own");
      return settings;
    }
    for (const char colour : channel)
      for (MosaicPart& part : bayer_parts(settings.bayer, colour)) settings.parts.push_back(std::move(part));
  }
  return settings;
}

std::vector<MosaicPart> bayer_parts(const std::string& bayer, char colour) {
  std::vector<MosaicPart> parts;
  for (int i = 0; i < 4; ++i)
    if (bayer.at(static_cast<std::size_t>(i)) == colour)
      parts.push_back({i % 2, i / 2, colour + (colour == 'g' ? std::to_string(parts.size() + 1) : ""), {}});
  return parts;
}

Mask part_of(const MosaicPart& part, int width, int height) {
  Mask pixels(width, height, 0);
  for (int y = part.y0; y < height; y += 2)
    for (int x = part.x0; x < width; x += 2) pixels(x, y) = 1;
  return pixels;
}

}  // namespace birefit
