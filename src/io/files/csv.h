#pragma once
// Text as cells of the tables that are written.

#include <string>

namespace birefit {

/// `text` as one cell of a table with commas (RFC 4180), of one line and in UTF-8, whatever it holds. A spreadsheet
/// that opens the table evaluates no part of it: what would begin as a formula (=, +, -, @ and no number) has a
/// single quote before it.
std::string csv_field(const std::string& text);

}  // namespace birefit
