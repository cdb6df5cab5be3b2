// Pictures that half a turn about the viewing axis, or a mirror, leaves as they are: half of them is computed, and must
// be the picture and the derivatives that computing all of it gives; and a scene without that symmetry must not be
// taken for one.

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "birefit/render.h"
#include "instrument/exposure.h"
#include "samples/kind.h"
#include "scene_builder.h"
#include "transport/method.h"

namespace birefit {
namespace {
using namespace testing;

template <class S>
Symmetry symmetry_of(const Scene& scene, const RenderPlan& plan, const Values<S>& value) {
  const Exposure exposure = exposure_of(scene.microscope);
  return make_image<S>(scene, plan, value, exposure.directions.front())->symmetry();
}

struct Case {
  const char* name;
  std::function<void(TableBuilder&, Scene&, std::vector<int>&)> build;  ///< adds what derivatives are taken by
  bool half;                                                            ///< with these derivatives
  bool half_of_values;                                                  ///< the picture alone
};

Droplet droplet(TableBuilder& b, std::vector<int>& by) {
  Droplet d;
  d.diameter_um = b.fixed("diameter_um", 6.1);
  by.push_back(d.diameter_um.index);
  return d;
}
Plate plate(TableBuilder& b, Scene& s, double azimuth_deg, double tilt_deg, std::vector<int>& by) {
  Plate p;
  p.thickness_um = b.fixed("thickness_um", 90);
  p.director.azimuth_deg = b.fixed("azimuth_deg", azimuth_deg);
  p.director.tilt_deg = b.fixed("tilt_deg", tilt_deg);
  p.half_angle_deg = b.fixed("half_angle_deg", 15);
  s.surround_index = b.fixed("air", 1.0);
  by.push_back(p.thickness_um.index);
  return p;
}

const Case kCases[] = {
    {"radial droplet", [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = droplet(b, by); }, true, true},
    {"twisted droplet",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) {
       Droplet d = droplet(b, by);
       d.director = RadialDirector{b.fixed("twist_deg", 50)};
       s.sample = d;
     },
     true, true},
    {"its centre searched",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) {
       s.sample = droplet(b, by);
       by.push_back(s.view.center_x_px.index);
     },
     false, true},
    {"bipolar droplet",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) {
       Droplet d = droplet(b, by);
       d.director = BipolarDirector{b.fixed("azimuth_deg", 33), b.fixed("tilt_deg", 0), b.fixed("pole_distance", 1.2)};
       s.sample = d;
     },
     true, true},
    {"bipolar droplet, its tilt searched",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) {
       Droplet d = droplet(b, by);
       const BipolarDirector director{b.fixed("azimuth_deg", 33), b.fixed("tilt_deg", 0), {}};
       by.push_back(director.tilt_deg.index);
       d.director = director;
       s.sample = d;
     },
     false, true},
    {"tilted bipolar droplet",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) {
       Droplet d = droplet(b, by);
       d.director = BipolarDirector{b.fixed("azimuth_deg", 33), b.fixed("tilt_deg", 20), {}};
       s.sample = d;
     },
     false, false},
    {"eccentric shell",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) {
       Droplet d = droplet(b, by);
       ShellDirector shell;
       shell.wall_um = b.fixed("wall_um", 1.2);
       shell.offset_um = {b.fixed("offset_x", 0.3), b.fixed("offset_y", 0.1), b.fixed("offset_z", 0.0)};
       d.director = shell;
       s.sample = d;
       by.clear();  // no bound to the slope by the diameter where a ray touches the core
     },
     false, false},
    {"plate in a cone", [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = plate(b, s, 20, 0, by); },
     true, true},
    {"plate cut normal to its axis",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = plate(b, s, 0, 90, by); }, true, true},
    {"plate, its tilt searched",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) {
       const Plate p = plate(b, s, 20, 0, by);
       by.push_back(p.director.tilt_deg.index);
       s.sample = p;
     },
     false, true},
    {"plate with a tilted axis",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = plate(b, s, 20, 30, by); }, false, false},
};

/// The same of two ways to compute it; a millionth of a pixel between them changes an intensity by a few millionths of
/// a fringe, a derivative relatively as much.
void expect_same(const Image& x, const Image& y, const std::string& what) {
  double size_of = 0, error = 0;
  for (std::size_t i = 0; i < y.values().size(); ++i) {
    size_of = std::max(size_of, std::abs(y.values()[i]));
    error = std::max(error, std::abs(x.values()[i] - y.values()[i]));
  }
  EXPECT_GT(size_of, 0) << what;
  EXPECT_LE(error, 1e-4 * size_of) << what;
}

TEST(HalfTurn, HalfAPictureIsComputedWhereTheOtherIsTheSame) {
  for (const Case& c : kCases)
    for (const int size : {30, 31}) {  // without and with a row in the middle
      TableBuilder b;
      Scene s;
      s.view.width = size + 3;
      s.view.height = size;
      s.view.pixel_size_um = b.fixed("pixel_size_um", 0.3);
      s.view.center_x_px = b.fixed("center_x", 0.5 * (s.view.width - 1));
      s.view.center_y_px = b.fixed("center_y", 0.5 * (s.view.height - 1));
      s.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
      s.microscope.polarizer_deg = b.fixed("polarizer_deg", 10);
      s.microscope.analyzer_deg = b.fixed("analyzer_deg", 83);
      s.material = ConstantIndices{b.fixed("ordinary", 1.52), b.fixed("birefringence", 0.12)};
      s.surround_index = b.fixed("surround", 1.45);
      std::vector<int> by;
      c.build(b, s, by);
      by.push_back(s.microscope.analyzer_deg.index);
      const Theta centred = b.table.values();
      Theta beside = centred;  // a millionth of a pixel: no symmetry that could be used
      beside[static_cast<std::size_t>(s.view.center_x_px.index)] += 1e-6;
      const RenderPlan p = plan(s, centred);
      EXPECT_EQ(symmetry_of<double>(s, p, Values<double>(centred, {})) == Symmetry::half_turn, c.half_of_values)
          << c.name;
      EXPECT_EQ(symmetry_of<double>(s, p, Values<double>(beside, {})), Symmetry::none) << c.name;
      EXPECT_EQ(symmetry_of<Dual4>(s, p, Values<Dual4>(centred, by)) == Symmetry::half_turn, c.half) << c.name;
      const Image alone = render(s, p, centred, {}).intensity, whole_alone = render(s, p, beside, {}).intensity;
      const Rendering half = render(s, p, centred, by), whole = render(s, p, beside, by);
      expect_same(alone, whole_alone, std::string(c.name) + ", image alone");
      expect_same(half.intensity, whole.intensity, std::string(c.name) + ", image");
      for (std::size_t j = 0; j < by.size(); ++j)
        expect_same(half.derivatives[j], whole.derivatives[j], std::string(c.name) + ", " + b.table[by[j]].name);
    }
}

struct Mirrored {
  const char* name;
  std::function<void(TableBuilder&, Scene&, std::vector<int>&)> build;
  double polarizer_deg, analyzer_deg;
  bool mirror;
};
Droplet bipolar(TableBuilder& b, double azimuth_deg, double tilt_deg, std::vector<int>& by, bool searched) {
  Droplet d = droplet(b, by);
  const BipolarDirector director{b.fixed("azimuth_deg", azimuth_deg), b.fixed("tilt_deg", tilt_deg),
                                 b.fixed("pole_distance", 1.2)};
  by.insert(by.end(), {director.tilt_deg.index, director.pole_distance.index});
  if (searched) by.push_back(director.azimuth_deg.index);
  d.director = director;
  return d;
}
const Mirrored kMirrored[] = {
    {"radial droplet beside the middle",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = droplet(b, by); }, 0, 90, true},
    {"its polarizers turned", [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = droplet(b, by); }, 10,
     100, false},
    {"twisted droplet",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) {
       Droplet d = droplet(b, by);
       d.director = RadialDirector{b.fixed("twist_deg", 50)};
       s.sample = d;
     },
     0, 90, false},
    {"tilted bipolar droplet",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = bipolar(b, 0, 30, by, false); }, 90, 0, true},
    {"poles along y", [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = bipolar(b, 90, 0, by, false); },
     0, 0, false},
    {"its azimuth searched",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = bipolar(b, 0, 30, by, true); }, 0, 90, false},
    {"poles out of the mirror",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = bipolar(b, 20, 30, by, false); }, 0, 90, false},
    {"shell with its core aside",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) {
       Droplet d = droplet(b, by);
       ShellDirector shell;
       shell.wall_um = b.fixed("wall_um", 1.2);
       shell.offset_um = {b.fixed("offset_x", 0.3), b.fixed("offset_y", 0.0), b.fixed("offset_z", 0.1)};
       d.director = shell;
       s.sample = d;
       by.clear();  // no bound to the slopes where a ray touches the core
     },
     0, 90, true},
    {"plate with its axis tilted in the mirror",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = plate(b, s, 0, 30, by); }, 0, 90, true},
    {"plate with its axis tilted across",
     [](TableBuilder& b, Scene& s, std::vector<int>& by) { s.sample = plate(b, s, 45, 30, by); }, 0, 90, false},
};

// The centre may lie anywhere on the middle row, and be searched along it.
TEST(Mirror, HalfAPictureIsComputedWhereTheOtherIsItsMirrorImage) {
  for (const Mirrored& c : kMirrored)
    for (const int size : {30, 31}) {
      TableBuilder b;
      Scene s;
      s.view.width = size + 3;
      s.view.height = size;
      s.view.pixel_size_um = b.fixed("pixel_size_um", 0.3);
      s.view.center_x_px = b.fixed("center_x", 0.5 * size - 1.7);
      s.view.center_y_px = b.fixed("center_y", 0.5 * (s.view.height - 1));
      s.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
      s.microscope.polarizer_deg = b.fixed("polarizer_deg", c.polarizer_deg);
      s.microscope.analyzer_deg = b.fixed("analyzer_deg", c.analyzer_deg);
      s.material = ConstantIndices{b.fixed("ordinary", 1.52), b.fixed("birefringence", 0.12)};
      s.surround_index = b.fixed("surround", 1.45);
      std::vector<int> by;
      c.build(b, s, by);
      if (!by.empty()) by.push_back(s.view.center_x_px.index);
      const Theta middle = b.table.values();
      Theta beside = middle;
      beside[static_cast<std::size_t>(s.view.center_y_px.index)] += 1e-6;
      const RenderPlan p = plan(s, middle);
      EXPECT_EQ(symmetry_of<Dual4>(s, p, Values<Dual4>(middle, by)) == Symmetry::mirror, c.mirror) << c.name;
      EXPECT_EQ(symmetry_of<Dual4>(s, p, Values<Dual4>(beside, by)), Symmetry::none) << c.name;
      std::vector<int> by_angle{s.microscope.analyzer_deg.index};
      EXPECT_NE(symmetry_of<Dual1>(s, p, Values<Dual1>(middle, by_angle)), Symmetry::mirror) << c.name;
      const Rendering half = render(s, p, middle, by), whole = render(s, p, beside, by);
      expect_same(half.intensity, whole.intensity, std::string(c.name) + ", image");
      for (std::size_t j = 0; j < by.size(); ++j)
        expect_same(half.derivatives[j], whole.derivatives[j], std::string(c.name) + ", " + b.table[by[j]].name);
    }
}

}  // namespace
}  // namespace birefit
