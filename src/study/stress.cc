// One-parameter sweeps into the places where methods fail.

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "birefit/render.h"
#include "birefit/study.h"
#include "study/answer.h"
#include "study/rays.h"
#include "study/spectra.h"
#include "study/stress_waves.h"
#include "transport/methods.h"
#include "transport/methods/wei_norman.h"

namespace birefit {
namespace {

using namespace study;
constexpr double kDeg = std::numbers::pi / 180;

struct Trap {
  std::string sweep;
  double value;
  std::unique_ptr<Column<double>> column;
  Ray<double> ray;
  double host_index = 0;  ///< > 0: the faces belong to the trap

  Question question() const { return {*column, ray, host_index}; }
  /// Reflections need a host; any, where the trap names none.
  Question with_faces() const { return {*column, ray, host_index > 0 ? host_index : 1.5}; }
};

template <class Law>
std::unique_ptr<Column<double>> column_of_law(Law law, bool planar = false, bool absorbing = false) {
  auto column = std::make_unique<LawColumn<double, Law>>(law);
  column->planar = planar;
  column->absorbing = absorbing;
  return column;
}

/// Tilt and azimuth linear in depth, indices constant, absorption by k on both.
struct TiltTwist {
  double tilt0, tilt1, azimuth0, azimuth1, n_o, n_e, k, thickness_um;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const T tilt = tilt0 + (tilt1 - tilt0) * u, azimuth = azimuth0 + (azimuth1 - azimuth0) * u;
    return {axis_from_angles<T>(tilt, azimuth),
            T(n_o * n_o - k * k),
            T(n_e * n_e - k * k),
            T(2 * n_o * k),
            T(2 * n_e * k),
            T(thickness_um)};
  }
};
/// In the layer plane, turning by pi about the middle within `width` of 5 um.
struct FastTurn {
  double width_um;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const T x = (u - 0.5) * (5 / width_um * 2), e = exp(x), f = inverse(e + inverse(e));
    const T tanh_x = (e - inverse(e)) * f;
    return {axis_from_angles<T>(T(0.0), 0.3 + (0.5 * std::numbers::pi) * tanh_x),
            T(1.52 * 1.52),
            T(1.74 * 1.74),
            T(0.0),
            T(0.0),
            T(5.0)};
  }
};
/// Uniform twist whose extraordinary index passes an extremum of the retardation rate: c2 = -k0 p/(4 d) at the entry.
struct StationaryRate {
  double p;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const T n = 1.70 + p * u + 0.02 * (u * u * u);
    return {axis_from_angles<T>(T(0.0), 0.3 + 0.4 * u), T(1.52 * 1.52), n * n, T(0.0), T(0.0), T(10.0)};
  }
};

/// Twisting and tilting slowly, with a sub-layer [from, to) of other indices and an axis of its own, 50 degrees away.
struct SubLayer {
  double from, to;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const double place = lane(plain(u), 0);
    const bool inside = place >= from && place < to;
    const T tilt = (inside ? 0.6 : 0.2) + 0.3 * u, azimuth = (inside ? 1.2 : 0.3) + 0.8 * u;
    const double n_o = inside ? 1.60 : 1.52, n_e = inside ? 1.68 : 1.74;
    return {axis_from_angles<T>(tilt, azimuth), T(n_o * n_o), T(n_e * n_e), T(0.0), T(0.0), T(5.0)};
  }
};
/// Continuous, with a kink of tilt and azimuth.
struct Kink {
  double place;
  template <class T>
  OpticalPoint<T> at(const T& u) const {
    const double side = lane(plain(u), 0) < place ? 1.0 : -0.5;
    const T x = u - place;
    return {axis_from_angles<T>(0.4 + side * x, 0.3 + (1.5 * side) * x),
            T(1.52 * 1.52),
            T(1.74 * 1.74),
            T(0.0),
            T(0.0),
            T(5.0)};
  }
};

std::vector<Trap> traps(bool quick) {
  std::vector<Trap> all;
  const double k0 = 2 * std::numbers::pi / 0.59;
  const auto add = [&](const std::string& sweep, double value, std::unique_ptr<Column<double>> column, double kx = 0,
                       double ky = 0) {
    all.push_back({sweep, value, std::move(column), {k0, kx, ky, Continuity::e_only}});
  };
  /// The same with E and H continuous and a host on both sides.
  const auto add_with_faces = [&](const std::string& sweep, double value, std::unique_ptr<Column<double>> column,
                                  double host, double kx) {
    all.push_back({sweep, value, std::move(column), {k0, kx, 0.1, Continuity::e_and_h}, host});
  };
  const double radius = 4.5;
  const auto chord = [&](double impact) {
    const Chord<double> c{impact, std::sqrt(std::max(radius * radius - impact * impact, 1e-12)), radius};
    auto column = column_of_law(TwistedRadialLaw<double>{c, 0.0, 1.0, 60 * kDeg, 1.52 * 1.52, 1.74 * 1.74});
    column->breaks = {0.5};  // the chord map's kink
    return column;
  };
  for (double b : {1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-6, 0.0}) add("impact_um", b, chord(b));
  for (double gap : {1.0, 0.1, 1e-2, 1e-4, 1e-6, 1e-9}) add("rim_gap", gap, chord(radius * (1 - gap)));
  for (double offset : {0.3, 0.03, 3e-3, 1e-4, 1e-6, 0.0})
    add("axis_passes_ray", offset, column_of_law(TiltTwist{0.6, 2.1, offset, offset, 1.522, 1.739, 0, 5}), 0.3);
  for (double dn : {0.2, 1e-2, 1e-4, 1e-8, 0.0, -1e-4, -1e-2, -0.2})
    add("birefringence", dn, column_of_law(TiltTwist{0.2, 0.5, 0.3, 1.4, 1.6, 1.6 + dn, 0, 5}), 0.3);
  for (double d : {1.0, 10.0, 100.0, 1e3, 1e4})
    add("thickness_um", d, column_of_law(TiltTwist{0.2, 0.5, 0.3, 1.4, 1.52, 1.74, 0, d}), 0.3);
  for (double pitch : {100.0, 10.0, 3.0, 1.0, 0.5, 0.36, 0.2})
    add("pitch_um", pitch,
        column_of_law(TiltTwist{0, 0, 0.3, 0.3 + 2 * std::numbers::pi * 10 / pitch, 1.52, 1.74, 0, 10}));
  for (double k : {1e-4, 1e-3, 1e-2, 0.1, 0.5})
    add("absorption_k", k, column_of_law(TiltTwist{0.2, 0.5, 0.3, 1.4, 1.52, 1.74, k, 20}, false, true), 0.3);
  for (double gap : {0.3, 0.1, 1e-2, 1e-3, 1e-5, 1e-8})
    add("gap_to_total_reflection", gap, column_of_law(TiltTwist{0.2, 0.5, 0.3, 1.4, 1.52, 1.74, 0, 5}), 1.52 - gap);
  for (double width : {2.0, 0.5, 0.1, 0.03}) add("turn_width_um", width, column_of_law(FastTurn{width}));
  for (double p : {0.1, 1e-3, 1e-6, 1e-12, 0.0, -1e-12, -1e-6, -1e-3, -0.1})
    add("c2_parameter", p, column_of_law(StationaryRate{p}));
  // A turn by 135 degrees in 5 um: g1 of the Wei-Norman factors grows as 1/birefringence on the way.
  for (double dn : {0.1, 1e-2, 1e-3, 1e-4, 1e-6, -1e-3})
    add("pole_birefringence", dn, column_of_law(TiltTwist{0, 0, 0, 135 * kDeg, 1.5, 1.5 + dn, 0, 5}));
  // 50 degrees in the host (and ky = 0.1): beyond 1.97994 the ordinary wave of the sample is totally reflected, then
  // both.
  for (double host : {1.0, 1.2, 1.52, 1.74, 1.9, 1.97, 1.979, 1.9799, 2.0, 2.5})
    add_with_faces("host_index", host, column_of_law(TiltTwist{0.2, 0.5, 0.3, 1.4, 1.52, 1.74, 0, 5}), host,
                   host * std::sin(50 * kDeg));
  // Breaks on, beside and all but on the nodes of every mesh of 2^n steps.
  const auto broken = [&](auto law, std::vector<double> breaks, bool jumps) {
    auto column = column_of_law(law);
    column->breaks = std::move(breaks);
    column->jumps = jumps;
    return column;
  };
  for (double beside : {1.0 / 6, 1e-2, 1e-5, 1e-9, 1e-13, 0.0, -1e-13, -1e-5}) {
    const double place = 0.5 + beside;
    add_with_faces("step_beside_node", beside, broken(SubLayer{place, 2}, {place}, true), 1.5, 0.3);
    add_with_faces("kink_beside_node", beside, broken(Kink{place}, {place}, false), 1.5, 0.3);
  }
  for (double width : {0.3, 1e-2, 1e-4, 1e-7, 1e-11, 1e-12, 1e-14}) {
    const double from = 0.45, to = from + width;
    add_with_faces("sub_layer_width", width, broken(SubLayer{from, to}, {from, to}, true), 1.5, 0.3);
  }
  std::stable_sort(all.begin(), all.end(), [](const Trap& a, const Trap& b) { return a.sweep < b.sweep; });
  if (quick) {  // the ends and the middle of each sweep
    std::vector<Trap> some;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const bool first = i == 0 || all[i - 1].sweep != all[i].sweep,
                 last = i + 1 == all.size() || all[i + 1].sweep != all[i].sweep;
      if (first || last || i % 3 == 0) some.push_back(std::move(all[i]));
    }
    return some;
  }
  return all;
}

// ---- whole pictures ------------------------------------------------------------------------------------------------

/// Polarizers exactly and nearly along what the sample's modes are, crossed and parallel: dark or bright everywhere.
struct PictureTrap {
  std::string sample;
  ParameterTable table;
  Scene scene;
};
PictureTrap picture_trap(const std::string& sample, double polarizer_deg, double analyzer_deg) {
  PictureTrap trap{sample, {}, {}};
  const auto fixed = [&](const std::string& name, double value) { return trap.table.add_constant(name, value); };
  Scene& s = trap.scene;
  s.view.width = s.view.height = 12;
  s.view.center_x_px = fixed("center_x", 6);  // a pixel's centre
  s.view.center_y_px = fixed("center_y", 6);
  s.microscope.wavelength_nm = fixed("wavelength_nm", 590);
  s.microscope.polarizer_deg = fixed("polarizer_deg", polarizer_deg);
  s.microscope.analyzer_deg = fixed("analyzer_deg", analyzer_deg);
  s.material = ConstantIndices{fixed("ordinary", 1.52), fixed("birefringence", 0.22)};
  if (sample == "droplet" || sample == "twisted_droplet") {
    Droplet droplet;
    droplet.diameter_um = fixed("diameter_um", 9);
    if (sample == "twisted_droplet") droplet.director = RadialDirector{fixed("twist_deg", 60)};
    s.sample = droplet;
    s.view.pixel_size_um = fixed("pixel_size_um", 0.8);
    s.surround_index = fixed("surround", 1.43);
  } else if (sample == "cell") {
    Cell cell;
    cell.thickness_um = fixed("thickness_um", 5);
    TwistedDirector director;
    director.twist_deg = fixed("twist_deg", 90);
    director.azimuth_deg = fixed("azimuth_deg", 0);
    director.pretilt_deg = fixed("pretilt_deg", 0);
    cell.director = director;
    s.sample = cell;
    s.surround_index = fixed("surround", 1.5);
  } else {
    Plate plate;
    plate.thickness_um = fixed("thickness_um", 50);
    plate.director.axis = {fixed("x", 1), fixed("y", 0), fixed("z", 0)};
    plate.half_angle_deg = fixed("half_angle_deg", 10);
    s.sample = plate;
    s.surround_index = fixed("surround", 1.0);
  }
  return trap;
}

/// A plan by each method against one for 1e-8: it stands by the accuracy asked, or warns that it cannot hold it.
void measure_pictures(bool quick, std::vector<StressPoint>& points) {
  constexpr double kAsked = 1e-4, kTruth = 1e-8;
  for (const bool crossed : {true, false})
    for (const double polarizer_deg :
         quick ? std::vector<double>{0, 1e-6, 45} : std::vector<double>{0, 1e-9, 1e-6, 1e-3, 1, 45, 90})
      for (const char* sample : {"droplet", "twisted_droplet", "cell", "plate"}) {
        PictureTrap trap = picture_trap(sample, polarizer_deg, polarizer_deg + (crossed ? 90 : 0));
        const Theta theta = trap.table.values();
        const bool planned_only = trap.sample == "plate";  // planning by name for every direction takes too long
        for (const bool reflections : {false, true}) {
          if (reflections && trap.sample != "cell") continue;
          Demand demand{.ceiling = reflections ? Ceiling::reflections : Ceiling::one_way, .intensity_accuracy = kTruth};
          const Image truth = render(trap.scene, plan(trap.scene, demand, theta), theta, {}, 1).intensity;
          demand.intensity_accuracy = kAsked;
          std::vector<std::string> methods{"auto"};
          if (!reflections && !planned_only)
            for (const TransportMethod<double>* method : transport_methods<double>())
              if (!method->info().reflections && !(method->info().needs_planar && trap.sample == "twisted_droplet") &&
                  !(method->info().slow_axes && trap.sample != "cell"))
                methods.emplace_back(method->info().name);
          for (const std::string& method : methods) {
            demand.method = method;
            const RenderPlan chosen = plan(trap.scene, demand, theta);
            StressPoint p{crossed ? "crossed_polarizer_deg" : "parallel_polarizer_deg",
                          polarizer_deg,
                          fmt::format("{} of a {}{}", method, sample, reflections ? ", reflections" : ""),
                          0,
                          kAsked,
                          0,
                          ""};
            if (chosen.numerical_error > kAsked) {
              p.flag = fmt::format("its plan expects {:.1e}", chosen.numerical_error);
              p.error = std::numeric_limits<double>::quiet_NaN();
              p.estimate = std::numeric_limits<double>::infinity();
            } else {
              const Image image = render(trap.scene, chosen, theta, {}, 1).intensity;
              for (std::size_t i = 0; i < truth.size(); ++i) {
                const double x = image.values()[i], error = std::abs(x - truth.values()[i]);
                // No light is less than none, whatever accuracy was asked.
                p.error =
                    x >= -1e-12 && error <= 1e9 ? std::max(p.error, error) : std::numeric_limits<double>::infinity();
              }
            }
            points.push_back(p);
          }
        }
      }
}

}  // namespace

std::vector<StressPoint> measure_stress(bool quick, const std::function<void(const std::string&)>& say) {
  constexpr double kTolerance = 1e-6;
  std::vector<StressPoint> points;
  std::string telling;
  for (const Trap& trap : traps(quick)) {
    if (say && trap.sweep != telling) say(telling = trap.sweep);
    const Question question = trap.question();
    // The truth: order 6, far beyond what the methods are allowed, checked by order 4.
    const Answer truth = by_halving(Magnus6<double>(), question, 1e-11, 1 << 17);
    const Answer check = by_halving(Magnus4<double>(), question, 1e-9, 1 << 17);
    const bool known =
        truth.flag.empty() && check.flag.empty() && relative_distance(check.transfer, truth.transfer) < 1e-8;
    const auto record_against = [&](const Mat2<double>& exact, bool exact_is_known, const std::string& method,
                                    const Answer& answer) {
      StressPoint p{trap.sweep,      trap.value,     method,     std::numeric_limits<double>::quiet_NaN(),
                    answer.estimate, answer.samples, answer.flag};
      if (exact_is_known && answer.flag.empty()) p.error = relative_distance(answer.transfer, exact);
      points.push_back(p);
    };
    const auto record = [&](const std::string& method, const Answer& answer) {
      record_against(truth.transfer, known, method, answer);
    };
    for (const TransportMethod<double>* method : transport_methods<double>())
      if (const std::string name = method->info().name;
          !method->info().reflections && name != "diagonal" && name != "modal")
        record(method->info().name, by_halving(*method, question, kTolerance));
    record("diagonal", diagonal_answer(question, kTolerance));
    record("modal", modal_answer(question, kTolerance));
    for (const int order : {kWeiNormanPaper.order, 3}) {
      const std::string ending = order == kWeiNormanPaper.order ? "" : fmt::format(" order {}", order);
      if (ending.empty()) record("wei_norman", wei_norman_answer(false, order, question, 1e-3));
      record("wei_norman_exp" + ending, wei_norman_answer(true, order, question, 1e-3));
    }
    record("ode_scalar", ode_answer(true, question, kTolerance));
    const bool thick = trap.sweep == "thickness_um" && trap.value > 500;
    if (thick) continue;  // their steps follow every wave
    record("ode_operator", ode_answer(false, question, kTolerance));
    // Other physics: all reflections have their own truth, itself with more steps.
    const Berreman<double> berreman;
    const Answer reflections = by_halving(berreman, trap.with_faces(), kTolerance, 1024);
    const Answer finer =
        reflections.flag.empty() ? by_halving(berreman, trap.with_faces(), 1e-3 * kTolerance, 8192) : reflections;
    record_against(finer.transfer, finer.flag.empty(), "berreman", reflections);
  }
  if (say) say("polarizers along the modes");
  measure_pictures(quick, points);
  if (say) say("light that is no line");
  measure_light_traps(quick, points);
  measure_wave_traps(quick, say, points);
  return points;
}

}  // namespace birefit
