#include "view/beginning.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "io/config/edit.h"
#include "io/kinds/kinds.h"

namespace birefit::view {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kThumbnail = 96;  // px

std::string text_in(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

/// Kinds of which one image can be fitted.
bool takes_image(const Kind& kind) { return kind.command == "fit" && !kind.pictures.empty(); }

const Kind& kind_in(const std::string& name) {
  for (const Kind& kind : kinds())
    if (kind.name == name && takes_image(kind)) return kind;
  throw UserError({}, name + " is no kind of sample that an image is fitted to");
}

/// The middle of a picture as means over squares, so many to a side.
Image small(const Image& picture, int pixels) {
  const int side = std::min(picture.width(), picture.height());
  const int left = (picture.width() - side) / 2, top = (picture.height() - side) / 2;
  const auto begin = [&](int i) { return i * side / pixels; };
  Image means(pixels, pixels);
  for (int j = 0; j < pixels; ++j)
    for (int i = 0; i < pixels; ++i) {
      double sum = 0;
      int n = 0;
      for (int y = begin(j); y < std::max(begin(j + 1), begin(j) + 1); ++y)
        for (int x = begin(i); x < std::max(begin(i + 1), begin(i) + 1); ++x, ++n) sum += picture(left + x, top + y);
      means(i, j) = sum / n;
    }
  return means;
}

/// From the darkest to the brightest pixel; grey where all are alike.
std::string as_bytes(const Image& picture) {
  const auto [low, high] = std::minmax_element(picture.values().begin(), picture.values().end());
  if (!(*high - *low > 1e-6)) return std::string(picture.size(), '\x80');
  const double bottom = *low, scale = 255 / (*high - *low);
  std::string bytes;
  for (const double value : picture.values()) bytes += static_cast<char>(std::lround((value - bottom) * scale));
  return bytes;
}

}  // namespace

Beginning::Beginning(std::filesystem::path image)
    : image_(std::move(image)), loaded_(open_image(image_.string()).image) {}

std::string Beginning::description() const {
  Json json = {
      {"file", image_.filename().string()}, {"width", loaded_.values.width()}, {"height", loaded_.values.height()},
      {"pixel_um", loaded_.pixel_size_um},  {"thumbnail", kThumbnail},         {"kinds", Json::array()}};
  for (const Kind& kind : kinds())
    if (takes_image(kind)) json["kinds"].push_back({{"name", kind.name}, {"words", kind.words}});
  return text_in(json);
}

std::string Beginning::picture() const {
  std::vector<float> values(loaded_.values.values().begin(), loaded_.values.values().end());
  return {reinterpret_cast<const char*>(values.data()), sizeof(float) * values.size()};
}

std::string Beginning::thumbnail(const std::string& name) const {
  const std::lock_guard lock(guard_);
  for (const auto& [known, bytes] : thumbnails_)
    if (known == name) return bytes;
  std::string bytes;
  try {
    const Kind& kind = kind_in(name);
    double most = -1;
    for (const DemoPicture& picture : kind.pictures) {
      if (picture.dark) continue;
      std::vector<std::string> set = picture.set;
      set.push_back(
          "microscope.objective_na=");  // rays show what it looks like, waves take longer than people wait for
      const Image light = picture_of(kind, kind.name + ".yaml", kind.width, kind.height, set);
      const auto [low, high] = std::minmax_element(light.values().begin(), light.values().end());
      if (*high - *low <= most) continue;  // of several the one that shows most
      most = *high - *low;
      bytes = as_bytes(small(light, kThumbnail));
    }
  } catch (const UserError&) {
    // Of what its config names there may be no file here: the words have to do.
  }
  thumbnails_.emplace_back(name, bytes);
  return bytes;
}

std::string Beginning::grow(const Answers& answers) const {
  Stated stated = answers.stated;
  stated.file_name = image_.filename().string();  // the config will lie beside it
  FilledConfig filled = config_from_image(kind_in(answers.kind), image_.string(), stated);
  filled.text = with_numbers(filled.text, answers.numbers);
  Json json = {{"text", filled.text}, {"found", filled.found}, {"missing", filled.missing}, {"numbers", Json::array()}};
  for (const auto& [path, value] : known_numbers(filled.text))
    if (path.starts_with("sample.") || path.starts_with("microscope."))
      json["numbers"].push_back({{"path", path}, {"value", value}});
  return text_in(json);
}

Config Beginning::open(const std::string& text) const {
  std::filesystem::path config = image_;
  config.replace_extension(".yaml");
  return load_config_text(text, config, ConfigUse::fit);
}

}  // namespace birefit::view
