#include "io/images/npy_array.h"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <stdexcept>

#include <fmt/format.h>

#include "io/files/byte_order.h"

namespace birefit {
namespace {

/// The text behind 'key': in the header's dictionary, up to where its value ends.
std::string entry_of(const std::string& header, const std::string& key) {
  std::size_t at = header.find("'" + key + "'");
  if (at == std::string::npos) return {};
  at = header.find(':', at);
  if (at == std::string::npos) return {};
  at = header.find_first_not_of(' ', at + 1);
  if (at == std::string::npos) return {};
  const char first = header[at];
  const std::size_t end = first == '('    ? header.find(')', at)
                          : first == '['  ? header.find(']', at)
                          : first == '\'' ? header.find('\'', at + 1)
                                          : header.find_first_of(",}", at);
  return end == std::string::npos
             ? std::string()
             : header.substr(at, end - at + (first == '(' || first == '\'' || first == '[' ? 1 : 0));
}

/// A number of IEEE 754's binary16: 5 bits of exponent, 10 of fraction.
double half_number(std::uint16_t bits) {
  const int exponent = bits >> 10 & 31, fraction = bits & 1023;
  const double size =
      exponent == 31  ? (fraction ? std::numeric_limits<double>::quiet_NaN() : std::numeric_limits<double>::infinity())
      : exponent == 0 ? std::ldexp(fraction, -24)
                      : std::ldexp(1024 + fraction, exponent - 25);
  return bits >> 15 ? -size : size;
}

std::vector<std::size_t> numbers_in(const std::string& shape) {
  constexpr std::size_t kTooMany = 1'000'000'000;
  std::vector<std::size_t> numbers;
  for (std::size_t i = 0; i < shape.size();) {
    if (shape[i] < '0' || shape[i] > '9') {
      ++i;
      continue;
    }
    std::size_t n = 0;
    const auto [end, error] = std::from_chars(shape.data() + i, shape.data() + shape.size(), n);
    i = static_cast<std::size_t>(end - shape.data());
    numbers.push_back(error == std::errc() ? n : kTooMany);
  }
  return numbers;
}

}  // namespace

double NpyHeader::count() const {
  double all = 1;
  for (const std::size_t n : shape) all *= static_cast<double>(n);
  return all;
}

double NpyHeader::number(const char* from) const {
  if (kind == 'f' && bytes == 2) return half_number(read_as<std::uint16_t>(from, swapped));
  if (kind == 'f')
    return bytes == 4 ? static_cast<double>(read_as<float>(from, swapped)) : read_as<double>(from, swapped);
  const auto whole = [&]<class Signed, class Unsigned>(Signed, Unsigned) {
    return kind == 'i' ? static_cast<double>(read_as<Signed>(from, swapped))
                       : static_cast<double>(read_as<Unsigned>(from, swapped));
  };
  if (bytes == 1) return whole(std::int8_t{}, std::uint8_t{});
  if (bytes == 2) return whole(std::int16_t{}, std::uint16_t{});
  return bytes == 4 ? whole(std::int32_t{}, std::uint32_t{}) : whole(std::int64_t{}, std::uint64_t{});
}

NpyHeader npy_header(std::string_view beginning, const NpyRefusal& refuse) {
  const auto never = [] { throw std::logic_error("npy_header: what refuses has to throw"); };
  const auto demand = [&](bool met, const std::string& found, const std::string& hint) {
    if (met) return;
    refuse(found, hint);
    never();
  };
  const auto whole = [&](bool met) { demand(met, "is cut short", "save it again"); };
  demand(beginning.size() >= 10 && beginning.substr(0, kNpyMagic.size()) == kNpyMagic, "is no NumPy array",
         "numpy.save writes one");
  const int version = static_cast<unsigned char>(beginning[6]);
  demand(version >= 1 && version <= 3, fmt::format("is a NumPy array of version {}", version),
         "versions 1 to 3 are read");
  const std::size_t before = version == 1 ? 10 : 12;
  whole(beginning.size() >= before);
  const std::size_t length =
      version == 1 ? read_as<std::uint16_t>(beginning.data() + 8) : read_as<std::uint32_t>(beginning.data() + 8);
  whole(beginning.size() >= before + length);
  const std::string text(beginning.substr(before, length));
  const std::string type = entry_of(text, "descr"), order = entry_of(text, "fortran_order");
  static const std::set<std::string> kRead = {"f2'", "f4'", "f8'", "b1'", "u1'", "u2'",
                                              "u4'", "u8'", "i1'", "i2'", "i4'", "i8'"};
  demand(type.size() == 5 && kRead.contains(type.substr(2)) && (type[1] == '<' || type[1] == '>' || type[3] == '1'),
         "holds " + (type.empty() ? std::string("an unknown type") : type) +
             ", neither floats of up to 8 bytes nor integers",
         "save array.astype('<f4') or '<f8'");
  NpyHeader header;
  header.kind = type[2];
  header.bytes = static_cast<std::size_t>(type[3] - '0');
  header.swapped = type[1] == '>';
  header.fortran = order == "True";
  demand(header.fortran || order == "False", "does not say its fortran_order", "numpy.save writes it");
  header.shape_text = entry_of(text, "shape");
  header.shape = numbers_in(header.shape_text);
  header.start = before + length;
  return header;
}

void check_npy_size(const NpyHeader& header, std::size_t size, const NpyRefusal& refuse) {
  const double needed = header.count() * static_cast<double>(header.bytes);
  const std::size_t data = size - header.start;
  if (static_cast<double>(data) != needed)
    refuse(fmt::format("has {} bytes of data, its shape needs {:.0f}", data, needed),
           "it was cut short or mixed up: save it again");
}

}  // namespace birefit
