// Which files of a folder are offered as images, and when (src/io/files/arrivals.h).

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <unistd.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/files/arrivals.h"

namespace birefit {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

constexpr double kWait = 2, kShortly = 0.2;  // seconds

class ArrivalsOf : public ::testing::Test {
 protected:
  ArrivalsOf() { std::filesystem::create_directories(folder_); }
  ~ArrivalsOf() override { std::filesystem::remove_all(folder_); }
  void write(const std::string& name, const std::string& content) { std::ofstream(folder_ / name) << content; }
  static std::vector<std::string> names(const std::vector<Arrival>& arrivals) {
    std::vector<std::string> list;
    for (const Arrival& arrival : arrivals) list.push_back(arrival.name);
    return list;
  }
  const std::filesystem::path folder_ =
      std::filesystem::path(::testing::TempDir()) / ("arrivals_" + std::to_string(getpid()));
};

TEST_F(ArrivalsOf, ImagesAreKnownByTheirEndings) {
  for (const char* name : {"a.tif", "b.TIFF", "c.jpg", "d.JPEG", "e.png", "f.npy", "g.exr", ".h.tif", "i.csv", "j.tif~",
                           "k", "l.tif.part"})
    write(name, "x");
  write("m.tif", "");
  Arrivals arrivals(folder_, 10);
  EXPECT_THAT(names(arrivals.next(kWait)),
              UnorderedElementsAre("a.tif", "b.TIFF", "c.jpg", "d.JPEG", "e.png", "f.npy", "g.exr"));
}

TEST_F(ArrivalsOf, AFileIsOfferedWhenItsWriterHasClosedItAndAgainWhenItHasChanged) {
  Arrivals arrivals(folder_, 10);
  std::ofstream open(folder_ / "a.jpg");
  open << "half" << std::flush;
  EXPECT_THAT(arrivals.next(kShortly), IsEmpty());
  open << "whole";
  open.close();
  const std::vector<Arrival> first = arrivals.next(kWait);
  ASSERT_THAT(names(first), ElementsAre("a.jpg"));
  arrivals.take("a.jpg", first[0].state);
  EXPECT_THAT(arrivals.next(kShortly), IsEmpty());
  write("a.jpg", "another");
  const std::vector<Arrival> second = arrivals.next(kWait);
  ASSERT_THAT(names(second), ElementsAre("a.jpg"));
  EXPECT_TRUE(arrivals.is_still(second[0]));
  write("a.jpg", "a third");
  EXPECT_FALSE(arrivals.is_still(second[0]));
}

}  // namespace
}  // namespace birefit
