// The slow solutions of the coupled modes.

#include <gtest/gtest.h>

#include "independent_camera.h"
#include "medium/families/planar.h"
#include "profiles.h"
#include "samples/choices.h"
#include "samples/layers/cone_view.h"
#include "samples/tables/fringe_table.h"
#include "scene_builder.h"
#include "study/answer.h"
#include "study/rays.h"
#include "transport/methods.h"

namespace birefit {
namespace {
using namespace testing;
using study::relative_distance;

Ray<double> ray_of(const study::RaySpec& spec, Continuity c) {
  return {2 * std::numbers::pi / spec.wavelength_um, spec.kx, spec.ky, c};
}
study::RaySpec spec_of(const std::string& name) {
  for (const study::RaySpec& spec : study::ray_specs())
    if (spec.name == name) return spec;
  throw std::logic_error(name);
}

// 230 and 310 rad between the modes in 64 nodes where Magnus of order 6 needs thousands of steps; 1e-10 is what 1e4 rad
// of common phase leave of rounding in products of thousands of matrices.
TEST(Modal, ThickSlabsInAFewNodes) {
  for (const char* name : {"evaluation_slab", "e44_plate"})
    for (const Continuity c : {Continuity::e_only, Continuity::e_and_h}) {
      const auto column = study::ray_column<double>(name, 0.0);
      const Ray<double> ray = ray_of(spec_of(name), c);
      const Mat2<double> exact = Magnus6<double>().transfer(*column, ray, uniform_mesh(16384));
      EXPECT_LT(relative_distance(Modal<double>().transfer(*column, ray, uniform_mesh(8)), exact), 1e-10) << name;
    }
}

// Every pass gains a power of 1/(phase over the length on which the medium changes): of 5 um and 8 rad, about 1/3.
TEST(Modal, EveryPassGainsAPower) {
  const auto column = study::ray_column<double>("twisted_cell", 0.0);
  for (const Continuity c : {Continuity::e_only, Continuity::e_and_h}) {
    const Ray<double> ray = ray_of(spec_of("twisted_cell"), c);
    const Mat2<double> exact = Magnus6<double>().transfer(*column, ray, uniform_mesh(4096));
    double before = relative_distance(together(modal_transfer(*column, ray, uniform_mesh(8), 0)), exact);
    for (int passes = 1; passes <= 4; ++passes) {
      const double now = relative_distance(together(modal_transfer(*column, ray, uniform_mesh(8), passes)), exact);
      EXPECT_LT(now, 0.4 * before) << passes;
      before = now;
    }
  }
}

// A lossless column keeps the flux: <S_z> = Re(E_x H_y* - E_y H_x*)/2 with H = Y E, the same at both ends.
TEST(Modal, FluxIsKept) {
  const TiltTwistLaw law{10 * kDeg, 50 * kDeg, 20 * kDeg, 35 * kDeg, 80 * kDeg, 1.52, 1.74, 300};
  const LawColumn<double, TiltTwistLaw> column(law);
  const Ray<double> ray{2 * std::numbers::pi / 0.59, 0.35, -0.2, Continuity::e_and_h};
  const Mat2<double> t = Modal<double>().transfer(column, ray, uniform_mesh(8));
  const auto flux = [&](double u, const Complex<double>& ex, const Complex<double>& ey) {
    OpticalPoint<double> p;
    column.sample({&u, 1}, &p);
    const Matrix2<double> y = one_way_lossless(p, ray.kx, ray.ky).admittance;
    const Complex<double> hx = y.a * ex + y.b * ey, hy = y.c * ex + y.d * ey;
    return (ex * conj(hy) - ey * conj(hx)).re;
  };
  for (const double angle : {0.0, 0.4, 1.1, 2.0}) {
    const Complex<double> ex(std::cos(angle)), ey(std::sin(angle));
    const double in = flux(0, ex, ey), out = flux(1, t.a * ex + t.b * ey, t.c * ex + t.d * ey);
    EXPECT_NEAR(out / in, 1, 1e-10) << angle;  // 3,000 rad, rounded
  }
}

TEST(Modal, RefusesJumps) {
  LawColumn<double, TiltTwistLaw> column(TiltTwistLaw{0, 0, 0, 0, 0, 1.5, 1.6, 5});
  column.jumps = true;
  EXPECT_THROW(Modal<double>().transfer(column, ray_of(spec_of("twisted_cell"), Continuity::e_only), uniform_mesh(4)),
               std::logic_error);
}

/// A plate of 0.2 mm seen in a cone of 8 degrees, its axis 40 degrees out of its plane; its birefringence and that
/// tilt.
std::pair<ParameterRef, ParameterRef> put_tilted_plate(TableBuilder& table, Scene& scene) {
  Plate plate;
  plate.thickness_um = table.fixed("thickness_um", 200);
  plate.director.azimuth_deg = table.fixed("azimuth_deg", 25);
  plate.director.tilt_deg = table.fixed("tilt_deg", 40);
  plate.half_angle_deg = table.fixed("half_angle_deg", 8);
  scene.sample = plate;
  ConstantIndices material;
  material.ordinary = table.fixed("ordinary", 1.53);
  material.birefringence = table.fixed("birefringence", 0.2);
  scene.material = material;
  scene.microscope.wavelength_nm = table.fixed("wavelength_nm", 640);
  return {material.birefringence, plate.director.tilt_deg};
}

/// `planned` with squares of 24 pixels, of them interpolated those for which interpolated(column, row) of the square.
RenderPlan in_squares(const RenderPlan& planned, const Scene& scene, bool (*interpolated)(int, int)) {
  RenderPlan plan = planned;
  choices(plan).fringe_block_px = 24;
  choices(plan).fringe_blocks.clear();
  const FringeBlocks blocks(scene.view.width, scene.view.height, choices(plan).fringe_block_px);
  for (int row = 0; row < blocks.rows; ++row)
    for (int column = 0; column < blocks.columns; ++column)
      choices(plan).fringe_blocks.push_back(interpolated(column, row));
  return plan;
}
bool every(int, int) { return true; }
bool none(int, int) { return false; }
bool every_other(int column, int row) { return (column + row) % 2 == 1; }

// A picture interpolated from a few rays is the picture of all rays: within a hundredth of the accuracy asked,
// derivatives with it; by what carries the fringes along to the 1e-5 to which three pixels give slopes (planar.cc).
TEST(FringeTable, PicturesOfFewRaysAreThoseOfAll) {
  for (const auto& [absorbing_slab, from_side] : {std::pair{false, false}, {true, false}, {false, true}}) {
    TableBuilder table;
    Scene scene;
    scene.view.width = 90, scene.view.height = 70;
    scene.microscope.polarizer_deg = table.fixed("polarizer_deg", 10);
    scene.microscope.analyzer_deg = table.fixed("analyzer_deg", 95);
    scene.surround_index = table.fixed("index", 1.0);
    scene.view.center_x_px = table.fixed("center_x", 41.3);
    scene.view.center_y_px = table.fixed("center_y", 36.2);
    std::vector<int> active{scene.microscope.polarizer_deg.index, scene.microscope.analyzer_deg.index,
                            scene.surround_index.index, scene.view.center_x_px.index, scene.view.center_y_px.index};
    if (absorbing_slab) {
      Slab slab;
      slab.profile.interpolation = SlabProfile::Interpolation::cubic;
      const auto column = study::ray_column<double>("evaluation_slab", 0.0);
      for (int i = 0; i < 9; ++i) {
        const double u = i / 8.0;
        OpticalPoint<double> p;
        column->sample({&u, 1}, &p);
        slab.profile.rows.push_back(
            {300 * u, p.axis.x, p.axis.y, p.axis.z, std::sqrt(p.ordinary), std::sqrt(p.extraordinary), 0, 3e-4});
      }
      slab.half_angle_deg = table.fixed("half_angle_deg", 3);
      scene.microscope.wavelength_nm = table.fixed("wavelength_nm", 500);
      scene.sample = slab;
      active.push_back(slab.half_angle_deg.index);
    } else {
      const auto [birefringence, tilt] = put_tilted_plate(table, scene);
      active.push_back(birefringence.index);
      active.push_back(tilt.index);
      active.push_back(std::get<Plate>(scene.sample).half_angle_deg.index);
    }
    if (from_side) {
      scene.view.camera =
          SideCamera{table.fixed("tilt_x_deg", 25), table.fixed("tilt_y_deg", -12), table.fixed("half_field_deg", 20)};
      for (const ParameterRef& ref :
           {scene.view.camera->tilt_x_deg, scene.view.camera->tilt_y_deg, scene.view.camera->half_field_deg})
        active.push_back(ref.index);
    }
    active.push_back(scene.microscope.wavelength_nm.index);
    const int unused = table.fixed("unused", 1).index;
    const Theta theta = table.table.values();
    const RenderPlan few = plan(scene, theta);
    EXPECT_EQ(few.method, absorbing_slab ? "modal" : "diagonal");
    ASSERT_GT(choices(few).fringe_block_px, 0);
    RenderPlan all = few;
    choices(all).fringe_block_px = 0;
    choices(all).fringe_blocks.clear();
    const Rendering a = render(scene, few, theta, active), b = render(scene, all, theta, active);
    double worst = 0, brightest = 0;
    for (std::size_t i = 0; i < a.intensity.size(); ++i) {
      worst = std::max(worst, std::abs(a.intensity.values()[i] - b.intensity.values()[i]));
      brightest = std::max(brightest, b.intensity.values()[i]);
    }
    EXPECT_LT(worst, 0.01 * few.demand.intensity_accuracy);
    EXPECT_GT(brightest, 0.3);
    std::vector<int> carrying{scene.view.center_x_px.index, scene.view.center_y_px.index};
    std::visit(
        [&](const auto& sample) {
          if constexpr (requires { sample.half_angle_deg; }) carrying.push_back(sample.half_angle_deg.index);
        },
        scene.sample);
    const auto compare = [&](const Rendering& table, std::size_t place, std::size_t j) {
      double error = 0, size = 0;
      for (std::size_t i = 0; i < b.intensity.size(); ++i) {
        error = std::max(error, std::abs(table.derivatives[place].values()[i] - b.derivatives[j].values()[i]));
        size = std::max(size, std::abs(b.derivatives[j].values()[i]));
      }
      const bool carried = std::find(carrying.begin(), carrying.end(), active[j]) != carrying.end();
      EXPECT_LT(error, (carried ? 1e-5 : 1e-6) * size) << absorbing_slab << " " << j;
      EXPECT_GT(size, 0) << j;
    };
    for (std::size_t j = 0; j < active.size(); ++j) compare(a, j, j);
    // Some at a time, in any order: what the medium knows, what comes after it (polarizers, wavelength) and what moves
    // the picture take different ways. Once from the table alone, once with every other square traced: what is left out
    // of a table's derivatives is not what rays leave out.
    const RenderPlan mixed = in_squares(few, scene, every_other);
    const std::size_t wave = active.size() - 1;
    for (const std::vector<std::size_t>& some : std::vector<std::vector<std::size_t>>{{wave},
                                                                                      {3},
                                                                                      {wave, 0},
                                                                                      {2, wave},
                                                                                      {3, 2},
                                                                                      {wave, 1, 0},
                                                                                      {wave, 2, 0},
                                                                                      {4, 0, 5, 2},
                                                                                      {0, wave, 2, 1, 3},
                                                                                      {wave, 0, 1, 2, 5}}) {
      std::vector<int> list;
      for (const std::size_t j : some) list.push_back(active[j]);
      for (const RenderPlan& p : {few, mixed}) {
        const Rendering part = render(scene, p, theta, list);
        for (std::size_t k = 0; k < some.size(); ++k) compare(part, k, some[k]);
      }
    }
    for (const RenderPlan& p : {few, mixed}) {
      const Rendering part = render(scene, p, theta, {unused, active[wave]});
      const auto& by_unused = part.derivatives[0].values();
      EXPECT_TRUE(std::all_of(by_unused.begin(), by_unused.end(), [](double x) { return x == 0; }));
    }
  }
}

// Between the pixels of a picture and the directions of a cone stands a camera in space, and one in front is none.
TEST(ConeView, IsAPinholeInSpace) {
  TableBuilder table;
  Scene scene;
  scene.view.width = 90, scene.view.height = 70;
  scene.view.center_x_px = table.fixed("center_x", 41.3);
  scene.view.center_y_px = table.fixed("center_y", 36.2);
  put_tilted_plate(table, scene);
  const double half = table.table[std::get<Plate>(scene.sample).half_angle_deg].value * std::numbers::pi / 180;
  const Theta plain_theta = table.table.values();
  const ConeView<double> plain_view(scene, Values<double>(plain_theta, {}));
  const SideCamera refs{table.fixed("tilt_x_deg", 0), table.fixed("tilt_y_deg", 0), table.fixed("half_field_deg", 0)};
  scene.view.camera = refs;
  for (const auto& [tilt_x, tilt_y, half_field] :
       {std::array{0.0, 0.0, 35.0}, {40.0, 0.0, 0.0}, {25.0, -12.0, 20.0}, {-50.0, 30.0, 8.0}}) {
    table.table[refs.tilt_x_deg].value = tilt_x;
    table.table[refs.tilt_y_deg].value = tilt_y;
    table.table[refs.half_field_deg].value = half_field;
    const Theta theta = table.table.values();
    const ConeView<double> view(scene, Values<double>(theta, {}));
    const IndependentCamera camera{tilt_x, tilt_y, half_field};
    for (const double column : {-0.5, 17.2, 41.3, 89.5})
      for (const double row : {-0.5, 30.9, 69.5}) {
        const auto t = view.at(column, row);
        const auto [x, y] = camera.on_screen((column - 41.3) / 35, (36.2 - row) / 35);
        EXPECT_NEAR(t.x, std::tan(half) * x, 1e-14);
        EXPECT_NEAR(t.y, std::tan(half) * y, 1e-14);
        const auto [back_column, back_row] = view.pixel_of(t);
        EXPECT_NEAR(back_column, column, 1e-11);
        EXPECT_NEAR(back_row, row, 1e-11);
        if (tilt_x == 0 && tilt_y == 0) {
          EXPECT_EQ(t.x, plain_view.at(column, row).x);
          EXPECT_EQ(t.y, plain_view.at(column, row).y);
        }
      }
  }
}

// A picture planned while the optic axis lay beside it, drawn when its image has come in: there modes turn within a
// pixel, and no polynomial follows.
TEST(FringeTable, SquaresThatAreNoLongerSmoothAreLeftToRays) {
  TableBuilder table;
  Scene scene;
  scene.view.width = 160;
  scene.view.height = 120;
  scene.microscope.polarizer_deg = table.fixed("polarizer_deg", 0);
  scene.microscope.analyzer_deg = table.fixed("analyzer_deg", 90);
  const ParameterRef tilt = put_tilted_plate(table, scene).second;
  Theta theta = table.table.values();
  const RenderPlan few = plan(scene, theta);
  ASSERT_GT(choices(few).fringe_block_px, 0);
  RenderPlan all = few;
  choices(all).fringe_block_px = 0;
  choices(all).fringe_blocks.clear();
  for (const double degrees : {60.0, 86.0, 88.0}) {
    theta[static_cast<std::size_t>(tilt.index)] = degrees;
    const Rendering a = render(scene, few, theta), b = render(scene, all, theta);
    double worst = 0;
    for (std::size_t i = 0; i < a.intensity.size(); ++i)
      worst = std::max(worst, std::abs(a.intensity.values()[i] - b.intensity.values()[i]));
    EXPECT_LT(worst, few.demand.intensity_accuracy) << degrees;
  }
}

// A pixel's samples follow the phase's slope where the pixel is, in the corners, too, where a camera at the side looks
// at the screen most aslant.
TEST(ConeView, CornersHaveTheSamplesTheyNeed) {
  TableBuilder table;
  Scene scene;
  scene.view.width = scene.view.height = 120;
  scene.microscope.polarizer_deg = table.fixed("polarizer_deg", 0);
  scene.microscope.analyzer_deg = table.fixed("analyzer_deg", 90);
  put_tilted_plate(table, scene);
  table.table[std::get<Plate>(scene.sample).thickness_um].value = 600;
  table.table[std::get<Plate>(scene.sample).half_angle_deg].value = 30;
  scene.view.camera =
      SideCamera{table.fixed("tilt_x_deg", 20), table.fixed("tilt_y_deg", 0), table.fixed("half_field_deg", 10)};
  const Theta theta = table.table.values();
  const RenderPlan planned = plan(scene, {.method = "magnus4"}, theta);
  RenderPlan fine = planned;
  fine.means.samples = {8};
  const Image picture = render(scene, planned, theta).intensity, truth = render(scene, fine, theta).intensity;
  double worst = 0;
  for (std::size_t i = 0; i < picture.size(); ++i)
    worst = std::max(worst, std::abs(picture.values()[i] - truth.values()[i]));
  EXPECT_LT(worst, planned.demand.intensity_accuracy);
}

// Wherever squares and registers end, with derivatives or without, a picture is that of all rays.
TEST(FringeTable, AnyWidthWillDo) {
  for (int width = 56; width <= 72; ++width) {
    TableBuilder table;
    Scene scene;
    scene.view.width = width, scene.view.height = 40;
    scene.view.center_x_px = table.fixed("center_x", 0.45 * width);
    scene.view.center_y_px = table.fixed("center_y", 18.2);
    scene.microscope.polarizer_deg = table.fixed("polarizer_deg", 10);
    scene.microscope.analyzer_deg = table.fixed("analyzer_deg", 95);
    put_tilted_plate(table, scene);
    const Theta theta = table.table.values();
    const RenderPlan planned = plan(scene, theta);
    ASSERT_TRUE(planned.means.fringes);
    const Image rays = render(scene, in_squares(planned, scene, none), theta).intensity;
    for (const RenderPlan& p : {in_squares(planned, scene, every), in_squares(planned, scene, every_other)})
      for (const std::vector<int>& by : {std::vector<int>{}, {scene.view.center_x_px.index}}) {
        const Image picture = render(scene, p, theta, by).intensity;
        double worst = 0;
        for (std::size_t i = 0; i < rays.size(); ++i)
          worst = std::max(worst, std::abs(picture.values()[i] - rays.values()[i]));
        EXPECT_LT(worst, 0.01 * planned.demand.intensity_accuracy) << width << " wide, derivatives: " << by.size();
      }
  }
}

// A thin plate in a wide cone has few fringes, so that amplitude and mean change as fast as the phase.
TEST(FringeTable, FringesOfThinPlatesAreCarriedAlongToo) {
  for (const int size : {24, 48, 192}) {
    TableBuilder table;
    Scene scene;
    scene.view.width = scene.view.height = size;
    scene.view.center_x_px = table.fixed("center_x", 0.45 * size);
    scene.view.center_y_px = table.fixed("center_y", 0.53 * size);
    scene.microscope.polarizer_deg = table.fixed("polarizer_deg", 10);
    scene.microscope.analyzer_deg = table.fixed("analyzer_deg", 95);
    put_tilted_plate(table, scene);
    table.table[std::get<Plate>(scene.sample).thickness_um].value = 4;
    table.table[std::get<Plate>(scene.sample).half_angle_deg].value = 35;
    const Theta theta = table.table.values();
    const RenderPlan planned = plan(scene, theta);
    ASSERT_TRUE(planned.means.fringes);
    RenderPlan whole = planned, all = planned;
    choices(whole).fringe_block_px = (size + 2 * FringeBlocks::kRim + 7) / 8 * 8;
    choices(whole).fringe_blocks = {1};
    choices(all).fringe_block_px = 0;
    choices(all).fringe_blocks.clear();
    const std::vector<int> active{scene.view.center_x_px.index, scene.view.center_y_px.index,
                                  std::get<Plate>(scene.sample).half_angle_deg.index};
    const Rendering few = render(scene, whole, theta, active), rays = render(scene, all, theta, active);
    for (std::size_t j = 0; j < active.size(); ++j) {
      double error = 0, largest = 0;
      for (std::size_t i = 0; i < rays.intensity.size(); ++i) {
        error = std::max(error, std::abs(few.derivatives[j].values()[i] - rays.derivatives[j].values()[i]));
        largest = std::max(largest, std::abs(rays.derivatives[j].values()[i]));
      }
      // Of fourth order in the pixel, or to 1e-5 where differences over three pixels do (planar.cc).
      EXPECT_LT(error, (3e-4 * std::pow(24.0 / size, 4) + 1e-5) * largest) << size << " pixels, derivative " << j;
      EXPECT_GT(largest, 0) << j;
    }
  }
}

// The same bits whatever was rendered before, at widths that are no multiple of the lanes, by the same thread.
TEST(FringeTable, PicturesDoNotDependOnTheOnesBefore) {
  TableBuilder table;
  Scene scene;
  scene.view.width = 101, scene.view.height = 40;
  scene.view.center_x_px = table.fixed("center_x", 47);
  scene.view.center_y_px = table.fixed("center_y", 18.2);
  scene.microscope.polarizer_deg = table.fixed("polarizer_deg", 10);
  scene.microscope.analyzer_deg = table.fixed("analyzer_deg", 95);
  put_tilted_plate(table, scene);
  Theta theta = table.table.values();
  RenderPlan rays = plan(scene, theta);
  ASSERT_TRUE(rays.means.fringes);
  choices(rays).fringe_block_px = 0;
  choices(rays).fringe_blocks.clear();
  const Image before = render(scene, rays, theta, {}, 1).intensity;
  Scene other = scene;
  other.view.width = 109;
  Theta steep = theta;
  steep[static_cast<std::size_t>(std::get<Plate>(scene.sample).half_angle_deg.index)] = 30;
  render(other, rays, steep, {}, 1);
  EXPECT_EQ(render(scene, rays, theta, {}, 1).intensity.values(), before.values());

  // From a table and with derivatives, at a width that leaves no register free beyond the picture, after one whose
  // derivatives are steep.
  const RenderPlan table_of = plan(scene, theta);
  ASSERT_GT(choices(table_of).fringe_block_px, 0);
  const std::vector<int> by{scene.view.center_x_px.index, scene.microscope.polarizer_deg.index},
      others{scene.surround_index.index, scene.view.center_y_px.index};
  for (const int width : {100, 101}) {
    scene.view.width = width;
    render(scene, table_of, theta, others, 1);
    const Rendering one = render(scene, table_of, theta, by, 1);
    render(other, rays, steep, others, 1);
    const Rendering two = render(scene, table_of, theta, by, 1);
    EXPECT_EQ(one.intensity.values(), two.intensity.values());
    for (std::size_t j = 0; j < by.size(); ++j) EXPECT_EQ(one.derivatives[j].values(), two.derivatives[j].values());
  }
}

}  // namespace
}  // namespace birefit
