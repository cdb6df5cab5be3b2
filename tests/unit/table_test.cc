// Tables as spreadsheets and instruments write them.

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/files/table.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class TableFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("birefit-table-" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path write(const std::string& text) const {
    std::ofstream(folder_ / "t.csv", std::ios::binary) << text;
    return folder_ / "t.csv";
  }
  PlacedTable read(const std::string& text, MissingNumbers missing = MissingNumbers::refused) const {
    return load_placed_table(write(text), {}, missing);
  }
  std::string error(const std::string& text) const {
    try {
      read(text);
    } catch (const UserError& error) {
      return error.what();
    }
    return "no error";
  }
  fs::path folder_;
};

// One table in every dress: names and numbers are the same.
TEST_F(TableFile, SeparatorsQuotesAndLineEndsDoNotMatter) {
  for (const char* text : {
           "volts,out\n1.5,-2\n2.5,3e2\n",
           "\xEF\xBB\xBFvolts,out\r\n1.5,-2\r\n2.5,3e2\r\n",
           "volts,out\r1.5,-2\r2.5,3e2",
           "volts;out\n1,5;-2\n2,5;3e2\n",
           "volts;out\n1.5;-2\n2.5;3e2\n",
           "volts\tout\n1.5\t-2\n2.5\t3e2\n",
           "volts\tout\n1,5\t-2\n2,5\t3e2\n",
           "volts,\tout\n1.5,\t-2\n2.5,\t3e2\n",
           "\"volts\",\"out\"\n\"1.5\",\"-2\"\n\"2.5\",\"3e2\"\n",
           "\"volts\",\"out\"\n\"1,5\",\"-2\"\n\"2,5\",\"3e2\"\n",
           "sep=;\nvolts;out\n1,5;-2\n2,5;3e2\n",
           "# a remark, \"half quoted\n\nvolts,out,,\n1.5,-2,,\n,,,\n2.5,3e2\n",
       }) {
    const PlacedTable table = read(text);
    EXPECT_THAT(table.table.columns, ElementsAre("volts", "out")) << text;
    EXPECT_THAT(table.table.rows, ElementsAre(ElementsAre(1.5, -2), ElementsAre(2.5, 300))) << text;
  }
}

TEST_F(TableFile, QuotesHoldSeparatorsLineEndsAndQuotes) {
  Problems problems;
  const TextTable table =
      load_text_table(write("\"a, \"\"b\"\"\",\"two\nlines\"\n\"x\ny, z\",1\nlast,2\n"), {}, problems);
  EXPECT_EQ(table.header[0].text, "a, \"b\"");
  EXPECT_EQ(table.header[1].text, "two lines");
  EXPECT_EQ(table.rows[0][0].text, "x y, z");
  EXPECT_THAT(table.lines, ElementsAre(3, 5));
  EXPECT_THAT(error("a,b\n\"1,2\n"), HasSubstr("t.csv:2:1: a quote is opened here and does not end"));
  EXPECT_THAT(error("a,b\n\"1\" x,2\n"), HasSubstr("t.csv:2:5: something stands behind the end of a quote"));
}

TEST_F(TableFile, ALineOfUnitsIsTakenForUnitsAndSaid) {
  for (const char* line : {"V,a.u.", "[V],[-]", "(V),()", "V,", "\"V\",\"%\""}) {
    const PlacedTable table = read(std::string("volts,out\n") + line + "\n1,2\n3,4\n");
    EXPECT_EQ(table.table.rows.size(), 2u) << line;
    ASSERT_EQ(table.units.size(), 2u);
    EXPECT_EQ(table.units[0], "V");
    EXPECT_THAT(table.notes, ElementsAre(HasSubstr("line 2")));
  }
  // A reading that is missing is no unit, and neither is a row of a column of words.
  EXPECT_THAT(error("volts,out\nNaN,NaN\n1,2\n"), HasSubstr("volts = NaN"));
  Problems problems;
  EXPECT_EQ(load_text_table(write("file,x\nb.tif,high\na.tif,2\n"), {}, problems).rows.size(), 2u);
  EXPECT_TRUE(contradicts_unit("[mV]", "V"));
  EXPECT_TRUE(contradicts_unit("nm", "um"));
  EXPECT_FALSE(contradicts_unit("\xc2\xb5m", "um"));
  EXPECT_FALSE(contradicts_unit("a.u.", "V"));
}

// Degrees are what angles are asked for in: radians under whatever name are not.
TEST_F(TableFile, UnitsMayBeSpeltOut) {
  for (const char* unit : {"radians", "Radian", "rad", "Rad", "milliradians"})
    EXPECT_TRUE(contradicts_unit(unit, "deg")) << unit;
  for (const char* unit : {"degrees", "degree", "Deg"}) EXPECT_FALSE(contradicts_unit(unit, "deg")) << unit;
  EXPECT_TRUE(contradicts_unit("millivolts", "V"));
  EXPECT_TRUE(contradicts_unit("nanometers", "um"));
  EXPECT_FALSE(contradicts_unit("Kelvin", "K"));
  EXPECT_FALSE(contradicts_unit("micrometres", "um"));
  // What spectrometers and catalogues state light by, a factor of ten beside nanometres among them.
  for (const char* unit : {"A", "\xc3\x85", "\xe2\x84\xab", "angstrom", "Angstroms", "1/cm", "cm-1", "eV", "THz"})
    EXPECT_TRUE(contradicts_unit(unit, "nm")) << unit;
  for (const char* name : {"wavelength_A", "wavelength (\xc3\x85)", "lambda_angstrom", "photon energy (eV)", "k, cm-1"})
    EXPECT_TRUE(contradicts_unit(unit_in_name(name), "nm")) << name;
  for (const char* unit : {"gon", "grad", "arcmin", "turns"}) EXPECT_TRUE(contradicts_unit(unit, "deg")) << unit;
  EXPECT_FALSE(contradicts_unit("A", "V"));  // amperes of a supply, which nothing is set to
  for (const char* name : {"a (radians)", "a/rad", "a_Rad", "a, rad", "angle in rad", "a_rad"})
    EXPECT_TRUE(contradicts_unit(unit_in_name(name), "deg")) << name;
  for (const char* name : {"angle", "grad", "a_deg", "drive V", "brad"})
    EXPECT_FALSE(contradicts_unit(unit_in_name(name), "deg")) << name;
}

TEST_F(TableFile, RowsWithoutANumberAreLeftOutWhereThatIsAsked) {
  const std::string text = "m,r_cm\n1,2\n2,NaN\n3,\n4,OL\n5,6\n";
  const PlacedTable table = read(text, MissingNumbers::left_out);
  EXPECT_THAT(table.lines, ElementsAre(2, 6));
  EXPECT_THAT(table.notes, ElementsAre(HasSubstr("3 rows without a number left out (lines 3, 4, 5)")));
  EXPECT_THAT(error(text), HasSubstr("t.csv:3:3: r_cm = NaN is not a finite number"));
  // Digits that are no number are a slip, not a gap.
  EXPECT_THROW(read("m,r_cm\n1,2\n2,1O5\n", MissingNumbers::left_out), UserError);
}

// What a comma means is never guessed: "1,234" may be a thousand.
TEST_F(TableFile, CommasThatCouldPartThousandsAreNoNumbers) {
  EXPECT_THAT(error("a\tb\n1,234\t1\n2,345\t2\n"), HasSubstr("a = 1,234 is not a finite number"));
  EXPECT_THAT(error("a;b\n1,5;1.5\n"), HasSubstr("a = 1,5 is not a finite number"));
  EXPECT_THAT(error("a;b\n1.234,5;1\n"), HasSubstr("decimals with a point"));
  EXPECT_EQ(read("a;b\n1,234;1\n").table.rows[0][0], 1.234);
  EXPECT_THAT(read("a;b\n1,234;1\n").notes, ElementsAre(HasSubstr("decimal")));
  EXPECT_THAT(read("a;b\n1.234;1\n").notes, IsEmpty());
  // Beside a number below a thousand without a comma it may be one; beside one with other decimals it is none.
  EXPECT_THAT(error("a;b\n1,250;1\n977;2\n"), HasSubstr("a = 1,250 is not a finite number"));
  EXPECT_EQ(read("a;b\n1,250;1\n977;2\n0,5;3\n").table.rows[0][0], 1.25);
  EXPECT_EQ(read("a;b\n1,250;1\n0,977;2\n").table.rows[0][0], 1.25);
}

// Loggers write the same name twice: neither column has it alone, and what is not asked for is in nobody's way.
TEST_F(TableFile, ColumnsOfOneNameAreToldApartByTheirPlace) {
  EXPECT_THAT(read("t,V,t,V,W\n1,2,3,4,5\n").table.columns,
              ElementsAre("t (column 1)", "V (column 2)", "t (column 3)", "V (column 4)", "W"));
  EXPECT_EQ(unit_in_name("angle_rad (column 2)"), "rad");
}

// What programs and word processors make of numbers is named, not taken for damage.
TEST_F(TableFile, NumbersInOtherSpellingsAreRecognised) {
  EXPECT_THAT(error("a,b\n1.02D1,2\n"), HasSubstr("did you mean 1.02E1?"));
  EXPECT_THAT(error("a,b\n\u22125,2\n"), HasSubstr("did you mean -5?"));
  EXPECT_THAT(error("a,b\n1\u00a0250,2\n"), HasSubstr("did you mean 1250?"));
  EXPECT_THAT(error("a,b\n0x0A,2\n"), HasSubstr("in decimals"));
  EXPECT_THAT(error("volts light\n1.0 0.5\n2.0 0.7\n"), HasSubstr("t.csv:2: has columns with nothing but blanks"));
}

TEST_F(TableFile, WhatIsNoTableIsRefusedByName) {
  EXPECT_THAT(error(std::string("\xFF\xFEv\0,\0", 6)), HasSubstr("is UTF-16 text"));
  EXPECT_THAT(error(std::string("a,b\n1\0,2\n", 9)), HasSubstr("t.csv:2: is not a text table"));
  EXPECT_THAT(error("1,2\n3,4\n"), HasSubstr("must name the columns, found 1"));
  EXPECT_THAT(error("a,b\n1,5,2\n"),
              HasSubstr("t.csv:2: has 3 fields, the header names 2; cells are separated by commas"));
}

}  // namespace
}  // namespace birefit
