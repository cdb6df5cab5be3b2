#include "io/images/stated_size.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <regex>

#include <fmt/format.h>

namespace birefit {
namespace {

constexpr double kLargestCrediblePixelUm = 20;  // 72, 96 and 300 dpi are 353, 265 and 85 um: meant for paper

/// Micrometres in one `unit`; 0 = no length we know.
double micrometres_in(std::string unit) {
  // The two micro signs of Unicode (U+00B5, U+03BC), ImageJ's escape and Latin-1.
  for (const char* micro : {"\xc2\xb5", "\xce\xbc", "\\u00B5", "\\u00b5", "\xb5"})
    if (unit.rfind(micro, 0) == 0) unit = "u" + unit.substr(std::strlen(micro));
  if (unit == "Mm") return 0;  // no millimetre
  std::transform(unit.begin(), unit.end(), unit.begin(), [](unsigned char c) { return std::tolower(c); });
  if (unit == "um" || unit == "micron" || unit == "microns" || unit == "micrometer" || unit == "micrometre") return 1;
  if (unit == "nm" || unit == "nanometer" || unit == "nanometre") return 1e-3;
  if (unit == "pm") return 1e-6;
  if (unit == "\xc3\x85" || unit == "\xc3\xa5" || unit == "angstrom") return 1e-4;
  if (unit == "mm" || unit == "millimeter" || unit == "millimetre") return 1e3;
  if (unit == "cm" || unit == "centimeter" || unit == "centimetre") return 1e4;
  if (unit == "m" || unit == "meter" || unit == "metre") return 1e6;
  if (unit == "in" || unit == "inch" || unit == "inches") return 25400;
  return 0;
}

std::string attribute_value(const std::string& tag, const std::string& name) {
  std::smatch match;
  const std::regex pattern("\\s" + name + "\\s*=\\s*[\"']([^\"']*)[\"']");
  if (!std::regex_search(tag, match, pattern)) return {};
  // As Python's ElementTree writes what is no ASCII.
  static const std::regex micro("&(#181|#[xX]0*[bB]5|#956|#[xX]0*3[bB][cC]|micro);");
  return std::regex_replace(match[1].str(), micro, "u");
}

}  // namespace

double number_or_zero(const std::string& text) {
  try {
    const double value = std::stod(text);
    return std::isfinite(value) && value > 0 ? value : 0;
  } catch (const std::exception&) {
    return 0;
  }
}

std::string imagej_value(const std::string& description, const std::string& key) {
  if (description.rfind("ImageJ=", 0) != 0) return {};
  const std::string start = "\n" + key + "=";
  const std::size_t at = description.find(start);
  if (at == std::string::npos) return {};
  const std::size_t end = description.find_first_of("\r\n", at + start.size());
  return description.substr(at + start.size(), end == std::string::npos ? end : end - at - start.size());
}

double stated_pixel_size_um(const StatedResolution& tags, const std::string& description,
                            std::vector<std::string>& notes, std::array<double, 2>& uneven_um) {
  const auto accept = [&](double x, double y, const std::string& source) -> double {
    if (y > 0 && std::abs(y / x - 1) > 0.01) {
      notes.push_back(fmt::format("{} states pixels that are not square ({:.5g} x {:.5g} um): ignored", source, x, y));
      uneven_um = {x, y};
      return 0;
    }
    notes.push_back(fmt::format("pixel size {:.5g} um from {}", x, source));
    return x;
  };

  if (description.find("<OME") != std::string::npos || description.find("<ome:OME") != std::string::npos) {
    double x = 0, y = 0;
    bool several = false;
    for (std::size_t at = description.find("Pixels"); at != std::string::npos;
         at = description.find("Pixels", at + 6)) {
      if (at == 0 || (description[at - 1] != '<' && description[at - 1] != ':')) continue;
      const std::string tag = description.substr(at, description.find('>', at) - at);
      const auto length = [&](const std::string& name) {
        const std::string unit = attribute_value(tag, name + "Unit");
        return number_or_zero(attribute_value(tag, name)) * (unit.empty() ? 1.0 : micrometres_in(unit));
      };
      const double this_x = length("PhysicalSizeX"), this_y = length("PhysicalSizeY");
      several = several || (x > 0 && std::abs(this_x - x) > 1e-6 * x);
      if (x == 0) x = this_x, y = this_y;
    }
    if (several) {
      notes.push_back("the OME metadata states several pixel sizes: ignored");
      return 0;
    }
    if (x > 0) return accept(x, y, "the file's OME metadata");
  }

  const double x = tags.x > 0 ? 1.0 / tags.x : 0;
  const double y = tags.y > 0 ? 1.0 / tags.y : 0;
  if (!(x > 0) || !std::isfinite(x)) return 0;
  if (const double um = micrometres_in(imagej_value(description, "unit")); um > 0)
    return accept(x * um, y * um, "the file's ImageJ metadata");

  const double um = micrometres_in(tags.unit);
  if (um > 0 && x * um < kLargestCrediblePixelUm) return accept(x * um, y * um, "the file's resolution tag");
  return 0;
}

}  // namespace birefit
