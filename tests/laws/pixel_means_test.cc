// What stands between rays and pixels: means of fringes over a pixel, and the table over a droplet's radius.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "birefit/render.h"
#include "independent_droplet.h"
#include "samples/fringe.h"
#include "samples/sphere/droplet.h"
#include "samples/tables/radial_table.h"
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
  for (const Fringe& f : {Fringe{0, 0, 0}, Fringe{1e-3, 0, 0.05}, Fringe{0.3, -0.2, 0.05}, Fringe{2.5, 1.1, 0.05},
                          Fringe{-4.7, 5.9, 0.05}, Fringe{2 * std::numbers::pi, 0, 0}, Fringe{2.5, 1.1, 0.05, 1},
                          Fringe{0.3, -5.9, 0.05, -1}}) {
    FringePoint<double> p[3][3];
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i)
        p[j][i] = {f.amplitude(i - 1.0, j - 1.0), f.phase(i - 1.0, j - 1.0), f.mean(i - 1.0, j - 1.0),
                   f.quadrature(i - 1.0, j - 1.0)};
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
        p[j][i] = {0.4 + 0.03 * slope * double(j), slope * (i - 1.0) + 0.4 * slope * slope * (j - 1.0),
                   T(0.5) + slope * (0.1 * i), 0.1 + 0.02 * slope * double(i)};
    return fringe_mean<true>(p);
  };
  // q = 2.5, up to which a series serves, are slopes of 3.16 and, down the rows, 2.81
  for (double slope : {0.0, 1e-4, 0.17, 1.0, 2.8, 3.1, 3.2, 4.0}) {
    D x(slope);
    x.d[0] = 1;
    const double h = 1e-3;
    const double coarse = (at(slope + h) - at(slope - h)) / (2 * h), fine = (at(slope + h / 2) - at(slope - h / 2)) / h;
    EXPECT_NEAR(at(x).d[0], (4 * fine - coarse) / 3, 1e-9) << slope;
  }
}

using testing::TableBuilder;
using Director = std::function<void(TableBuilder&, Droplet&)>;

/// A sphere and the camera that looks at it.
struct Sphere {
  double diameter_um, pixel_um, birefringence = 0.22, wavelength_nm = 590, off_x_px = 0.31, off_y_px = 0.31, host = 1.5,
                                analyzer_deg = 90;
  Ceiling ceiling = Ceiling::one_way;
  int size() const { return static_cast<int>(std::ceil(1.05 * diameter_um / pixel_um)) + 6; }
  std::string words() const {
    char text[300];
    std::snprintf(text, sizeof text,
                  "diameter %.17g um, pixel %.17g um, birefringence %.17g, %.17g nm, off %.17g %.17g, host %g, "
                  "analyser %g, ceiling %d",
                  diameter_um, pixel_um, birefringence, wavelength_nm, off_x_px, off_y_px, host, analyzer_deg,
                  static_cast<int>(ceiling));
    return text;
  }
};
struct SphereScene {
  TableBuilder b;
  Scene scene;
  Demand demand;
  std::vector<int> parameters;  ///< diameter, birefringence, ordinary index, host's index, wavelength, centre
};
/// Its scene, every pixel cut into `finer` x `finer`.
SphereScene scene_of(const Sphere& sphere, const Director& director, double accuracy, int finer = 1) {
  SphereScene r;
  r.demand.ceiling = sphere.ceiling, r.demand.intensity_accuracy = accuracy;
  TableBuilder& b = r.b;
  Scene& s = r.scene;
  Droplet droplet;
  droplet.diameter_um = b.fixed("diameter_um", sphere.diameter_um);
  director(b, droplet);
  s.sample = droplet;
  const ConstantIndices material{b.fixed("ordinary", 1.52), b.fixed("birefringence", sphere.birefringence)};
  s.material = material;
  s.surround_index = b.fixed("surround", sphere.host);
  s.microscope.wavelength_nm = b.fixed("wavelength_nm", sphere.wavelength_nm);
  s.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
  s.microscope.analyzer_deg = b.fixed("analyzer_deg", sphere.analyzer_deg);
  s.view.width = s.view.height = sphere.size() * finer;
  s.view.pixel_size_um = b.fixed("pixel_size_um", sphere.pixel_um / finer);
  // The same place: pixel centres are whole numbers.
  const auto centre = [&](double off) { return (0.5 * sphere.size() + off + 0.5) * finer - 0.5; };
  s.view.center_x_px = b.fixed("center_x", centre(sphere.off_x_px));
  s.view.center_y_px = b.fixed("center_y", centre(sphere.off_y_px));
  r.parameters = {droplet.diameter_um.index, material.birefringence.index,     material.ordinary.index,
                  s.surround_index.index,    s.microscope.wavelength_nm.index, s.view.center_x_px.index,
                  s.view.center_y_px.index};
  return r;
}
Image picture_of(const SphereScene& s) {
  const Theta theta = s.b.table.values();
  return render(s.scene, plan(s.scene, s.demand, theta), theta, {}, 1).intensity;
}

/// The largest difference of any pixel from the mean of pixels a ninth the size, in units of the accuracy asked of
/// either, and where it is.
struct WorstPixel {
  double error = 0;
  int column = 0, row = 0;
  double from_rim_px = 0;  ///< of the sphere, inwards
};
WorstPixel from_finer_pixels(const Sphere& sphere, const Director& director, double accuracy) {
  constexpr int kFiner = 9;
  const SphereScene scene = scene_of(sphere, director, accuracy);
  const Image coarse = picture_of(scene), fine = picture_of(scene_of(sphere, director, accuracy, kFiner));
  WorstPixel worst;
  for (int row = 0; row < coarse.height(); ++row)
    for (int column = 0; column < coarse.width(); ++column) {
      double sum = 0;
      for (int j = 0; j < kFiner; ++j)
        for (int i = 0; i < kFiner; ++i) sum += fine(kFiner * column + i, kFiner * row + j);
      const double error = std::abs(coarse(column, row) - sum / (kFiner * kFiner)) / accuracy;
      const double half = 0.5 * sphere.size();
      if (!(error <= worst.error))
        worst = {error, column, row,
                 0.5 * sphere.diameter_um / sphere.pixel_um -
                     std::hypot(column - half - sphere.off_x_px, row - half - sphere.off_y_px)};
    }
  return worst;
}

class Draws {
 public:
  explicit Draws(unsigned long seed) : random_(seed) {}
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  double evenly_in_log(double low, double high) { return low * std::pow(high / low, between(0, 1)); }
  /// Any: 4 to `most_across` pixels across, up to two hundred radians of retardance, fringes far finer than a pixel
  /// among them.
  Sphere sphere(double most_across) {
    Sphere s{};
    s.pixel_um = evenly_in_log(0.05, 1);
    s.diameter_um = s.pixel_um * evenly_in_log(4, most_across);
    s.birefringence = between(0.02, 0.4);
    s.wavelength_nm = between(400, 800);
    s.off_x_px = between(-0.5, 0.5), s.off_y_px = between(-0.5, 0.5);
    s.host = std::array{1.52, 1.5, 1.43, 1.33}[static_cast<std::size_t>(between(0, 4))];
    s.analyzer_deg = std::array{90.0, 0.0, 50.0}[static_cast<std::size_t>(between(0, 3))];
    s.ceiling = between(0, 1) < 0.5 ? Ceiling::e_only : Ceiling::one_way;
    const double radians = 2 * std::numbers::pi * 1000 * s.diameter_um * s.birefringence / s.wavelength_nm, most = 200;
    if (radians > most) s.birefringence = std::max(0.02, s.birefringence * most / radians);
    return s;
  }

 private:
  std::mt19937_64 random_;
};

const Director kRadial = [](TableBuilder&, Droplet&) {};
Director shell_of(double wall_um, double x_um = 0, double y_um = 0, double z_um = 0) {
  return [=](TableBuilder& b, Droplet& droplet) {
    ShellDirector shell;
    shell.wall_um = b.fixed("wall_um", wall_um);
    if (x_um != 0) shell.offset_um = {b.fixed("x", x_um), b.fixed("y", y_um), b.fixed("z", z_um)};
    droplet.director = shell;
  };
}
Director field_along(double reduced_field) {
  return [=](TableBuilder& b, Droplet& droplet) {
    AxialDirector axial;
    axial.reduced_field = b.fixed("reduced_field", reduced_field);
    droplet.director = axial;
  };
}
Director field_across(double reduced_field) {
  return [=](TableBuilder& b, Droplet& droplet) {
    AxialDirector axial;
    axial.reduced_field = b.fixed("reduced_field", reduced_field), axial.field_azimuth_deg = b.fixed("azimuth_deg", 25);
    droplet.director = axial;
  };
}
const Director kBipolar = [](TableBuilder& b, Droplet& droplet) {
  droplet.director = BipolarDirector{b.fixed("azimuth_deg", 25), b.fixed("tilt_deg", 10), {}};
};

// Each of the two pictures is within the accuracy asked of the truth, and so within twice that of each other.
void expect_means(const char* name, const Sphere& sphere, const Director& director, double accuracy,
                  double& worst_of_all) {
  const WorstPixel worst = from_finer_pixels(sphere, director, accuracy);
  worst_of_all = std::max(worst_of_all, worst.error);
  EXPECT_LT(worst.error, 2) << name << ", accuracy " << accuracy << ", column " << worst.column << ", row " << worst.row
                            << ", " << worst.from_rim_px << " pixels from the rim: " << sphere.words();
}

TEST(PixelMeans, OfRoundSamplesAreThoseOfFinerPixelsAtAnyAccuracy) {
  struct Sample {
    const char* name;
    Director director;
  };
  for (const Sample& s : {Sample{"radial", kRadial},
                          {"shell", shell_of(1.1)},
                          {"thin shell", shell_of(0.15)},
                          {"field along", field_along(6)},
                          {"bipolar", kBipolar},
                          {"field across", field_across(6)},
                          {"eccentric shell", shell_of(1.5, 0.5, -0.2, 0.1)}})
    for (const Ceiling ceiling : {Ceiling::e_only, Ceiling::one_way})
      for (double accuracy = 1e-3; accuracy > 0.9e-6; accuracy /= 10) {
        double worst = 0;
        for (const double host : {1.5, 1.52}) {
          Sphere sphere{8, 0.2};
          sphere.ceiling = ceiling, sphere.host = host;
          expect_means(s.name, sphere, s.director, accuracy, worst);
        }
        std::printf("  %-15s %-7s %.0e: worst pixel %.2f of the accuracy\n", s.name,
                    ceiling == Ceiling::e_only ? "e_only" : "one_way", accuracy, worst);
      }
}

// Anywhere among droplets, shells and fields, not only where somebody looked: fringes that crowd towards a rim, a
// retardance that turns back within a pixel, a core's edge beside the rim, pixels that are coarser than the fringes.
TEST(PixelMeans, OfRandomDropletsAreThoseOfFinerPixels) {
  Draws draw(20);
  struct Family {
    const char* name;
    int draws;
    double most_across;
    std::function<Director(const Sphere&)> director;
  };
  for (const Family& family :
       {Family{"radial", 60, 200, [](const Sphere&) { return kRadial; }},
        {"shell", 60, 200, [&](const Sphere& s) { return shell_of(s.diameter_um * draw.between(0.02, 0.4)); }},
        {"field along", 60, 120, [&](const Sphere&) { return field_along(draw.between(1, 39)); }}}) {
    double worst = 0;
    for (int k = 0; k < family.draws; ++k) {
      const Sphere sphere = draw.sphere(family.most_across);
      expect_means(family.name, sphere, family.director(sphere), std::pow(10, -draw.between(3, 6)), worst);
    }
    std::printf("  %s: %d pictures, worst pixel %.2f of the accuracy\n", family.name, family.draws, worst);
  }
}

/// The profile |E_cross|^2 / sin^2(2 azimuth) of a radial droplet by textbook formulas, cubics through 6,000 places of
/// t = sqrt(1 - rho/edge).
class TextbookProfile {
 public:
  TextbookProfile(const Sphere& sphere, bool surfaces) {
    testing::IndependentDroplet d;
    d.diameter_um = sphere.diameter_um, d.n_o = 1.52, d.n_e = 1.52 + sphere.birefringence, d.n_host = sphere.host,
    d.wavelength_um = 1e-3 * sphere.wavelength_nm;
    d.surfaces = surfaces;
    edge_um_ = d.edge_um();
    for (int i = 0; i <= kPlaces; ++i)
      values_.push_back(d.ring(edge_um_ * (1 - square(std::max(i, 1) / static_cast<double>(kPlaces)))));
    values_[0] = 4 * values_[1] - 6 * values_[2] + 4 * values_[3] - values_[4];
  }
  double edge_um() const { return edge_um_; }
  double at(double t) const {
    const double x = std::clamp(t, 0.0, 1.0) * kPlaces;
    const std::size_t i = static_cast<std::size_t>(std::clamp(std::floor(x), 1.0, kPlaces - 2.0));
    const double f = x - static_cast<double>(i), *y = &values_[i - 1];
    return y[0] * f * (f - 1) * (f - 2) / -6 + y[1] * (f + 1) * (f - 1) * (f - 2) / 2 -
           y[2] * (f + 1) * f * (f - 2) / 2 + y[3] * (f + 1) * f * (f - 1) / 6;
  }
  /// Over a pixel whose middle lies at (x, y) from the droplet's: lines of equal x by midpoints, each by Simpson's rule
  /// in t from where it comes into the disc.
  double mean(double x, double y, double pixel_um) const {
    // light is the same with x and y exchanged: lines go across the rim
    if (std::abs(x) > std::abs(y)) std::swap(x, y);
    constexpr int kLines = 400, kPieces = 128;
    double sum = 0;
    for (int i = 0; i < kLines; ++i) {
      const double at_x = x + pixel_um * ((i + 0.5) / kLines - 0.5), rim2 = edge_um_ * edge_um_ - at_x * at_x;
      if (rim2 <= 0) continue;
      const double rim = std::sqrt(rim2), low = std::abs(y) - 0.5 * pixel_um,
                   high = std::min(rim, std::abs(y) + 0.5 * pixel_um);
      if (high <= low) continue;
      const double first = std::sqrt(rim - high), last = std::sqrt(rim - low), step = (last - first) / kPieces;
      for (int k = 0; k <= kPieces; ++k) {
        const double u = first + k * step, at_y = rim - u * u, rho2 = at_x * at_x + at_y * at_y;
        const double cross = rho2 > 0 ? 4 * at_x * at_x * at_y * at_y / (rho2 * rho2) : 0;
        sum += (k == 0 || k == kPieces ? 1
                : k % 2                ? 4
                                       : 2) /
               3.0 * step * 2 * u * cross * at(std::sqrt(std::max(0.0, 1 - std::sqrt(rho2) / edge_um_))) / kLines;
      }
    }
    return sum / pixel_um;
  }

 private:
  static constexpr int kPlaces = 6000;
  static double square(double x) { return x * x; }
  double edge_um_ = 0;
  std::vector<double> values_;
};

// Shares nothing with the program: formulas, rays, quadrature. The droplet of 64 radians whose rim was once 0.085
// wrong, one in a host of lower index, and a coarse one.
TEST(PixelMeans, OfRadialDropletsAreThoseOfTheTextbook) {
  // the textbook's own: its differences for the ray tube, and lines a 400th of a pixel apart
  constexpr double kAccuracy = 1e-5;
  for (Sphere sphere : {Sphere{19.835765, 0.198253, 0.303719, 589, 0.3, -0.2, 1.52},
                        Sphere{9.3, 0.2, 0.22, 590, 0.1, 0.4, 1.43}, Sphere{12, 1, 0.2, 590, -0.3, 0.2, 1.5}})
    for (const Ceiling ceiling : {Ceiling::e_only, Ceiling::one_way}) {
      sphere.ceiling = ceiling;
      const SphereScene s = scene_of(sphere, kRadial, kAccuracy);
      const Image image = picture_of(s);
      const TextbookProfile profile(sphere, ceiling == Ceiling::one_way);
      double worst = 0;
      for (int row = 0; row < image.height(); ++row)
        for (int column = 0; column < image.width(); ++column) {
          const double half = 0.5 * sphere.size(), x = (column - half - sphere.off_x_px) * sphere.pixel_um,
                       y = (half + sphere.off_y_px - row) * sphere.pixel_um;
          const double from_rim = (profile.edge_um() - std::hypot(x, y)) / sphere.pixel_um;
          // every pixel at the rim, some of the others
          if (std::abs(from_rim) > 3 && (row + 3 * column) % 17 != 0) continue;
          worst = std::max(worst, std::abs(image(column, row) - profile.mean(x, y, sphere.pixel_um)));
        }
      EXPECT_LT(worst, kAccuracy) << sphere.words();
      std::printf("  %.3g um, host %.3g, %s: worst pixel %.1e\n", sphere.diameter_um, sphere.host,
                  ceiling == Ceiling::e_only ? "e_only" : "one_way", worst);
    }
}

// Of pixels at the rim and a core's edge as of any other: light jumps there, or ends like a root, and both move with
// the parameters. A mean has a kink where an edge passes a pixel's corner, of 3/2 of a power: differences over h are
// good to the root of h there.
TEST(PixelMeans, DerivativesAtRimsAndEdgesAreThoseOfDifferences) {
  struct Sample {
    const char* name;
    Director director;
  };
  for (const Sample& sample :
       {Sample{"radial", kRadial}, {"shell", shell_of(1.1)}, {"field along", field_along(6)}, {"bipolar", kBipolar}})
    for (const Ceiling ceiling : {Ceiling::e_only, Ceiling::one_way})
      for (const double host : {1.43, 1.52})
        for (const double analyzer : {90.0, 50.0}) {
          Sphere sphere{5, 0.2};
          sphere.ceiling = ceiling, sphere.host = host, sphere.analyzer_deg = analyzer;
          const SphereScene s = scene_of(sphere, sample.director, 1e-7);
          const Theta theta = s.b.table.values();
          const RenderPlan p = plan(s.scene, s.demand, theta);
          const Rendering exact = render(s.scene, p, theta, s.parameters, 1);
          for (std::size_t k = 0; k < s.parameters.size(); ++k) {
            // where the indices are equal the rim turns from grazing rays to total reflection
            if (host == 1.52 && (k == 2 || k == 3)) continue;
            const std::size_t j = static_cast<std::size_t>(s.parameters[k]);
            const double h = 1e-5 * theta[j];
            Theta up = theta, down = theta;
            up[j] += h, down[j] -= h;
            const Image above = render(s.scene, p, up, {}, 1).intensity,
                        below = render(s.scene, p, down, {}, 1).intensity;
            double worst = 0, size = 0;
            for (std::size_t i = 0; i < above.size(); ++i) {
              const double difference = (above.values()[i] - below.values()[i]) / (2 * h);
              size = std::max(size, std::abs(difference));
              worst = std::max(worst, std::abs(difference - exact.derivatives[k].values()[i]));
            }
            EXPECT_LT(worst, 0.01 * size) << sample.name << ", parameter " << k << ": " << sphere.words();
          }
        }
}

// The series' pictures take as few points a pixel as 96 pixels show to be enough, and say thrice the worst of those.
// With 8 x 8 points as the truth (wherever fewer were planned) every pixel is within the accuracy asked, and what is
// said is not less than half the worst pixel's error.
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
        s.microscope.wavelength_nm = b.fixed("wavelength_nm", 590);
        s.microscope.polarizer_deg = b.fixed("polarizer_deg", 0);
        s.microscope.analyzer_deg = b.fixed("analyzer_deg", 90);
        if (na > 0) s.microscope.objective_na = b.fixed("objective_na", na);
        const int size = std::min(200, 2 * static_cast<int>(0.7 * diameter / pixel) + 8);
        s.view.width = s.view.height = size;
        s.view.pixel_size_um = b.fixed("pixel_size_um", pixel);
        s.view.center_x_px = b.fixed("center_x", 0.5 * size + 0.3);
        s.view.center_y_px = b.fixed("center_y", 0.5 * size - 0.2);
        const Theta theta = b.table.values();
        const RenderPlan planned = plan(s, {.ceiling = Ceiling::wave}, theta);
        RenderPlan fine = planned;
        fine.means.samples = {8};
        const Image picture = render(s, planned, theta, {}, 1).intensity,
                    truth = render(s, fine, theta, {}, 1).intensity;
        double worst = 0;
        for (std::size_t i = 0; i < picture.size(); ++i)
          worst = std::max(worst, std::abs(picture.values()[i] - truth.values()[i]));
        EXPECT_LE(worst, planned.demand.intensity_accuracy)
            << diameter << " um, NA " << na << ", pixels of " << pixel << " um";
        EXPECT_LE(worst, 2 * planned.numerical_error)
            << diameter << " um, NA " << na << ", pixels of " << pixel << " um";
      }
}

// Degree 11 on panels of 1/6 of a smooth function of 5 radians: (5/12)^12 / (2^11 12!) = 3e-17; powers lose (1 + sqrt
// 2)^11 = 16,000 units of rounding, derivatives (11^2 x 2 x 6 panels / 2) more at a panel's end.
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
    const Pack v = Pack::load_aligned(places), basis[3]{Pack(1.0), Pack(1.0), Pack(1.0)},
               turned[3]{Pack(0.0), Pack(-2.0), Pack(0.0)};
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
    const D edge = rim_edge<D>(rim, n_host / n_o, n_host, D(c.na));
    EXPECT_NEAR(edge.value, rim.rho_max(), 1e-7);  // total reflection: the root of the bisection's 1e-16
    const double h = 1e-3;
    EXPECT_NEAR(edge.d[0], (rho_max(c.n_o + h, c.n_host) - rho_max(c.n_o - h, c.n_host)) / (2 * h), 1e-3) << c.na;
    EXPECT_NEAR(edge.d[1], (rho_max(c.n_o, c.n_host + h) - rho_max(c.n_o, c.n_host - h)) / (2 * h), 1e-3) << c.na;
  }
}

}  // namespace
}  // namespace birefit
