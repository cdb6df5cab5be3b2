#include "core/printable.h"

#include <cstdint>

namespace birefit {
namespace {

std::string hexadecimal(const char* prefix, std::uint32_t value, int digits) {
  std::string text = prefix;
  for (int i = digits - 1; i >= 0; --i) text += "0123456789abcdef"[value >> (4 * i) & 15];
  return text;
}

/// The character of `length` > 1 bytes at `at`.
std::uint32_t code_point(std::string_view text, std::size_t at, int length) {
  std::uint32_t code = static_cast<unsigned char>(text[at]) & (0xFFu >> (length + 1));
  for (int i = 1; i < length; ++i)
    code = code << 6 | (static_cast<unsigned char>(text[at + static_cast<std::size_t>(i)]) & 0x3Fu);
  return code;
}

/// Marks after which text is shown in another order than it has, and separators of lines.
bool turns_text(std::uint32_t code) {
  return (code >= 0x2028 && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069) || code == 0x200E || code == 0x200F ||
         code == 0x061C;
}

std::string shown(std::string_view text, bool keep_lines) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size();) {
    const int length = utf8_length(text, i);
    const unsigned char c = static_cast<unsigned char>(text[i]);
    if (length > 1) {
      const std::uint32_t code = code_point(text, i, length);
      if (code < 0xA0 || turns_text(code))
        out += hexadecimal("\\u", code, 4);
      else
        out += text.substr(i, static_cast<std::size_t>(length));
      i += static_cast<std::size_t>(length);
      continue;
    }
    if (length == 1 && ((c >= 0x20 && c != 0x7F) || (keep_lines && (c == '\n' || c == '\t'))))
      out += text[i];
    else if (c == '\n' || c == '\r' || c == '\t')
      out += c == '\n' ? "\\n" : c == '\r' ? "\\r" : "\\t";
    else
      out += hexadecimal("\\x", c, 2);
    ++i;
  }
  return out;
}

}  // namespace

int utf8_length(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(at);
  const int length = first < 0x80 ? 1 : first < 0xC2 ? 0 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : first < 0xF5 ? 4 : 0;
  if (at + static_cast<std::size_t>(length) > text.size()) return 0;
  for (int k = 1; k < length; ++k)
    if ((byte(at + static_cast<std::size_t>(k)) & 0xC0) != 0x80) return 0;
  // Longer than need be, halves of surrogate pairs, beyond Unicode.
  if (length > 2) {
    const unsigned char second = byte(at + 1);
    if ((first == 0xE0 && second < 0xA0) || (first == 0xED && second >= 0xA0) || (first == 0xF0 && second < 0x90) ||
        (first == 0xF4 && second >= 0x90))
      return 0;
  }
  return length;
}

std::string printable(std::string_view text) { return shown(text, false); }
std::string printable_lines(std::string_view text) { return shown(text, true); }

}  // namespace birefit
