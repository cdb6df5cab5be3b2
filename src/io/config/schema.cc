#include "io/config/schema.h"

#include <cmath>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "birefit/scene.h"
#include "io/config/described.h"

namespace birefit {
namespace {

using Json = nlohmann::ordered_json;

Json plain_number(const NumberSpec& spec) {
  Json json = {{"type", "number"}};
  if (std::isfinite(spec.lower)) json[spec.lower_open ? "exclusiveMinimum" : "minimum"] = spec.lower;
  if (std::isfinite(spec.upper)) json[spec.upper_open ? "exclusiveMaximum" : "maximum"] = spec.upper;
  return json;
}

/// A number that is tied to others, or arithmetic: a sign between two numbers or names, a function, a path of keys.
Json expression() {
  return {{"type", "string"},
          {"description", "tied to other numbers: 2 * sample.cell.thickness_um"},
          {"pattern", "[*^(]|[0-9]/| [-+/] |[A-Za-z_]\\.[A-Za-z_]"}};
}

/// The forms of a number: known as well as such numbers are, to a standard deviation or exactly; fitted; with a prior.
Json number_schema(const NumberSpec& spec, const std::string& words) {
  Json fit = {{{"type", "array"}, {"items", {{"type", "number"}}}, {"minItems", 2}, {"maxItems", 2}}};
  if (spec.automatic) fit.push_back({{"const", "auto"}});
  const Json parameter = {{"type", "object"},
                          {"properties",
                           {{"value", {{"anyOf", {plain_number(spec), expression()}}}},
                            {"fit", {{"anyOf", std::move(fit)}}},
                            {"prior_sd", {{"type", "number"}, {"exclusiveMinimum", 0}}},
                            {"exact", {{"type", "boolean"}}}}},
                          {"additionalProperties", false}};
  Json json = {{"description", words + (spec.unit.empty() ? "" : " (" + spec.unit + ")")},
               {"anyOf", {plain_number(spec), parameter, expression()}}};
  if (spec.fallback) json["default"] = *spec.fallback;
  return json;
}

/// The place of a key in a block, "light.wavelength_nm" in that of light.
Json& place_of(Json& block, const std::string& key) {
  const std::size_t dot = key.find('.');
  Json& place = block["properties"][key.substr(0, dot)];
  if (dot == std::string::npos) return place;
  place["type"] = "object";
  return place_of(place, key.substr(dot + 1));
}

/// Writes what a struct describes of its own numbers into the schema of its block.
struct SchemaVisitor {
  Json& block;
  void number(const char* key, ParameterRef&, const NumberSpec& spec, const char* words) {
    if (spec.implied) return;
    const std::string path = key;
    // Two numbers of a list: [x, y], [low, high].
    if (const std::size_t dot = path.rfind('.'); dot != std::string::npos && path.substr(0, dot).ends_with("_px")) {
      Json& pair = place_of(block, path.substr(0, dot));
      pair["items"] = number_schema(spec, words);
      pair["minItems"] = pair["maxItems"] = 2;
      return;
    }
    place_of(block, path) = number_schema(spec, words);
  }
  void vector(const char* key, std::array<ParameterRef, 3>&, const NumberSpec& spec, const char* words) {
    place_of(block, key) = {{"type", "array"}, {"items", number_schema(spec, words)}, {"minItems", 3}, {"maxItems", 3}};
  }
  void list(const char* key, std::vector<ParameterRef>&, const NumberSpec& spec, const char* words) {
    place_of(block, key) = {{"type", "array"}, {"items", number_schema(spec, words)}};
  }
  template <class Part>
  void inside(const char*, Part&) {}
};

template <class T>
void add(Json& block, const std::string& path = {}) {
  Json& place = path.empty() ? block : place_of(block, path);
  place["type"] = "object";
  T object;
  T::describe(object, SchemaVisitor{place});
}

/// One key of each kind of a variant.
template <class Variant>
void add_kinds(Json& block, const std::string& path) {
  each_kind<Variant>([&]<class One>(const One*) { add<One>(block, path + "." + One::kKey); });
  Json& place = place_of(block, path);
  place["minProperties"] = place["maxProperties"] = 1;
}

Json sample_schema() {
  Json sample = {{"type", "object"}, {"description", "what is in front of the microscope: one kind of sample"}};
  add<Droplet>(sample, "droplet");
  add_kinds<decltype(Droplet::director)>(sample, "droplet.director");
  add<Droplet>(sample, "shell");
  add<ShellDirector>(sample, "shell");
  add<Cell>(sample, "cell");
  add_kinds<decltype(Cell::director)>(sample, "cell.director");
  add<Plate>(sample, "plate");
  add<HeatStep>(sample, "plate.heat");
  add<SideCamera>(sample, "plate.view.camera");
  add<Crystal>(sample, "crystal");
  add<StressedDisc>(sample, "disc");
  add<SampledVolume>(sample, "volume");
  add<Slab>(sample, "slab");
  add<SideCamera>(sample, "slab.view.camera");
  return sample;
}

Json text(const char* words) { return {{"type", "string"}, {"description", words}}; }

Json microscope_schema() {
  Json microscope = {{"type", "object"}, {"description", "what lights and images the sample"}};
  add<Microscope>(microscope);
  for (const char* key : {"polarizer_deg", "analyzer_deg"})
    microscope["properties"][key]["anyOf"].push_back({{"const", "none"}});
  Json& light = microscope["properties"]["light"]["properties"];
  Json lamp = {{"type", "object"}}, filter = {{"type", "object"}};
  add<Lamp>(lamp);
  add<LightFilter>(filter);
  for (Json* given : {&lamp, &filter}) {
    (*given)["properties"]["file"] = text("table of wavelength_nm and a value");
    (*given)["additionalProperties"] = false;
  }
  light["lamp"] = {{"description", "in place of wavelength_nm: light of all wavelengths"},
                   {"anyOf", {{{"enum", {"A", "D65", "E"}}}, lamp}}};
  light["filters"] = {{"description", "what the lamp's light passes"}, {"type", "array"}, {"items", filter}};
  Json camera = {{"type", "object"}, {"additionalProperties", false}};
  camera["properties"]["sensitivity"] = text("cie_1931, nikon_d5100, or a table of wavelength_nm and r, g, b");
  Json shares = {{"type", "object"}, {"additionalProperties", false}};
  for (const char* of : {"r", "g", "b"}) add<Crosstalk>(shares, of);
  for (auto& [of, row] : shares["properties"].items()) {
    const Json share = row["properties"]["share"];
    row = {{"type", "object"}, {"additionalProperties", false}};
    for (const char* other : {"r", "g", "b"})
      if (other != of) row["properties"][other] = share;
  }
  camera["properties"]["crosstalk"] = shares;
  microscope["properties"]["camera"] = camera;
  Json part = {{"type", "object"}};
  each_kind<PolarizingPart>([&]<class One>(const One*) { add<One>(part, One::kKey); });
  for (const char* key : {"before", "behind"}) microscope["properties"][key] = {{"type", "array"}, {"items", part}};
  return microscope;
}

Json one_of(const char* words, const std::vector<std::string>& values) {
  return {{"description", words}, {"enum", values}};
}

Json micrograph_schema() {
  Json micrograph = {{"type", "object"}, {"description", "the image, and what all images have in common"}};
  add<View>(micrograph);
  Json& keys = micrograph["properties"];
  keys["image"] = text("file, from the config's folder on");
  keys["mask"] = text("image of the same size; pixels of value 0 are left out");
  keys["mosaic"] = {{"description", "pixels that see different things in cells of 2 x 2"}};
  keys["bayer"] = one_of("first cell of a colour sensor's filters", {"rggb", "bggr", "grbg", "gbrg"});
  keys["bin"] = {{"description", "so many pixels of the file along a side are one of the picture, their mean"},
                 {"type", "integer"},
                 {"minimum", 1}};
  keys["roi_px"] = {{"description", "[x0, y0, x1, y1], the ends exclusive"},
                    {"type", "array"},
                    {"items", {{"type", "integer"}}},
                    {"minItems", 4},
                    {"maxItems", 4}};
  keys["saturation_counts"] = {{"description", "counts from which a pixel is saturated"}, {"type", "number"}};
  for (const auto& [key, words] : std::vector<std::pair<const char*, const char*>>{
           {"metadata", "ignore: what the file states of objective and light does not count"},
           {"page", "of a file of several, from 0; or {t, z, c}"},
           {"channel", "r, g, b, rgb (all three), mean, or a number from 0"},
           {"channels", "r, g, b: parameter paths and what that colour of rgb has for itself"},
           {"transfer", "how codes follow light: linear, srgb, {gamma: ..}, {file: ..}"},
           {"gain", "value = gain * intensity + offset"},
           {"offset", "value = gain * intensity + offset"},
           {"illumination", "uneven light: x, y, square"},
           {"background", "uneven background: x, y, square"},
           {"noise", "read_counts, counts_per_photon, black_counts"},
           {"calibration", "frames: dark, parallel or flat, crossed"}})
    keys[key] = {{"description", words}};
  // A list, or {fit: auto}; pixels that are square may have two sizes.
  for (const char* key : {"center_px", "pixel_size_um"}) {
    Json given = std::move(keys[key]);
    const Json other = std::string(key) == "center_px" ? Json{{"type", "object"}} : Json{{"type", "array"}};
    Json words = given.contains("description") ? given["description"] : Json("[x, y] of the sample, or {fit: auto}");
    keys[key] = {{"description", words}, {"anyOf", {given, other}}};
  }
  micrograph["additionalProperties"] = false;
  return micrograph;
}

}  // namespace

std::string config_schema() {
  Json schema = {
      {"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", "birefit config"}, {"type", "object"}};
  Json& keys = schema["properties"];
  keys["micrograph"] = micrograph_schema();
  keys["micrographs"] = {{"description", "several images: a list of {image, page, set}, or {files, set_from, ..}"},
                         {"type", {"array", "object"}}};
  keys["signal"] = {{"description", "a table in place of images, or a list of tables"}, {"type", {"array", "object"}}};
  keys["sample"] = sample_schema();
  keys["microscope"] = microscope_schema();
  for (const auto& [key, words] : std::vector<std::pair<const char*, const char*>>{
           {"calibration", "frames that turn counts into transmission: dark, parallel or flat, crossed"},
           {"accuracy", "numerical error to hold: intensity"},
           {"physics", "ceiling, rays, max_seconds, model_tolerance"},
           {"transport", "method"},
           {"prior", "from an earlier fit: from, parameters"},
           {"fit", "max_iterations, threads, scan_pixels, scan_candidates, outliers"}})
    keys[key] = {{"description", words}, {"type", "object"}};
  keys["image_size_px"] = {{"description", "[width, height] of a picture that is only rendered"},
                           {"type", "array"},
                           {"items", {{"type", "integer"}, {"minimum", 1}}},
                           {"minItems", 2},
                           {"maxItems", 2}};
  keys["report"] = {{"description", "quantities that follow from numbers of the config, by name: expressions"},
                    {"type", "object"},
                    {"additionalProperties", {{"type", "string"}}}};
  schema["additionalProperties"] = false;
  return schema.dump(2) + "\n";
}

}  // namespace birefit
