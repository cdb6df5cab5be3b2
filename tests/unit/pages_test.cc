// Pages of stacks by the places that ImageJ's and OME's metadata give them (tests/data/files, made by its
// make_pictures.py).

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/config/pages.h"
#include "io/images/pages.h"

namespace birefit {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::filesystem::path stack(const std::string& name) {
  return std::filesystem::path(BIREFIT_SOURCE_DIR) / "tests/data/files" / name;
}

std::vector<std::string> labels(const std::string& name) {
  std::vector<std::string> all;
  for (const StackPage& page : stack_pages(stack(name))) all.push_back(page.label());
  return all;
}

TEST(StackPages, HaveTheirPlacesOrTheirNumbers) {
  EXPECT_THAT(labels("stack_plain.tif"), ElementsAre("p0", "p1", "p2"));
  EXPECT_THAT(labels("stack_imagej.tif"), ElementsAre("t0_c0", "t0_c1", "t1_c0", "t1_c1", "t2_c0", "t2_c1"));
  EXPECT_THAT(labels("stack_ome.tif"), ElementsAre("t0_z0", "t0_z1", "t1_z0", "t1_z1", "t2_z0", "t2_z1"));
  EXPECT_THAT(labels("stack_ome_by_page.tif"), ElementsAre("t2_z1", "t2_z0", "t1_z1", "t1_z0", "t0_z1", "t0_z0"));
}

TEST(StackPages, OfOtherFilesAreOneWithoutANumber) {
  for (const char* name : {"droplet.tif", "mask_pillow_1bit.png", "droplet_thumbnail_first.dng", "no_such_file.tif"}) {
    ASSERT_EQ(stack_pages(stack(name)).size(), 1u) << name;
    EXPECT_FALSE(stack_pages(stack(name))[0].number) << name;
  }
}

// The page that a cut loses is one to ask for in vain, not one that never was.
TEST(StackPages, OfAFileThatWasCutOffEndWithAPageThatIsNotThere) {
  EXPECT_THAT(labels("stack_imagej_cut.tif"), ElementsAre("t0_c0", "t0_c1", "t1_c0"));
  EXPECT_NO_THROW(load_image({stack("stack_imagej_cut.tif"), 1, "", {}}));
  EXPECT_THROW(load_image({stack("stack_imagej_cut.tif"), 2, "", {}}), UserError);
}

class PageByPlace : public ::testing::Test {
 protected:
  /// The number of the page that `page: {..}` names; -1 and `said` where it is not one.
  int page(const std::string& name, const std::string& places) {
    ConfigReader reader("c.yaml", {}, ConfigUse::fit);
    const YamlNode tree = parse_yaml("page: " + places + "\n", "c.yaml", reader.problems);
    PageChoice choice = read_page(reader, {&tree, "", {}});
    const bool settled = settle_page(reader, stack(name), choice);
    said = reader.problems.empty() ? "" : to_string(reader.problems.all()[0]);
    EXPECT_EQ(settled, said.empty());
    return settled ? choice.number.value_or(-1) : -1;
  }
  std::string said;
};

TEST_F(PageByPlace, IsTheOneThatIsThere) {
  EXPECT_EQ(page("stack_imagej.tif", "{t: 1, c: 1}"), 3);
  EXPECT_EQ(page("stack_imagej.tif", "{t: 1, c: 1, z: 0}"), 3);
  EXPECT_EQ(page("stack_ome_by_page.tif", "{t: 0, z: 1}"), 4);
  EXPECT_EQ(page("stack_ome.tif", "5"), 5);
}

TEST_F(PageByPlace, MustBeOne) {
  page("stack_imagej.tif", "{t: 1}");
  EXPECT_THAT(said, HasSubstr("c.yaml:1:7: stack_imagej.tif has several pages at t 1: of these, 2 pages, c 0 to 1"));
  page("stack_imagej.tif", "{t: 3, c: 0}");
  EXPECT_THAT(said, HasSubstr("has no page at t 3, c 0: it has 6 pages, t 0 to 2, c 0 to 1"));
  page("stack_plain.tif", "{t: 1}");
  EXPECT_THAT(said, HasSubstr("has no page at t 1: it has 3 pages"));
}

}  // namespace
}  // namespace birefit
