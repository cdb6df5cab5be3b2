#include "io/images/asked.h"

#include <algorithm>
#include <array>
#include <cctype>

#include <fmt/format.h>

namespace birefit {

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

void refuse_image(const ImageRequest& request, const std::string& found, const std::string& hint) {
  Where where = request.where;
  std::string what = "image '" + request.path.string() + "' " + found;
  throw UserError(std::move(where), std::move(what), hint);
}

void check_image_size(const ImageRequest& request, int width, int height) {
  constexpr int kLargestSide = 16384;
  if (width > kLargestSide || height > kLargestSide)
    refuse_image(request,
                 fmt::format("is {} x {} pixels; at most {} on a side can be read", width, height, kLargestSide),
                 "crop it to the object, or bin it");
}

PixelRect part_asked(const ImageRequest& request, int width, int height) {
  PixelRect part{0, 0, width, height};
  if (!request.region) return part;
  const PixelRect& region = *request.region;
  part = {std::max(region.x0, 0), std::max(region.y0, 0), std::min(region.x1, width), std::min(region.y1, height)};
  return part.width() > 0 && part.height() > 0 ? part : PixelRect{};
}

std::vector<StoredChannel> channels_of_array(std::size_t count) {
  std::vector<StoredChannel> stored(count);
  if (count == 4) stored[3].no_light = true;
  return stored;
}

std::vector<int> channels_asked(const ImageRequest& request, const std::vector<StoredChannel>& stored, bool palette,
                                std::vector<std::string>& notes) {
  static const std::array<std::string, 4> kChoices = {"r", "g", "b", "mean"};
  const std::string choice = lower_case(request.channel);
  const bool by_number = !choice.empty() && choice.find_first_not_of("0123456789") == std::string::npos;
  if (!choice.empty() && !by_number && std::find(kChoices.begin(), kChoices.end(), choice) == kChoices.end())
    throw UserError(request.where, "channel: '" + request.channel + "' is none of r, g, b, mean, nor a number",
                    "choose one of them, or the channel's number, from 0");

  std::vector<int> colours;
  std::array<int, 3> rgb = {-1, -1, -1};
  std::array<bool, 3> layer{}, again{};  ///< it is of a layer with a name; there is another one like it
  std::string names;
  const int count = static_cast<int>(stored.size());
  for (int c = 0; c < count; ++c) {
    const std::string& name = stored[static_cast<std::size_t>(c)].name;
    const std::string last = lower_case(name.substr(name.rfind('.') + 1));
    names += (c ? ", " : "") + (name.empty() ? std::to_string(c) : name);
    if (stored[static_cast<std::size_t>(c)].no_light || last == "a" || last == "alpha") continue;
    colours.push_back(c);
    // Of layers the one without a name is the picture; of several with names, whoever asks has to say which.
    const bool named = name.find('.') != std::string::npos;
    for (int i = 0; i < 3; ++i) {
      if (last != std::array{"r", "g", "b"}[i] && last != std::array{"red", "green", "blue"}[i]) continue;
      if (rgb[i] < 0 || (layer[i] && !named))
        rgb[i] = c, layer[i] = named, again[i] = false;
      else
        again[i] = again[i] || layer[i] == named;
    }
  }
  if (by_number) {
    const int number = choice.size() < 9 ? std::stoi(choice) : count;
    if (number >= count)
      refuse_image(request, fmt::format("has no channel {}: it has {} ({})", choice, count, names),
                   "channels count from 0");
    if (count > 1 && std::find(colours.begin(), colours.end(), number) == colours.end())
      notes.push_back(fmt::format("channel {} is called {}: what is covered, and no light, as a rule", number,
                                  stored[static_cast<std::size_t>(number)].name));
    return {number};
  }
  if (colours.size() < stored.size()) notes.push_back("alpha channel ignored");
  if (colours.empty() && count == 1) colours.push_back(0);
  if (colours.size() == 1) {
    if (!choice.empty() && !request.mask && !request.cells)
      notes.push_back("channel: " + choice + " has no effect: the image is grey");
    return colours;
  }
  if (colours.size() == 3 && std::count(rgb.begin(), rgb.end(), -1) == 3) std::copy_n(colours.begin(), 3, rgb.begin());
  if (std::count(rgb.begin(), rgb.end(), -1) > 0)
    refuse_image(request,
                 fmt::format("has {} channels ({}) that are neither grey nor red, green and blue", count, names),
                 "add `channel: 0` for the first, or save the one to be fitted as a grey image");
  if (again[0] || again[1] || again[2])
    refuse_image(request, fmt::format("has several layers of colours ({})", names),
                 "choose by number, from 0: `channel: 0`");
  if (choice.empty())
    refuse_image(
        request,
        fmt::format("has colour channels ({}{}) and none is chosen", names, palette ? ", expanded from a palette" : ""),
        "add `channel: r`, `g`, `b` or `mean` (their plain average)");
  if (choice == "mean") return {rgb[0], rgb[1], rgb[2]};
  return {rgb[choice == "r" ? 0 : choice == "g" ? 1 : 2]};
}

}  // namespace birefit
