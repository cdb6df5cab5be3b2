#include "samples/waves/wave.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "birefit/memo.h"
#include "instrument/exposure.h"
#include "medium/references.h"
#include "samples/kind.h"
#include "samples/waves/object.h"
#include "samples/waves/objective.h"
#include "wave/march.h"

namespace birefit {
namespace {

template <class S>
std::unique_ptr<WaveMedium<S>> wave_medium(const Scene& scene, const Values<S>& value, double ramp_um) {
  return std::get<MakeWaveMedium<S>>(kind_of(scene).waves->medium)(scene, value, ramp_um);
}

WaveObject wave_object(const Scene& scene, const Values<double>& value) {
  if (!scene.surround_index && !scene.surround_dispersion)
    throw UserError(Where{}, "ceiling: wave needs sample.surround",
                    "the index of what is around the sample, and in a sampled box where there is no liquid crystal");
  check_objective(scene, value, host_index(scene, value));
  const SampleWaves* const waves = kind_of(scene).waves;
  if (!waves)
    throw UserError(Where{}, "ceiling: wave is for droplets, shells and sampled fields",
                    "use one_way or, for cells and slabs, reflections");
  return waves->object(scene, value);
}

WaveImaging imaging_of(const Scene& scene, const Values<double>& value, const WaveGrid& grid) {
  const double cx = value(scene.view.center_x_px), cy = value(scene.view.center_y_px),
               px = value(scene.view.pixel_size_um);
  const auto reach = [&](double centre, int pixels) {
    return px * (std::max(std::abs(centre), std::abs(pixels - 1 - centre)) + 1);
  };
  return plan_imaging(grid, wavenumber_per_um(scene, value), value(scene.microscope.objective_na),
                      reach(cx, scene.view.width), reach(cy, scene.view.height));
}

}  // namespace

std::optional<RadialTwin> radial_twin(const Scene& scene, const Theta& theta, double scale) {
  const SampleWaves* const waves = kind_of(scene).waves;
  return waves ? waves->radial_twin(scene, theta, scale) : std::nullopt;
}

double picture_error(const Image& image, const Image& exact) {
  double difference = 0, size = 1e-24 * static_cast<double>(exact.values().size());
  for (std::size_t i = 0; i < exact.values().size(); ++i) {
    difference += square(image.values()[i] - exact.values()[i]);
    size += square(exact.values()[i]);
  }
  return std::sqrt(difference / size);
}

namespace {

/// picture_error of a model of the twin's last scene, in a view of its own; `scale`: what the twin was made with.
template <class Model>
double error_on_twin(RadialTwin twin, const BeamMaker& light, double scale, const RenderPicture& picture,
                     const Model& model) {
  const Theta before = twin.theta;
  const Values<double> value(before, {});  // of spheres without a field: nothing to remember
  for (Scene& scene : twin.scenes) {
    if (ParameterRef& focus = scene.microscope.focus_um) focus = twin.constant(scale * value(focus));
    // Pixels as large as the scene's, where 64 of them suffice: what is left out need not have the sign of what is
    // seen, and large pixels average.
    View& view = scene.view;
    const double side_um = twin.diameter_um + 4;
    const int pixels = std::clamp(static_cast<int>(side_um / (scale * value(view.pixel_size_um))), 2, 64);
    view.width = view.height = pixels;
    view.pixel_size_um = twin.constant(side_um / pixels);
    view.center_x_px = view.center_y_px = twin.constant(0.5 * (pixels - 1));
  }
  const Scene& exact = twin.scenes.front();
  Demand demand = RadialTwin::demand(0, {});
  demand.intensity_accuracy = 1e-8;  // nearly dark pictures, too
  return picture_error(
      model(twin.scenes.back(), twin.theta),
      picture(exact, kind_of(exact).waves->plan_series(exact, demand, Values<double>(twin.theta, {}), light),
              twin.theta));
}

std::shared_ptr<const WavePlan> plan_grids(const Scene& scene, const Values<double>& value, const WaveObject& object) {
  auto wave = std::make_shared<WavePlan>();
  wave->radius_um = object.radius_um;
  wave->objective_na = value(scene.microscope.objective_na);
  const WaveGrid& g = wave->grid = object.grid;
  wave->ramp_um = g.step_um;
  if (static_cast<double>(g.nx) * g.ny > 4e6)
    throw UserError(
        Where{},
        fmt::format(
            "wave optics of a {} would need {} x {} points in {} slabs, about {:.1f} GB and {:.0f} min an image",
            object.what, g.nx, g.ny, g.slabs, 4e-7 * g.nx * g.ny, 3e-6 / 60 * g.nx * g.ny * g.slabs),
        "use ceiling: one_way, which becomes better with size only for weak birefringence, or check its size");
  wave->imaging = imaging_of(scene, value, g);
  return wave;
}

/// picture_error of propagation on a radial twin of that scale.
double propagation_error_on(const RadialTwin& twin, const BeamMaker& light, double scale,
                            const RenderPicture& picture) {
  return error_on_twin(twin, light, scale, picture, [&](const Scene& scene, const Theta& theta) {
    const Values<double> values(theta, {});
    RenderPlan plan;
    plan.wave = plan_grids(scene, values, wave_object(scene, values));
    Rendering rendering;
    render_wave(scene, plan, light, theta, {}, 1, rendering);
    return rendering.intensity;
  });
}

}  // namespace

RenderPlan plan_wave(const Planning& planning) {
  const Scene& scene = planning.scene;
  const Values<double>& value = planning.value;
  const WaveObject o = wave_object(scene, value);
  const double na = value(scene.microscope.objective_na);
  RenderPlan plan = planning.start();
  plan.wave = plan_grids(scene, value, o);
  const WaveGrid& g = plan.wave->grid;
  plan.method = "split_step";
  plan.physics = "wave";
  plan.steps = g.slabs;
  plan.reasons.push_back(fmt::format(
      "a {}, {:.3g} wavelengths, {}", o.what, 2 * o.radius_um * o.n_host / wavelength_um(scene, value),
      plan.demand.method == "split_step" ? "propagation asked for by name" : "whose director has no exact series"));
  plan.reasons.push_back(fmt::format(
      "one-way wave optics on {} x {} points {:.3g} um apart, {} slabs of {:.3g} um, {} layers of the medium each",
      g.nx, g.ny, g.step_um, g.slabs, (g.exit_um - g.entry_um) / g.slabs, g.layers));
  const int sent = planning.light.in(value).line.in().count;  // fields, one after the other
  plan.cost_seconds = sent * static_cast<double>(g.nx) * g.ny * g.slabs * 1.4e-7;
  // Above all that was measured on bright pictures of radial balls and shells (birefit chart,
  // tests/cross/split_step_test.cc): it grows with the contrast, with the square of the aperture, and where light must
  // leave a wall into a thinner medium. 0.01 is the grid's; half its step and slabs take no more away.
  const double contrast = std::abs(o.n_e - o.n_o) + 2 * std::abs((2 * o.n_o + o.n_e) / 3 - o.n_host);
  const double step_out = o.has_core ? std::max(0.0, std::max(o.n_o, o.n_e) - std::min(o.n_host, o.core_index)) : 0;
  plan.numerical_error = 0.01;
  plan.model_error = (0.018 + 0.068 * na * na) * std::clamp(contrast / 0.4, 0.15, 1.6) + 0.15 * na * step_out;
  plan.reasons.push_back("what is left out are reflections and the third order in the wave's slope");
  // Where the scene's takes longer than half a second, a smaller one.
  const double scale = std::min(1.0, std::cbrt(0.5 / plan.cost_seconds));
  const std::optional<RadialTwin> twin = radial_twin(scene, value.theta(), scale);
  if (!twin) {
    plan.warnings.push_back(
        fmt::format("That wave propagation errs by {:.2g} of the picture's RMS was measured on spheres with bright "
                    "pictures. Of a sampled field without host around it, or with a ball's worth of "
                    "liquid crystal that its box would not hold as a ball, it is not, nor is the field's own sampling "
                    "in it: a surface between nodes is known to half their spacing.",
                    plan.numerical_error + plan.model_error));
    return plan;
  }
  // A picture may be nearly dark, and what is left out is not: then the twin knows.
  const double on_twin = propagation_error_on(*twin, planning.light, scale, planning.picture);
  const double more = std::max(1.0, 1.5 * on_twin / (plan.numerical_error + plan.model_error));
  plan.numerical_error *= more;
  plan.model_error *= more;
  plan.reasons.back() +=
      fmt::format("; the picture of a radial twin, which is exact by its series, is met to {:.2g} of its RMS", on_twin);
  if (const double error = plan.numerical_error + plan.model_error; error > 0.15)
    plan.warnings.push_back(
        fmt::format("Wave propagation is expected to err by {:.2g} of this picture's RMS: light that it leaves out "
                    "(reflected, or steep at large steps of the index) is as bright as much of "
                    "what is left between these polarizers in this aperture.",
                    error));
  return plan;
}

namespace {

template <class S>
WaveLight<S> wave_light(const Scene& scene, const Values<S>& value, const BeamMaker& light, const Field<S>& field) {
  WaveLight<S> sent{wavenumber_per_um(scene, value), host_index(scene, value), field.x, field.y};
  // Held while the wavelength changes (condenser_slope).
  const double k0 = lane(plain(sent.k0_per_um), 0);
  sent.kx_per_um = k0 * light.kappa()[0], sent.ky_per_um = k0 * light.kappa()[1];
  // An aplanatic condenser keeps the flux, as the objective does.
  if (scene.microscope.aplanatic) flux_to_field(sent);
  return sent;
}

/// What is left of the light behind the sample, one field for each of those that come in.
using SentFields = std::vector<std::vector<WaveField>>;

/// The light of one field that comes in and one that is let through, in images of their own; they add up.
template <class S>
void picture(const Scene& scene, const BeamMaker& light, const Line<S>& line, const WaveGrid& grid,
             const WaveImaging& imaging, const Values<S>& value, const SentFields& fields, int threads,
             const std::vector<Image*>& images) {
  WaveMicroscope<S> m;
  m.objective_na = value(scene.microscope.objective_na);
  m.aplanatic = scene.microscope.aplanatic;
  m.focus_um = value.get(scene.microscope.focus_um, 0.0);
  m.center_x_px = value(scene.view.center_x_px), m.center_y_px = value(scene.view.center_y_px);
  m.pixel_um = value(scene.view.pixel_size_um);
  m.width = scene.view.width, m.height = scene.view.height;
  std::vector<Image> part(images.size());
  std::vector<Image*> parts;
  for (Image& image : part) parts.push_back(&image);
  const bool whole = line.pairs() == 1;
  bool first = true;
  for (std::size_t i = 0; i < fields.size(); ++i)
    for (std::size_t o = 0; o < static_cast<std::size_t>(line.out().count); ++o) {
      m.ax = line.out().field[o].x, m.ay = line.out().field[o].y;
      form_image(grid, imaging, wave_light(scene, value, light, line.in().field[i]), m, fields[i], threads,
                 whole ? images : parts);
      if (whole) continue;
      const S weight = line.in().weight[i] * line.out().weight[o];
      for (std::size_t p = 0; p < images.size(); ++p) {
        Image& sum = *images[p];
        if (first) sum = Image(part[p].width(), part[p].height());
        double by = 0;
        if constexpr (ScalarTraits<S>::derivatives > 0)
          if (p > 0) by = lane(weight.d[p - 1], 0);
        const double share = lane(plain(weight), 0);
        for (std::size_t k = 0; k < sum.size(); ++k)
          sum.values()[k] += share * part[p].values()[k] + by * part[0].values()[k];
      }
      first = false;
    }
}

/// Parameters that only the picture depends on: no light need be sent through the sample again.
std::vector<bool> move_only_pictures(const Scene& scene, const std::vector<int>& active) {
  Scene without = scene;
  const ParameterRef none;
  without.view.center_x_px = without.view.center_y_px = without.view.pixel_size_um = none;
  Microscope& m = without.microscope;
  m.focus_um = m.objective_na = m.analyzer_deg = m.polarizer_extinction_ratio = m.analyzer_extinction_ratio = none;
  m.behind.clear();
  std::vector<bool> only(active.size(), true);
  for_each_ref(without, [&](const ParameterRef& ref) {
    for (std::size_t j = 0; j < active.size(); ++j)
      if (ref && ref.index == active[j]) only[j] = false;
  });
  return only;
}

/// A marched field behind the object in the terms of WaveField.
WaveField flux_field(MarchedField marched, const WaveGrid& g, double k0, double n_host) {
  WaveField field;
  field.a[0] = std::move(marched.ex), field.a[1] = std::move(marched.ey);
  const Fft2 fft(g.nx, g.ny);
  for (Plane& plane : field.a) fft.forward(plane);
  const std::complex<double> back = std::polar(1.0 / static_cast<double>(fft.size()), -k0 * n_host * g.exit_um);
  for (std::size_t i = 0; i < fft.size(); ++i) {
    const auto wavevector = [&](int m, int n) {
      return 2 * std::numbers::pi / (n * g.step_um * k0) * (m < n - m ? m : m - n);
    };
    const double x = wavevector(static_cast<int>(i) % g.nx, g.nx), y = wavevector(static_cast<int>(i) / g.nx, g.ny),
                 k2 = x * x + y * y;
    auto &ex = field.a[0][i], &ey = field.a[1][i];
    const double q2 = n_host * n_host - k2;
    if (q2 <= 1e-3) {
      ex = ey = 0;
      continue;
    }
    const double length = std::sqrt(k2), px = length > 0 ? x / length : 1, py = length > 0 ? y / length : 0,
                 s_scale = std::sqrt(std::sqrt(q2) / n_host);
    const std::complex<double> p = back * (px * ex + py * ey) / s_scale, s = back * (px * ey - py * ex) * s_scale;
    ex = px * p - py * s;
    ey = py * p + px * s;
  }
  for (Plane& plane : field.a) fft.inverse(plane);
  return field;
}

}  // namespace

void render_wave(const Scene& scene, const RenderPlan& chosen, const BeamMaker& light, const Theta& theta,
                 const std::vector<int>& active, int threads, Rendering& into) {
  const WavePlan& plan = *chosen.wave;
  Memo* const memo = chosen.demand.memo.get();
  // What moves only the picture needs no light sent through the sample again.
  struct Part {
    std::vector<int> parameters;
    std::vector<Image*> images;
  } of_light, of_picture;
  const std::vector<bool> only_picture = move_only_pictures(scene, active);
  into.derivatives.resize(active.size());
  for (std::size_t j = 0; j < active.size(); ++j) {
    Part& part = only_picture[j] ? of_picture : of_light;
    part.parameters.push_back(active[j]);
    part.images.push_back(&into.derivatives[j]);
  }
  // Calls body<S>(parameters, images) for up to four of a part at a time.
  const auto in_chunks = [&](const Part& part, const auto& body) {
    for (std::size_t first = 0, take; first < part.parameters.size(); first += take) {
      take = std::min<std::size_t>(part.parameters.size() - first, 4);
      const auto from = static_cast<long>(first), to = static_cast<long>(first + take);
      const std::vector<int> chunk(part.parameters.begin() + from, part.parameters.begin() + to);
      std::vector<Image*> images{&into.intensity};
      images.insert(images.end(), part.images.begin() + from, part.images.begin() + to);
      if (take > 2)
        body.template operator()<Dual4>(chunk, images);
      else if (take == 2)
        body.template operator()<Dual2>(chunk, images);
      else
        body.template operator()<Dual1>(chunk, images);
    }
  };
  SentFields base;  // without derivatives
  const auto send = [&]<class S>(const std::vector<int>& chunk, const std::vector<Image*>& images) {
    const Values<S> value(theta, chunk, memo);
    const Line<S> line = light.in(value).line;
    const auto medium = wave_medium(scene, value, plan.ramp_um);
    SentFields fields;
    for (std::size_t i = 0; i < static_cast<std::size_t>(line.in().count); ++i)
      fields.push_back(propagate(plan.grid, wave_light(scene, value, light, line.in().field[i]), *medium, threads));
    picture(scene, light, line, plan.grid, plan.imaging, value, fields, threads, images);
    for (auto& of_one : fields) of_one.resize(1);
    base = std::move(fields);
  };
  if (of_light.parameters.empty())
    send.template operator()<Pack>({}, {&into.intensity});
  else
    in_chunks(of_light, send);
  in_chunks(of_picture, [&]<class S>(const std::vector<int>& chunk, const std::vector<Image*>& images) {
    const Values<S> value(theta, chunk, memo);
    picture(scene, light, light.in(value).line, plan.grid, plan.imaging, value, base, threads, images);
  });
}

Image marched_picture(const Scene& scene, const BeamMaker& light, const Theta& theta, int threads) {
  Memo memo;
  const Values<double> value(theta, {}, &memo);
  const Values<Pack> lanes = value.as<Pack>();
  const WaveObject o = wave_object(scene, value);
  const double k0 = wavenumber_per_um(scene, value);
  // As wide as propagation asks, points and slabs where halving them changes less than what reflections leave
  // (tests/cross/march_test.cc).
  WaveGrid g = o.grid;
  const double box_x = g.nx * g.step_um, box_y = g.ny * g.step_um, wavelength = 2 * std::numbers::pi / k0,
               depth = g.exit_um - g.entry_um;
  g.nx = fast_fft_size(static_cast<int>(std::ceil(box_x / (0.28 * wavelength))));
  g.step_um = box_x / g.nx;
  g.ny = fast_fft_size(static_cast<int>(std::ceil(box_y / g.step_um - 1e-9)));
  MarchGrid grid{g.nx,
                 g.ny,
                 box_x,
                 g.ny * g.step_um,
                 g.entry_um,
                 g.exit_um,
                 static_cast<int>(std::ceil(depth / (0.35 * wavelength)))};
  grid.limit = std::min(0.95, 0.98 * std::min({o.n_o, o.n_e, o.core_index}) / o.n_host);
  if (static_cast<double>(g.nx) * g.ny * grid.slabs > 5e7)
    throw UserError(
        Where{},
        fmt::format("marching Maxwell's equations through {} x {} points and {} slabs would take an hour or more", g.nx,
                    g.ny, grid.slabs),
        "leave --check out");
  const std::unique_ptr<WaveMedium<double>> medium = wave_medium(scene, value, g.step_um);
  const DielectricAt dielectric = [&](double x, double y, double z) -> std::array<double, 6> {
    const double host = o.n_host * o.n_host;
    if (!medium->reaches(x, y, z)) return {host, host, host, 0, 0, 0};
    const OpticalPoint<double> p = medium->at(x, y, z);
    const double eo = p.ordinary, de = p.extraordinary - eo;
    const Vec3<double>& n = p.axis;
    return {eo + de * n.x * n.x, eo + de * n.y * n.y, eo + de * n.z * n.z,
            de * n.x * n.y,      de * n.x * n.z,      de * n.y * n.z};
  };
  const Line<double> line = light.in(value).line;
  std::vector<MarchWave> waves(static_cast<std::size_t>(line.in().count));
  for (std::size_t i = 0; i < waves.size(); ++i) {
    const Field<double>& f = line.in().field[i];
    waves[i].e = {std::complex<double>(f.x.re, f.x.im), std::complex<double>(f.y.re, f.y.im)};
  }
  std::vector<MarchedField> marched = march(grid, k0, o.n_host, dielectric, waves, threads);
  SentFields fields(waves.size());
  for (std::size_t i = 0; i < waves.size(); ++i)
    fields[i].push_back(flux_field(std::move(marched[i]), g, k0, o.n_host));
  Image image;
  picture<Pack>(scene, light, light.in(lanes).line, g, imaging_of(scene, value, g), lanes, fields, threads, {&image});
  return image;
}

double march_error_on_twin(const Scene& scene, const BeamMaker& light, const Theta& theta, int threads,
                           const RenderPicture& picture) {
  const std::optional<RadialTwin> twin = radial_twin(scene, theta);
  if (!twin) throw UserError(Where{}, "there is no radial twin of this sample to measure the march on", "");
  return error_on_twin(*twin, light, 1, picture, [&](const Scene& scaled, const Theta& values) {
    return marched_picture(scaled, light, values, threads);
  });
}

}  // namespace birefit
