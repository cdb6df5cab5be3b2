#pragma once
// Text of others (keys, values, names of files and columns) where people read it: terminals, logs, documents.

#include <cstddef>
#include <string>
#include <string_view>

namespace birefit {

/// Bytes of the UTF-8 character that starts at text[at], 1 to 4; 0 where there is none.
int utf8_length(std::string_view text, std::size_t at);

/// `text` as one line of UTF-8 that no terminal obeys: control characters, characters that turn the direction of
/// writing round, and bytes that are no UTF-8 are shown as "\n", "\x1b", "\u202e"; all else stays.
std::string printable(std::string_view text);

/// The same of several lines: their ends and tabs stay.
std::string printable_lines(std::string_view text);

}  // namespace birefit
