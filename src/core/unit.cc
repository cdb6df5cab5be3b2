#include "core/unit.h"

#include <array>
#include <cctype>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

namespace birefit {
namespace {

struct Known {
  const char* word;
  double factor;
  const char* base;  ///< with powers as unit_of() reads them
};
// Pressures in N/um^2; one brewster, 1e-12/Pa, is just one um^2/N.
constexpr std::array<Known, 18> kKnown{{{"um", 1, "um"},
                                        {"nm", 1e-3, "um"},
                                        {"mm", 1e3, "um"},
                                        {"cm", 1e4, "um"},
                                        {"deg", 1, "deg"},
                                        {"rad", 180 / std::numbers::pi, "deg"},
                                        {"K", 1, "K"},
                                        {"V", 1, "V"},
                                        {"N", 1, "N"},
                                        {"pN", 1e-12, "N"},
                                        {"MPa", 1e-6, "N/um2"},
                                        {"Pa", 1e-12, "N/um2"},
                                        {"brewster", 1, "um2/N"},
                                        {"s", 1, "s"},
                                        {"ms", 1e-3, "s"},
                                        {"px", 1, "px"},
                                        {"kV", 1e3, "V"},
                                        {"mV", 1e-3, "V"}}};

constexpr double kNoPower = 1e-9;

const Known* known(const std::string& word) {
  for (const Known& one : kKnown)
    if (word == one.word) return &one;
  return nullptr;
}

}  // namespace

bool Unit::is_like(const Unit& other) const {
  const Unit ratio = times(other, -1);
  return ratio.is_pure();
}

Unit Unit::times(const Unit& other, double power) const {
  Unit product = *this;
  product.factor *= std::pow(other.factor, power);
  for (const auto& [base, of_base] : other.powers) {
    double& sum = product.powers[base];
    sum += of_base * power;
    if (std::abs(sum) < kNoPower) product.powers.erase(base);
  }
  return product;
}

Unit Unit::to_the(double power) const { return Unit{}.times(*this, power); }

Unit unit_of(const std::string& text) {
  Unit unit;
  double sign = 1;
  for (std::size_t at = 0; at < text.size();) {
    std::size_t end = at;
    while (end < text.size() && std::isalpha(static_cast<unsigned char>(text[end]))) ++end;
    const std::string word = text.substr(at, end - at);
    int power = 0;
    for (; end < text.size() && std::isdigit(static_cast<unsigned char>(text[end])); ++end)
      power = 10 * power + (text[end] - '0');
    if (!word.empty()) {
      const Known* one = known(word);
      const bool is_base = !one || std::string(one->base) == word;
      Unit part;
      if (is_base)
        part.powers[word] = 1;
      else
        part = unit_of(one->base), part.factor *= one->factor;
      unit = unit.times(part, sign * (power > 0 ? power : 1));
    }
    if (end < text.size() && text[end] == '/') sign = -1;
    at = std::max(end, at) + (end < text.size() ? 1 : 0);
  }
  return unit;
}

std::optional<Unit> unit_word(const std::string& word) {
  return known(word) ? std::optional(unit_of(word)) : std::nullopt;
}

std::string unit_words() {
  std::string words;
  for (const Known& one : kKnown) words += (words.empty() ? "" : ", ") + std::string(one.word);
  return words;
}

std::string name_of(const Unit& unit) {
  if (unit.is_pure()) return "a pure number";
  for (const Known& one : kKnown)
    if (const Unit named = unit_of(one.word);
        named.is_like(unit) && std::abs(named.factor / unit.factor - 1) < kNoPower)
      return one.word;
  std::string above, below;
  for (const auto& [base, power] : unit.powers) {
    std::string& side = power > 0 ? above : below;
    const double size = std::abs(power);
    side += (side.empty() ? "" : " ") + base + (size == 1 ? "" : fmt::format("^{:g}", size));
  }
  return (above.empty() ? "1" : above) +
         (below.empty() ? "" : "/" + (below.find(' ') == std::string::npos ? below : "(" + below + ")"));
}

}  // namespace birefit
