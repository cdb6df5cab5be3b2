// What stands between rays and pixels: means of fringes over a pixel, and the table over a droplet's radius.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <random>

#include "birefit/render.h"
#include "render/droplet.h"
#include "render/fringe.h"
#include "render/radial_table.h"
#include "scene_builder.h"

namespace birefit {
namespace {

/// A fringe with curved phase and amplitude, as functions of the place in pixels.
struct Fringe {
  double slope_x, slope_y, curvature, size_of_quadrature = 0;
  template <class T>
  T mean(const T& x, const T& y) const {
    return 0.5 + 0.01 * x - 0.02 * y + 0.003 * x * x;
  }
  template <class T>
  T amplitude(const T& x, const T& y) const {
    return 0.4 + 0.02 * x + 0.01 * y + 0.002 * x * y - 0.003 * y * y;
  }
  template <class T>
  T quadrature(const T& x, const T& y) const {
    return size_of_quadrature * (0.3 - 0.03 * x + 0.02 * y + 0.002 * x * x);
  }
  template <class T>
  T phase(const T& x, const T& y) const {
    return 1.3 + slope_x * x + slope_y * y + curvature * (0.5 * x * x + 0.7 * x * y - 0.3 * y * y);
  }
};

double mean_by_quadrature(const Fringe& f) {
  constexpr int n = 400;  // midpoints: slope^2 / (24 n^2) of the amplitude, 1e-5
  double sum = 0;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const double x = (i + 0.5) / n - 0.5, y = (j + 0.5) / n - 0.5;
      sum += f.mean(x, y) + f.amplitude(x, y) * std::cos(f.phase(x, y)) - f.quadrature(x, y) * std::sin(f.phase(x, y));
    }
  return sum / (n * n);
}

// Third order in the curvature: (curvature/8)^2 of the amplitude at most, whatever the slope.
TEST(PixelMeans, FringesOfAnyFinenessHaveTheirMean) {
  for (const Fringe& f : {Fringe{0, 0, 0}, Fringe{1e-3, 0, 0.05}, Fringe{0.3, -0.2, 0.05}, Fringe{2.5, 1.1, 0.05}, Fringe{-4.7, 5.9, 0.05},
                          Fringe{2 * std::numbers::pi, 0, 0}, Fringe{2.5, 1.1, 0.05, 1}, Fringe{0.3, -5.9, 0.05, -1}}) {
    FringePoint<double> p[3][3];
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i)
        p[j][i] = {f.amplitude(i - 1.0, j - 1.0), f.phase(i - 1.0, j - 1.0), f.mean(i - 1.0, j - 1.0), f.quadrature(i - 1.0, j - 1.0)};
    EXPECT_NEAR(fringe_mean<true>(p), mean_by_quadrature(f), 2e-5) << f.slope_x << ' ' << f.slope_y;
    if (f.size_of_quadrature == 0) {
      EXPECT_EQ(fringe_mean<true>(p), fringe_mean<false>(p));
    }
  }
}

TEST(PixelMeans, DerivativesOfAMeanAreThoseOfDifferences) {
  using D = Dual<double, 1>;
  const auto at = [](auto slope) {
    using T = decltype(slope);
    FringePoint<T> p[3][3];
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i)
        p[j][i] = {0.4 + 0.03 * slope * double(j), slope * (i - 1.0) + 0.4 * slope * slope * (j - 1.0), T(0.5) + slope * (0.1 * i),
                   0.1 + 0.02 * slope * double(i)};
    return fringe_mean<true>(p);
  };
  for (double slope : {0.0, 1e-4, 0.17, 1.0, 2.8, 3.1, 3.2, 4.0}) {  // q = 2.5, up to which a series serves, are slopes of 3.16 and, down the rows, 2.81
    D x(slope);
    x.d[0] = 1;
    const double h = 1e-3;
    const double coarse = (at(slope + h) - at(slope - h)) / (2 * h), fine = (at(slope + h / 2) - at(slope - h / 2)) / h;
    EXPECT_NEAR(at(x).d[0], (4 * fine - coarse) / 3, 1e-9) << slope;
  }
}

/// Worst and RMS difference of a droplet's picture from one of pixels a ninth the size, averaged.
template <class Director>
std::array<double, 2> from_finer_pixels(double diameter_um, double pixel_um, double off_px, const Director& director, double birefringence = 0.22) {
  constexpr int kSize = 48, kFiner = 9;
  const auto picture = [&](int finer) {
    testing::TableBuilder b;
    Scene s;
    Droplet droplet;
    droplet.diameter_um = b.fixed("diameter_um", diameter_um);
    director(b, droplet);
    s.sample = droplet;
    s.material = ConstantIndices{b.fixed("ordinary", 1.52), b.fixed("birefringence", birefringence)};
    s.surround_index = b.fixed("surround", 1.5);
    s.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
    s.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
    s.microscope.analyzer_deg = b.fixed("analyzer_deg", 90);
    s.view.width = s.view.height = kSize * finer;
    s.view.pixel_size_um = pixel_um / finer;
    // The same place: pixel centres are whole numbers.
    const double centre = (0.5 * kSize + off_px + 0.5) * finer - 0.5;
    s.view.center_x_px = b.fixed("center_x", centre);
    s.view.center_y_px = b.fixed("center_y", centre);
    const Theta theta = b.table.values();
    return render(s, plan(s, theta), theta, {}, 1).intensity;
  };
  const Image coarse = picture(1), fine = picture(kFiner);
  double worst = 0, square = 0;
  for (int row = 0; row < kSize; ++row)
    for (int column = 0; column < kSize; ++column) {
      double sum = 0;
      for (int j = 0; j < kFiner; ++j)
        for (int i = 0; i < kFiner; ++i) sum += fine(kFiner * column + i, kFiner * row + j);
      const double error = std::abs(coarse(column, row) - sum / (kFiner * kFiner));
      worst = std::max(worst, error);
      square += error * error;
    }
  return {worst, std::sqrt(square / (kSize * kSize))};
}

TEST(PixelMeans, OfShellsAndDropletsAreThoseOfFinerPixels) {
  for (const double off : {0.0, 0.31})
    for (const double pixel : {0.15, 0.3})
      for (const double wall : {0.0, 0.4, 0.47, 1.1, 2.3}) {
        const auto [worst, rms] = from_finer_pixels(40 * pixel, pixel, off, [&](testing::TableBuilder& b, Droplet& droplet) {
          if (wall == 0) return;
          ShellDirector shell;
          shell.wall_um = b.fixed("wall_um", wall);
          droplet.director = shell;
        });
        // The edge of a core, where the retardance has a kink without a bound to its slope, is no worse than the rest.
        EXPECT_LT(worst, 2e-3) << "wall " << wall << " um, pixel " << pixel << " um, off " << off;
        EXPECT_LT(rms, 2e-4) << "wall " << wall << " um, pixel " << pixel << " um, off " << off;
      }
}

// Anywhere among droplets, shells and fields, not only where somebody looked: a retardance may turn back within a pixel, and then its ends say
// nothing of what lies between them (such pixels were up to 0.04 wrong once, in one of four droplets in a field).
TEST(PixelMeans, OfRandomDropletsAreThoseOfFinerPixels) {
  std::mt19937_64 random(20);
  const auto between = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const auto radial = [](testing::TableBuilder&, Droplet&) {};
  const auto shell = [&](testing::TableBuilder& b, Droplet& droplet) {
    ShellDirector director;
    director.wall_um = b.fixed("wall_um", between(0.3, 2));
    droplet.director = director;
  };
  const auto in_field = [&](testing::TableBuilder& b, Droplet& droplet) {
    AxialDirector director;
    director.reduced_field = b.fixed("reduced_field", between(1, 39));
    droplet.director = director;
  };
  struct Family {
    const char* name;
    int draws;
    double worst;
    std::function<void(testing::TableBuilder&, Droplet&)> director;
  };
  // The worst are at the axis, the core's edge and the rim, where pixels are planned by place, not by phase; a strong field turns the director within a pixel of the rim.
  for (const Family& family : {Family{"radial", 60, 2e-3, radial}, {"shell", 60, 4e-3, shell}, {"in a field", 120, 6e-3, in_field}}) {
    double worst_of_all = 0, rms_of_all = 0;
    for (int draw = 0; draw < family.draws; ++draw) {
      const double pixel = between(0.12, 0.35), diameter = std::min(16.0, pixel * between(18, 44)), off = between(-0.5, 0.5), birefringence = between(0.05, 0.35);
      // The same director for both pictures.
      const std::mt19937_64 state = random;
      std::mt19937_64 after = state;
      const auto same = [&](testing::TableBuilder& b, Droplet& droplet) {
        random = state;
        family.director(b, droplet);
        after = random;
      };
      const auto [worst, rms] = from_finer_pixels(diameter, pixel, off, same, birefringence);
      random = after;
      worst_of_all = std::max(worst_of_all, worst), rms_of_all = std::max(rms_of_all, rms);
      EXPECT_LT(worst, family.worst) << family.name << ' ' << draw << ": " << diameter << " um, pixel " << pixel << " um, off " << off << ", birefringence " << birefringence;
      EXPECT_LT(rms, 3e-4) << family.name << ' ' << draw;
    }
    std::printf("  %s: %d pictures, worst pixel %.1e, worst rms %.1e\n", family.name, family.draws, worst_of_all, rms_of_all);
  }
}

// Points a pixel are planned from the fringes on 64 radii and 24 azimuths, and a boojum at a bipolar droplet's pole lies between them: a few
// pixels there are means of too few points. The edge of a core off the middle is no worse.
TEST(PixelMeans, OfUnsymmetricDropletsAreThoseOfFinerPixels) {
  using testing::TableBuilder;
  const auto bipolar = [](TableBuilder& b, Droplet& droplet) { droplet.director = BipolarDirector{b.fixed("azimuth_deg", 25), b.fixed("tilt_deg", 10), {}}; };
  const auto in_field = [](TableBuilder& b, Droplet& droplet) {
    AxialDirector axial;
    axial.reduced_field = b.fixed("reduced_field", 6), axial.field_azimuth_deg = b.fixed("azimuth_deg", 25);
    droplet.director = axial;
  };
  const auto shell = [](double wall_um, double x_um) {
    return [=](TableBuilder& b, Droplet& droplet) {
      ShellDirector director;
      director.wall_um = b.fixed("wall_um", wall_um);
      director.offset_um = {b.fixed("x", x_um), b.fixed("y", -0.2), b.fixed("z", 0.1)};
      droplet.director = director;
    };
  };
  struct Sample {
    const char* name;
    std::function<void(TableBuilder&, Droplet&)> director;
    double worst, rms;
  };
  for (const Sample& s : {Sample{"bipolar", bipolar, 3e-3, 1e-4}, {"in a field", in_field, 1e-3, 1e-4}, {"shell", shell(1.5, 0.5), 3e-3, 2e-4}, {"thin shell", shell(0.6, 0.2), 3e-3, 2e-4}})
    for (const double off : {0.0, 0.31})
      for (const double pixel : {0.15, 0.3}) {
        const auto [worst, rms] = from_finer_pixels(40 * pixel, pixel, off, s.director);
        EXPECT_LT(worst, s.worst) << s.name << ", pixel " << pixel << " um, off " << off;
        EXPECT_LT(rms, s.rms) << s.name << ", pixel " << pixel << " um, off " << off;
      }
}

// The series' pictures take as few points a pixel as 96 pixels show to be enough, and say thrice the worst of those. With 8 x 8 points as the
// truth (wherever fewer were planned) every pixel is within the accuracy asked, and what is said is not less than half the worst pixel's error.
TEST(PixelMeans, OfWavePicturesAreAsGoodAsThePlanSays) {
  for (const double diameter : {4.0, 9.0, 20.0, 40.0})
    for (const double na : {0.3, 0.8, 1.3})
      for (const double pixel : {0.05, 0.1, 0.2, 0.4, 0.8}) {
        testing::TableBuilder b;
        Scene s;
        Droplet droplet;
        droplet.diameter_um = b.fixed("diameter_um", diameter);
        s.sample = droplet;
        s.material = ConstantIndices{b.fixed("ordinary", 1.52), b.fixed("birefringence", 0.22)};
        s.surround_index = b.fixed("surround", 1.43);
        s.ceiling = Ceiling::wave;
        s.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
        s.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
        s.microscope.analyzer_deg = b.fixed("analyzer_deg", 90);
        s.microscope.objective_na = na;
        const int size = std::min(200, 2 * static_cast<int>(0.7 * diameter / pixel) + 8);
        s.view.width = s.view.height = size;
        s.view.pixel_size_um = pixel;
        s.view.center_x_px = b.fixed("center_x", 0.5 * size + 0.3);
        s.view.center_y_px = b.fixed("center_y", 0.5 * size - 0.2);
        const Theta theta = b.table.values();
        const RenderPlan planned = plan(s, theta);
        RenderPlan fine = planned;
        fine.samples = {8};
        const Image picture = render(s, planned, theta, {}, 1).intensity, truth = render(s, fine, theta, {}, 1).intensity;
        double worst = 0;
        for (std::size_t i = 0; i < picture.size(); ++i) worst = std::max(worst, std::abs(picture.values()[i] - truth.values()[i]));
        EXPECT_LE(worst, s.intensity_accuracy) << diameter << " um, NA " << na << ", pixels of " << pixel << " um";
        EXPECT_LE(worst, 2 * planned.numerical_error) << diameter << " um, NA " << na << ", pixels of " << pixel << " um";
      }
}

// Degree 11 on panels of 1/6 of a smooth function of 5 radians: (5/12)^12 / (2^11 12!) = 3e-17; powers lose (1 + sqrt 2)^11
// = 16,000 units of rounding, derivatives (11^2 x 2 x 6 panels / 2) more at a panel's end.
TEST(RadialTable, ReadsWhatWasTabulatedWithItsDerivatives) {
  using D = Dual<Pack, 1>;
  D scale(Pack(5.0));
  scale.d[0] = Pack(1.0);
  const RadialTable<D> table(6, 3, 2, [&](const Pack& v, D* out) {
    D s, c;
    sin_cos(scale * D(v), s, c);
    out[0] = s, out[1] = c, out[2] = scale * D(v * v);
  });
  for (double v0 = 0.003; v0 < 1; v0 += 0.0371) {
    // Lanes in different panels.
    alignas(64) double places[kLanes];
    for (int k = 0; k < kLanes; ++k) places[k] = std::fmod(v0 + 0.3 * k, 1.0);
    const Pack v = Pack::load_aligned(places), basis[3]{Pack(1.0), Pack(1.0), Pack(1.0)}, turned[3]{Pack(0.0), Pack(-2.0), Pack(0.0)};
    RadialTable<D>::Slopes slopes;
    const D sum = table.sum<3>(v, basis, turned, &slopes);
    for (int k = 0; k < kLanes; ++k) {
      const double x = places[k];
      EXPECT_NEAR(lane(sum.value, k), std::sin(5 * x) + std::cos(5 * x) + 5 * x * x, 2e-11);
      const double along = 5 * std::cos(5 * x) - 5 * std::sin(5 * x) + 10 * x;
      EXPECT_NEAR(lane(slopes.by_v, k), along, 2e-9);
      EXPECT_NEAR(lane(sum.d[0], k), x * std::cos(5 * x) - x * std::sin(5 * x) + x * x, 2e-9);
      EXPECT_NEAR(lane(slopes.turned, k), -2 * std::cos(5 * x), 2e-11);
    }
  }
}

// A start good enough for two Newton steps: within 5e-5 rad of the angle it stands for.
TEST(RadialTable, TheAngleOfIncidenceIsFoundFromTheRadius) {
  for (const auto& [n_o, n_host] : {std::pair{1.52, 1.43}, {1.52, 1.54}, {1.52, 1.0}, {1.55, 1.567}}) {
    const RimTable rim(n_host / n_o, n_host, 0);
    for (int i = 1; i < 2000; ++i) {
      const double psi = rim.psi_max() * i / 2000;
      EXPECT_NEAR(rim.psi_at(rim.rho_over_radius(psi)), psi, 5e-5) << n_host;
    }
  }
}

// The rim's place and its derivatives by the indices, however the accepted rays end.
TEST(RadialTable, TheRimMovesWithTheIndices) {
  struct Rim {
    double n_o, n_host, na;
    RimTable::End end;
  };
  for (const Rim& c : {Rim{1.52, 1.43, 0, RimTable::End::grazing}, Rim{1.52, 1.54, 0, RimTable::End::total_reflection},
                       Rim{1.52, 1.0, 0.5, RimTable::End::turned}, Rim{1.52, 1.43, 0.2, RimTable::End::turned}}) {
    const auto rho_max = [&](double n_o, double n_host) { return RimTable(n_host / n_o, n_host, c.na).rho_max(); };
    using D = Dual<double, 2>;
    D n_o(c.n_o), n_host(c.n_host);
    n_o.d[0] = 1, n_host.d[1] = 1;
    const RimTable rim(c.n_host / c.n_o, c.n_host, c.na);
    ASSERT_EQ(rim.end(), c.end);
    const D edge = rim_edge<D>(rim, n_host / n_o, n_host);
    EXPECT_NEAR(edge.value, rim.rho_max(), 1e-7);  // total reflection: the root of the bisection's 1e-16
    const double h = 1e-3;
    EXPECT_NEAR(edge.d[0], (rho_max(c.n_o + h, c.n_host) - rho_max(c.n_o - h, c.n_host)) / (2 * h), 1e-3) << c.na;
    EXPECT_NEAR(edge.d[1], (rho_max(c.n_o, c.n_host + h) - rho_max(c.n_o, c.n_host - h)) / (2 * h), 1e-3) << c.na;
  }
}

}  // namespace
}  // namespace birefit
