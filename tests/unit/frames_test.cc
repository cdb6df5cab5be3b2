// Images in numbers: files and pages of stacks in one fit, calibration frames one by one, tables of frames' means.

#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "birefit/io.h"
#include "pictures.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class FrameFiles : public ::testing::Test {
 protected:
  FrameFiles() : folder_(fs::temp_directory_path() / ("birefit-frames-" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    fs::copy(fs::path(BIREFIT_SOURCE_DIR) / "tests/data/files/stack_imagej.tif", folder_);
  }
  ~FrameFiles() override { fs::remove_all(folder_); }

  void write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }
  /// 8 x 6 pixels: `left` in the left half, `right` in the other.
  void expose(const std::string& name, double left, double right) {
    Image image(8, 6, right);
    for (int y = 0; y < 6; ++y)
      for (int x = 0; x < 4; ++x) image(x, y) = left;
    save_image(image, folder_ / name);
  }
  Config load(const std::string& text) {
    write("config.yaml", text);
    return load_config(folder_ / "config.yaml", ConfigUse::fit);
  }
  std::string problems(const std::string& text) {
    try {
      load(text);
    } catch (const UserError& error) {
      return error.what();
    }
    return {};
  }

  fs::path folder_;
};

const std::string kCrystal = R"(
micrograph: {gain: {fit: auto}, offset: {fit: auto}, noise: {read_counts: 1}}
sample:
  crystal:
    {half_wave_voltage_v: {value: 1400, fit: [1000, 2500]}, bias_v: 700, field_along: y, electrodes_px: [-0.5, 5.5]}
microscope: {light: {wavelength_nm: 1550}, polarizer_deg: 0, analyzer_deg: 90}
)";

// ---- micrographs: {files, set_from} in one fit
// -------------------------------------------------------------------------

TEST_F(FrameFiles, OfAStackAreMicrographsOfOneFit) {
  write("rows.csv", "page,sample.crystal.bias_v\n4,800\n0,600\n1,610\n2,700\n3,710\n5,810\n");
  const Config config =
      load("micrographs: {files: stack_imagej.tif, set_from: rows.csv, own: [micrograph.gain]}" + kCrystal);
  ASSERT_EQ(config.job.measurements.size(), 6u);
  const Picture &first = picture(config.job, 0), &last = picture(config.job, 5);
  EXPECT_EQ(first.values(3, 3), 104);
  EXPECT_EQ(first.name, "stack_imagej.tif (page 4)");
  const ParameterTable& table = config.job.parameters;
  EXPECT_EQ(table[std::get<Crystal>(first.scene.sample).bias_v].value, 800);
  EXPECT_FALSE(table[std::get<Crystal>(first.scene.sample).bias_v].free);
  EXPECT_EQ(table[first.gain].name, "micrographs[0].micrograph.gain");
  EXPECT_TRUE(table[last.gain].free);
  EXPECT_FALSE(first.gain == last.gain);
  EXPECT_TRUE(first.offset == last.offset);
}

TEST_F(FrameFiles, OfOneChannelAreTakenByTheirPlace) {
  std::string text = "micrographs: {files: stack_imagej.tif}" + kCrystal;
  text.replace(text.find("{gain"), 1, "{page: {c: 1}, ");
  const Config config = load(text);
  ASSERT_EQ(config.job.measurements.size(), 3u);
  EXPECT_EQ(picture(config.job, 2).values(0, 0), 105);
}

TEST_F(FrameFiles, OfAStackNeedARowEach) {
  write("rows.csv", "file,sample.crystal.bias_v\nstack_imagej.tif,600\n");
  EXPECT_THAT(problems("micrographs: {files: stack_imagej.tif, set_from: rows.csv}" + kCrystal),
              HasSubstr("stack_imagej.tif has 6 pages, and the row is of all of them; add a column page"));
  write("rows.csv", "page,sample.crystal.bias_v\n0,600\n1,610\n2,620\n3,630\n5,650\n");
  EXPECT_THAT(problems("micrographs: {files: stack_imagej.tif, set_from: rows.csv}" + kCrystal),
              HasSubstr("stack_imagej.tif, page 4 has no row"));
}

TEST_F(FrameFiles, SayWhatBelongsToASeries) {
  EXPECT_THAT(problems("micrographs: {files: stack_imagej.tif, shared: [micrograph.gain]}" + kCrystal),
              HasSubstr("run birefit series"));
  EXPECT_THAT(problems("micrographs: {files: stack_imagej.tif, own: [sample.crystal.bias_v]}" + kCrystal),
              HasSubstr("sample.crystal.bias_v is not fitted here"));
  EXPECT_THAT(problems("micrographs: {files: stack_imagej.tif, own: [micrograph.gian]}" + kCrystal),
              HasSubstr("did you mean micrograph.gain?"));
}

// One picture is rendered: which, where there are several, is said.
TEST_F(FrameFiles, TheOneOfSeveralThatIsRenderedIsNamed) {
  const auto warnings = [&](const std::string& text) {
    write("config.yaml", text);
    return load_config(folder_ / "config.yaml", ConfigUse::render).job.warnings;
  };
  expose("a.tif", 1, 2);
  expose("b.tif", 1, 2);
  EXPECT_THAT(warnings("micrographs: [{image: a.tif}, {image: b.tif}]" + kCrystal),
              Contains(HasSubstr("Of 2 micrographs the first is shown, a.tif")));
  EXPECT_THAT(warnings("micrographs: [{image: a.tif}]" + kCrystal), ::testing::Not(Contains(HasSubstr("is shown"))));
}

// ---- calibration ----------------------------------------------------------------------------------------------------

class CalibrationFrames : public FrameFiles {
 protected:
  CalibrationFrames() {
    expose("image.tif", 120, 220);
    expose("dark.tif", 20, 20);
    expose("light.tif", 220, 420);
  }
  std::string with(const std::string& frames) {
    std::string text = "calibration: {" + frames + "}" + kCrystal;
    return text.replace(text.find("{gain"), 1, "{image: image.tif, ");
  }
};

TEST_F(CalibrationFrames, DarkAloneIsSubtracted) {
  const Config config = load(with("dark: dark.tif"));
  EXPECT_EQ(picture(config.job, 0).values(0, 0), 100);
  EXPECT_EQ(picture(config.job, 0).values(7, 0), 200);
  EXPECT_TRUE(picture(config.job, 0).variance_scale.empty());
}

// 8 bits of a camera are 16 bits divided by 256: subtracted, they would be nothing.
TEST_F(CalibrationFrames, CountsOfTwoKindsAreNotSubtracted) {
  save_image(Image(8, 6, 120.0 / 65535), folder_ / "image.png");
  save_image(Image(8, 6, 20.0 / 65535), folder_ / "dark_16.png");
  const std::vector<unsigned char> small = encode_png(std::vector<unsigned char>(48, 20), 8, 6, 1);
  write("dark_8.png", {small.begin(), small.end()});
  const auto of_image = [&](const std::string& dark) {
    std::string text = with("dark: " + dark);
    return text.replace(text.find("image.tif"), 9, "image.png");
  };
  EXPECT_EQ(picture(load(of_image("dark_16.png")).job, 0).values(0, 0), 100);
  EXPECT_THAT(problems(of_image("dark_8.png")),
              HasSubstr("counts of 16 bits, the dark frame that is subtracted has 8"));
  EXPECT_EQ(problems(with("dark: dark_8.png")), "");  // floats have the scale that their maker gave them
}

// A frame that was smoothed has no noise for its own slopes to be told from.
TEST_F(CalibrationFrames, OfSmoothFramesNoPixelIsDead) {
  constexpr int kSize = 60;
  Image flat(kSize, kSize), image(kSize, kSize, 0.5);
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x)
      flat(x, y) = 1000 - 0.1 * (x - 20) * (x - 20) - 0.15 * (y - 35) * (y - 35), image(x, y) = 0.5 * flat(x, y);
  save_image(flat, folder_ / "light.tif");
  save_image(image, folder_ / "image.tif");
  const Config config = load(with("flat: light.tif"));
  EXPECT_EQ(picture(config.job, 0).dead, 0);
}

TEST_F(CalibrationFrames, FlatAloneDivides) {
  const Config config = load(with("flat: light.tif"));
  EXPECT_DOUBLE_EQ(picture(config.job, 0).values(0, 0), 120.0 / 220);
  EXPECT_DOUBLE_EQ(picture(config.job, 0).values(7, 0), 220.0 / 420);
  EXPECT_DOUBLE_EQ(picture(config.job, 0).variance_scale(7, 0), 1 / (420.0 * 420));
  EXPECT_THAT(config.job.warnings, Contains(HasSubstr("a flat and no dark")));
}

TEST_F(CalibrationFrames, BothDoBoth) {
  for (const char* light : {"flat", "parallel"}) {
    const Config config = load(with(std::string("dark: dark.tif, ") + light + ": light.tif"));
    EXPECT_DOUBLE_EQ(picture(config.job, 0).values(0, 0), 0.5);
    EXPECT_DOUBLE_EQ(picture(config.job, 0).values(7, 0), 0.5);
  }
}

TEST_F(CalibrationFrames, ThatSayTooLittleAreRefused) {
  EXPECT_THAT(problems(with("parallel: light.tif")), HasSubstr("dark"));
  EXPECT_THAT(problems(with("dark: dark.tif, crossed: dark.tif")), HasSubstr("parallel"));
  EXPECT_THAT(problems(with("flat: light.tif, parallel: light.tif")), HasSubstr("flat is given beside parallel"));
  EXPECT_THAT(problems(with("flat: dark.tif, dark: light.tif")), HasSubstr("were the two exchanged?"));
  fs::copy_file(folder_ / "stack_imagej.tif", folder_ / "light.tif", fs::copy_options::overwrite_existing);
  EXPECT_THAT(problems(with("dark: dark.tif, flat: light.tif")), HasSubstr("has 6 pages"));
}

// All light there is, brighter on the right, beyond what the camera can tell: there it is left out, and where that is
// everywhere there is no measure of light.
TEST_F(CalibrationFrames, AClippedLightIsLeftOutOrRefused) {
  constexpr int kSide = 48;
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 12);
  const auto take = [&](const std::string& name, double left, double right, double highest) {
    Image image(kSide, kSide);
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x) {
        const double code = left + (right - left) * x / (kSide - 1) + noise(random);
        image(x, y) = std::round(std::min(code, highest)) / 65535;
      }
    save_image(image, folder_ / name);
  };
  take("image.png", 1200, 1200, 1e9), take("dark.png", 200, 200, 1e9);
  const auto calibrated = [&](const char* light) {
    std::string text = with(std::string("dark: dark.png, parallel: ") + light);
    return text.replace(text.find("image.tif"), 9, "image.png");
  };
  take("light.png", 3300, 3700, 1e9);
  const Config sound = load(calibrated("light.png"));
  EXPECT_THAT(sound.job.warnings, Not(Contains(HasSubstr("clipped"))));
  EXPECT_EQ(picture(sound.job, 0).saturated, 0);

  take("light.png", 3300, 3700, 3500);
  const Config part = load(calibrated("light.png"));
  EXPECT_THAT(part.job.warnings, Contains(HasSubstr("clipped")));
  const Picture& seen = picture(part.job, 0);
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const double light = 3300 + 400.0 * x / (kSide - 1);
      if (light > 3500) EXPECT_EQ(seen.mask(x, y), 0) << x;
      if (light < 3500 - 9 * 12) EXPECT_EQ(seen.mask(x, y), 1) << x;  // three deviations left out, and six of luck
    }

  take("light.png", 3300, 3700, 3000);
  EXPECT_THAT(problems(calibrated("light.png")), HasSubstr("100 % of the pixels sit at 3000"));
  // One code by right: no frame scatters.
  EXPECT_EQ(problems(with("dark: dark.tif, parallel: light.tif")), "");
}

// ---- signal: {frames, roi_px} ---------------------------------------------------------------------------------------

const std::string kFieldCell = R"(
microscope: {light: {wavelength_nm: 633}, polarizer_deg: 0, analyzer_deg: 90}
sample:
  cell:
    thickness_um: {value: 6, fit: [5, 7]}
    director:
      freedericksz: {threshold_v: 1, k33_over_k11: 1.3, eps_ratio: 2.5, azimuth_deg: 45}
  material: {ordinary: 1.52, birefringence: 0.2}
)";

TEST_F(FrameFiles, HaveMeansThatAreATable) {
  const std::string voltage = "sample.cell.director.freedericksz.voltage_v";
  for (int k = 0; k < 4; ++k) expose("f" + std::to_string(k) + ".tif", 10 + k, 90);
  write("f9.tif", "");  // is left out
  write("sweep.csv", "file,volts\nf3.tif,0.5\nf0.tif,1\nf1.tif,1.5\nf2.tif,2\nf9.tif,2.5\n");
  const Config config = load("signal: {frames: \"f*.tif\", set_from: sweep.csv, roi_px: [2, 0, 5, 6], columns: {" +
                             voltage + ": volts}, noise: 1}" + kFieldCell);
  const Readings& rows = readings(config.job, 0);
  ASSERT_EQ(rows.values.size(), 4);
  EXPECT_DOUBLE_EQ(rows.values[0], (2 * 13 + 90) / 3.0);
  EXPECT_DOUBLE_EQ(rows.values[3], (2 * 12 + 90) / 3.0);
  EXPECT_THAT(config.signals[0].x, ElementsAre(0.5, 1, 1.5, 2));
  EXPECT_THAT(config.signals[0].line, ElementsAre(2, 3, 4, 5));
  EXPECT_THAT(config.job.warnings, Contains(HasSubstr("A frame is left out: image")));
}

TEST_F(FrameFiles, OfAStackAreASweepByTheirNumber) {
  const Config config = load(
      "signal: {frames: stack_imagej.tif, columns: {sample.cell.director.freedericksz.voltage_v: {column: frame, "
      "scale: 0.5}}, noise: 1}\nmicrograph: {page: {c: 0}}" +
      kFieldCell);
  EXPECT_THAT(config.signals[0].x, ElementsAre(0, 0.5, 1));
  EXPECT_EQ(readings(config.job, 0).values, Eigen::Vector3d(100, 102, 104));
}

TEST_F(FrameFiles, OfATableAreNotBesideAFile) {
  const std::string columns = "columns: {sample.cell.director.freedericksz.voltage_v: frame}";
  EXPECT_THAT(problems("signal: {frames: f.tif, file: a.csv, " + columns + "}" + kFieldCell),
              HasSubstr("frames is given beside file"));
  EXPECT_THAT(problems("signal: {file: a.csv, roi_px: [0, 0, 1, 1], " + columns + "}" + kFieldCell),
              HasSubstr("roi_px is of frames"));
  EXPECT_THAT(problems("signal: {frames: stack_imagej.tif, roi_px: [0, 0, 90, 1], " + columns + "}" + kFieldCell),
              HasSubstr("reaches outside"));
}

}  // namespace
}  // namespace birefit
