// Text of others where people and spreadsheets read it.

#include <gtest/gtest.h>

#include "core/printable.h"
#include "io/files/csv.h"
#include "io/files/whole_file.h"

namespace birefit {
namespace {

TEST(Printable, WhatATerminalWouldObeyIsShown) {
  EXPECT_EQ(printable("a\033[2Jb\177"), "a\\x1b[2Jb\\x7f");
  EXPECT_EQ(printable("\xc2\x9b"
                      "31m"),
            "\\u009b31m");  // the same in one character
  EXPECT_EQ(printable("\xe2\x80\xae"
                      "fit"),
            "\\u202efit");  // right to left
  EXPECT_EQ(printable("a\nb\tc\r"), "a\\nb\\tc\\r");
  EXPECT_EQ(printable_lines("a\nb\tc\r"), "a\nb\tc\\r");
  EXPECT_EQ(printable(std::string_view("\0", 1)), "\\x00");
}

TEST(Printable, TextStaysAndOtherBytesAreShown) {
  const std::string text = "caf\xc3\xa9 \xc2\xb5m \xe2\x80\x93 \xf0\x9f\x94\xac \\x";
  EXPECT_EQ(printable(text), text);
  EXPECT_EQ(printable("caf\xe9"), "caf\\xe9");              // Latin-1
  EXPECT_EQ(printable("\xe2\x80"), "\\xe2\\x80");           // cut short
  EXPECT_EQ(printable("\xc0\xaf"), "\\xc0\\xaf");           // longer than need be
  EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // half of a pair
}

TEST(CsvField, IsOneCellThatNoSpreadsheetEvaluates) {
  EXPECT_EQ(csv_field("frames/f1.tif"), "frames/f1.tif");
  EXPECT_EQ(csv_field("a \"b\", c"), "\"a \"\"b\"\", c\"");
  EXPECT_EQ(csv_field("-1.5e-3"), "-1.5e-3");
  EXPECT_EQ(csv_field("=1+1"), "'=1+1");
  EXPECT_EQ(csv_field(" @x"), " '@x");
  EXPECT_EQ(csv_field("-x"), "'-x");
  EXPECT_EQ(csv_field("a;=1+1"), "\"a;'=1+1\"");
  EXPECT_EQ(csv_field("a=b-c"), "a=b-c");
  EXPECT_EQ(csv_field("a\n=1"), "a\\n=1");
}

TEST(Sha256, IsThatOfTheStandard) {
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

}  // namespace
}  // namespace birefit
