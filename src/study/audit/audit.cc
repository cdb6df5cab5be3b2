// Where fits fail, and whether they know: pictures that are nearly the model's, drawn at random.

#include "birefit/audit.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <random>

#include <fmt/format.h>

#include "birefit/render.h"
#include "core/cut_end.h"
#include "core/robust.h"
#include "core/threads.h"
#include "fit/errors/stated.h"
#include "fit/problem/light.h"
#include "fit/weights/noise.h"
#include "study/audit/disturbance.h"

namespace birefit {
namespace {

using namespace estimation;
using study::Disturbance;
using study::Exposure;
using study::Levels;

constexpr const char* kNone = "none";
/// Of the range, where no noise is stated and there is no picture to read it off.
constexpr double kAssumedNoise = 0.01;
/// Of counts over the range, where there is no picture to show its levels.
constexpr double kAssumedRange = 3000, kAssumedDark = 100;

std::string amount_of(const Disturbance& departure, double size) {
  if (departure.unit == "%") return fmt::format("{:.3g} %", 100 * size);
  return fmt::format("{:.3g}{}{}", size, departure.unit.empty() ? "" : " ", departure.unit);
}

std::uint64_t seed_of(std::uint64_t seed, const std::string& departure, int size, int problem) {
  std::uint64_t hash = 1469598103934665603u ^ seed;
  const auto stir = [&](std::uint64_t more) { hash = (hash ^ more) * 1099511628211u; };
  for (const char c : departure) stir(static_cast<unsigned char>(c));
  stir(static_cast<std::uint64_t>(size)), stir(static_cast<std::uint64_t>(problem));
  return hash ^ (hash >> 29);
}

/// A sample of the job's kind: what is searched for, drawn about where it is stated.
Theta drawn(const FitJob& job, std::mt19937_64& random) {
  constexpr double kReach = 0.25, kRim = 0.05;  // of the width of the bounds
  Theta theta = job.parameters.values();
  for (int i = 0; i < job.parameters.size(); ++i) {
    const Parameter& p = job.parameters[i];
    if (!p.free || p.linear) continue;
    double& value = theta[static_cast<std::size_t>(i)];
    if (p.prior_sd) {
      value = std::clamp(value + *p.prior_sd * std::normal_distribution<double>()(random), p.lower, p.upper);
    } else if (p.unit == "px") {  // of a picture that shows all of it
      value = std::clamp(value + std::uniform_real_distribution<double>(-1, 1)(random), p.lower, p.upper);
    } else if (std::isfinite(p.lower) && std::isfinite(p.upper)) {
      const double width = p.upper - p.lower, reach = kReach * width, rim = kRim * width;
      value = std::uniform_real_distribution<double>(std::max(p.lower + rim, value - reach),
                                                     std::min(p.upper - rim, value + reach))(random);
    }
  }
  job.parameters.follow(theta);
  return theta;
}

/// Darkest and brightest of a job's pictures and readings; what is assumed where it has none.
struct Seen {
  double dark = kAssumedDark, top = kAssumedDark + kAssumedRange;
};
Seen seen_by(const std::vector<Sight>& sights) {
  double dark = std::numeric_limits<double>::infinity(), top = -dark;
  for (const Sight& sight : sights)
    if (const std::vector<double> values = usable_values(*sight.picture); !values.empty())
      dark = std::min(dark, quantile(values, 0.005)), top = std::max(top, quantile(values, 0.995));
  return dark < top ? Seen{dark, top} : Seen{};
}

/// What a frame is exposed with: gain and offset as stated, else those of the job's pictures.
struct Camera {
  double gain = 1, offset = 0;
  NoiseModel noise;
  bool codes = false;  ///< rounded to whole counts
};
Camera camera_of(const FitJob& job, const Picture& picture, const Seen& seen, double brightest) {
  Camera camera;
  const auto stated = [&](ParameterRef ref) { return !job.parameters[ref].free || job.parameters[ref].prior_sd; };
  if (picture.offset) camera.offset = stated(picture.offset) ? job.parameters[picture.offset].value : seen.dark;
  if (picture.gain)
    camera.gain = stated(picture.gain) ? job.parameters[picture.gain].value
                  : brightest > 0      ? (seen.top - camera.offset) / brightest
                                       : 1;
  const double range = std::abs(camera.gain) * brightest;
  if (picture.noise)
    camera.noise = *picture.noise;
  else if (picture.values.size() > 1)
    camera.noise = estimate_noise(picture);
  else
    camera.noise.read_counts = kAssumedNoise * range;
  constexpr double kCounts = 50;  // what has fewer over its range is in other units
  camera.codes = picture.variance_scale.empty() && range > kCounts && picture.values.size() != 1;
  return camera;
}

/// Frames of the job as a departure shows them, in the order of its sights.
std::vector<Image> exposed(const FitJob& whole, const Disturbance* departure, Exposure& exposure, Theta& truth) {
  const std::vector<Sight> sights = sights_of(whole);
  Demand demand = whole.demand;
  demand.intensity_accuracy = std::min(demand.intensity_accuracy, 1e-5);
  Theta shown = truth;
  if (departure && departure->scene) departure->scene(exposure, shown);
  whole.parameters.follow(shown);
  const auto mixed = departure && departure->mixed ? departure->mixed(exposure, shown)
                                                   : std::vector<std::pair<double, Theta>>{{1, shown}};
  std::vector<Image> frames;
  double brightest = 0;
  for (const Sight& sight : sights) {
    Image light;
    Scene scene = sight.picture->scene;
    for (const auto& [weight, as_mixed] : mixed) {
      Theta theta = as_mixed;
      whole.parameters.follow(theta);
      if (departure && departure->added) {
        scene = sight.picture->scene;
        departure->added(exposure, scene, theta);
      }
      const Image part = render(scene, plan(scene, demand, theta, sight.observable), theta, {}, 1).intensity;
      if (light.empty()) light = Image(part.width(), part.height());
      for (std::size_t i = 0; i < light.size(); ++i) light.values()[i] += weight * part.values()[i];
    }
    if (departure && departure->light) departure->light(exposure, scene, shown, light);
    brightest = std::max(brightest, *std::max_element(light.values().begin(), light.values().end()));
    frames.push_back(std::move(light));
  }
  const Seen seen = seen_by(sights);
  std::normal_distribution<double> normal;
  for (std::size_t g = 0; g < frames.size(); ++g) {
    const Picture& picture = *sights[g].picture;
    const Camera camera = camera_of(whole, picture, seen, brightest);
    const Levels levels{camera.offset, std::max(1e-300, std::abs(camera.gain) * brightest),
                        frames.size() > 1 ? static_cast<double>(g) / static_cast<double>(frames.size() - 1) - 0.5 : 0};
    Theta levelled = shown;
    for (const UnevenLight& uneven : picture.uneven)  // what is stated of it stays
      if (whole.parameters[uneven.coefficient].free) levelled[static_cast<std::size_t>(uneven.coefficient.index)] = 0;
    if (picture.gain) levelled[static_cast<std::size_t>(picture.gain.index)] = camera.gain;
    if (picture.offset) levelled[static_cast<std::size_t>(picture.offset.index)] = camera.offset;
    Image& values = frames[g];
    values = lit(picture, levelled, std::move(values));
    if (departure && departure->values) departure->values(exposure, levels, values);
    Picture as_seen;  // of its noise: in counts, where a calibration turned those into transmission
    as_seen.values = values, as_seen.variance_scale = picture.variance_scale;
    as_seen.mask = picture.mask.size() == values.size() ? picture.mask : Mask(values.width(), values.height(), 1);
    Image noise = standard_deviation(as_seen, camera.noise, values);
    for (double& v : noise.values()) v = std::isfinite(v) ? v * normal(exposure.random) : 0;
    if (departure && departure->noise) departure->noise(exposure, noise);
    for (std::size_t i = 0; i < noise.size(); ++i) values.values()[i] += noise.values()[i];
    if (departure && departure->codes) departure->codes(exposure, levels, values);
    if (camera.codes)
      for (double& v : values.values()) v = std::round(v);
  }
  return frames;
}

/// What reading such a file finds: where its codes end. Brighter pixels are not known at all.
void note_ends(Picture& picture) {
  const Image& values = picture.values;
  if (std::any_of(values.values().begin(), values.values().end(), [](double v) { return v != std::round(v); })) return;
  const PixelRect all{0, 0, values.width(), values.height()};
  if (const auto cut = find_cut_end(End::lowest, values, all)) picture.cut_below = cut->code;
  const auto cut = find_cut_end(End::highest, values, all);
  if (!cut) return;
  picture.cut_above = cut->code;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (values.values()[i] >= cut->code) picture.mask.values()[i] = 0;
}

/// The job with these frames in place of its own.
FitJob with_frames(const FitJob& job, const std::vector<Image>& frames) {
  FitJob again = job;
  again.options.progress = nullptr;
  again.options.threads = 1;
  again.options.choose_rays = false;  // the picture is by the rays of its plan
  std::size_t frame = 0;
  for (Measurement& measurement : again.measurements) {
    if (Picture* picture = std::get_if<Picture>(&measurement)) {
      const Image& seen = frames[frame++];
      const bool taken = picture->values.size() == seen.size();
      Mask mask = taken && picture->mask.size() == seen.size() ? picture->mask : Mask(seen.width(), seen.height(), 1);
      picture->values = seen, picture->mask = std::move(mask);
      note_ends(*picture);
      continue;
    }
    Readings& readings = std::get<Readings>(measurement);
    for (double& value : readings.values) value = frames[frame++].values().front();
  }
  return again;
}

bool told(const FitResult& result, const std::string& name) {
  return std::any_of(result.stated.begin(), result.stated.end(),
                     [&](const StatedNumber& n) { return n.name == name && n.fitted; });
}

/// Nothing where the fit was interrupted.
std::optional<AuditFit> one(const FitJob& job, const FitJob& whole, const Disturbance* departure, int size, int problem,
                            std::uint64_t seed) {
  AuditFit found;
  found.departure = departure ? departure->name : kNone;
  found.size = departure ? size : 0;
  found.problem = problem;
  // The same samples for all departures, so that widths can be compared.
  std::mt19937_64 of_sample(seed_of(seed, "", 0, problem)), random(seed_of(seed, found.departure, found.size, problem));
  Exposure exposure{random, departure ? departure->sizes[static_cast<std::size_t>(size - 1)] : 0,
                    random() % 2 ? 1.0 : -1.0};
  if (departure) found.amount = amount_of(*departure, exposure.size);
  Theta truth = drawn(whole, of_sample);
  FitResult result;
  try {
    result = fit(with_frames(job, exposed(whole, departure, exposure, truth)));
  } catch (const UserError& error) {  // nothing to fit is left of it: no answer
    found.grade = error.what();
    return found;
  }
  if (result.interrupted) return std::nullopt;
  found.grade = result.grade();
  found.answered = result.has_answer();
  if (departure && departure->parameter >= 0) {
    const Parameter& p = whole.parameters[departure->parameter];
    const double off = exposure.size * (departure->of_share ? std::abs(p.value) : 1);
    constexpr double kFar = 2.001;  // standard deviations
    found.apart = off > kFar * p.known_to.of(p.value) && found.grade == "answer" && !told(result, p.name);
  }
  if (departure && departure->beyond_usual) found.apart = found.grade == "answer" && result.departures.empty();
  if (!found.answered) return found;
  for (const ParameterEstimate& p : result.parameters) {
    const ParameterRef ref = whole.parameters.find(p.name);
    if (p.linear || !ref) continue;
    found.parameters.push_back(
        {p.name, truth[static_cast<std::size_t>(ref.index)], p.value, p.interval95_low, p.interval95_high, {}});
    if (!result.samples) continue;
    for (const Samples::Of& of : result.samples->parameters)
      if (of.name == p.name) found.parameters.back().drawn = {of.low, of.high};
  }
  return found;
}

void check(const FitJob& job) {
  if (job.prior) throw UserError(Where{}, "an audit of a fit with a prior from another fit", "leave `prior` out");
  for (const Measurement& measurement : job.measurements)
    if (const auto* readings = std::get_if<Readings>(&measurement);
        readings && readings->observable.quantity != Quantity::intensity)
      throw UserError(Where{}, readings->name + " is a table of other than intensities",
                      "an audit is of pictures and of tables of intensities");
}

FitJob completed(const FitJob& job) { return has_more_stated(job) ? with_all_stated(job) : job; }

}  // namespace

double AuditFit::Of::off() const { return std::abs(value - truth) / std::max(0.5 * (high - low), 1e-300); }

std::vector<DepartureWords> departures_of(const FitJob& job) {
  check(job);
  std::vector<DepartureWords> words;
  for (const Disturbance& d : study::disturbances(completed(job)))
    words.push_back({d.name, d.what, {amount_of(d, d.sizes[0]), amount_of(d, d.sizes[1]), amount_of(d, d.sizes[2])}});
  return words;
}

std::vector<AuditFit> audit(const FitJob& job, const AuditOptions& options) {
  check(job);
  const FitJob whole = completed(job);
  const std::vector<Disturbance> all = study::disturbances(whole);
  struct Asked {
    const Disturbance* departure;
    int size, problem;
  };
  std::vector<Asked> asked;
  for (int problem = 0; problem < options.problems * 3; ++problem) asked.push_back({nullptr, 0, problem});
  const auto wanted = [&](const std::string& name) {
    return options.departures.empty() ||
           std::find(options.departures.begin(), options.departures.end(), name) != options.departures.end();
  };
  for (const std::string& name : options.departures)
    if (name != kNone && std::none_of(all.begin(), all.end(), [&](const Disturbance& d) { return d.name == name; })) {
      std::string known = kNone;
      for (const Disturbance& d : all) known += ", " + d.name;
      throw UserError(Where{}, name + " is no departure of such a fit", "those are: " + known);
    }
  for (const Disturbance& departure : all)
    if (wanted(departure.name))
      for (int size = 1; size <= 3; ++size)
        for (int problem = 0; problem < options.problems; ++problem) asked.push_back({&departure, size, problem});

  std::vector<std::optional<AuditFit>> fits(asked.size());
  // A fit keeps two cores busy about half the time; two fits beside each other keep them busy.
  parallel_for(static_cast<int>(asked.size()), thread_count(job.options.threads), [&](int i) {
    if (job.options.interrupted && job.options.interrupted->load()) return;
    const Asked& a = asked[static_cast<std::size_t>(i)];
    auto& fit = fits[static_cast<std::size_t>(i)] = one(job, whole, a.departure, a.size, a.problem, options.seed);
    if (options.say && fit)
      options.say(fmt::format("{}{}{}: {}", fit->departure, fit->amount.empty() ? "" : " ", fit->amount, fit->grade));
  });
  std::vector<AuditFit> finished;
  for (std::optional<AuditFit>& fit : fits)
    if (fit) finished.push_back(std::move(*fit));
  return finished;
}

std::vector<AuditRow> tally(const std::vector<AuditFit>& fits) {
  std::map<std::pair<int, std::string>, double> clean;  // of the same sample
  for (const AuditFit& fit : fits)
    if (fit.size == 0)
      for (const AuditFit::Of& p : fit.parameters) clean[{fit.problem, p.name}] = p.high - p.low;
  std::vector<AuditRow> rows;
  std::vector<std::vector<double>> widths;
  for (const AuditFit& fit : fits) {
    auto row = std::find_if(rows.begin(), rows.end(),
                            [&](const AuditRow& r) { return r.departure == fit.departure && r.size == fit.size; });
    if (row == rows.end()) {
      rows.push_back({fit.departure, fit.amount, fit.size});
      widths.emplace_back();
      row = rows.end() - 1;
    }
    if (fit.apart) {
      ++row->apart;
      continue;
    }
    ++row->problems, row->answers += fit.answered, row->with_misfit += fit.answered && fit.grade != "answer";
    for (const AuditFit::Of& p : fit.parameters) {
      row->drawn += p.drawn.has_value(), row->drawn_held += p.drawn_holds();
      ++row->intervals, row->held += p.holds(), row->worst = std::max(row->worst, p.off());
      if (const auto usual = clean.find({fit.problem, p.name}); usual != clean.end() && usual->second > 0)
        widths[static_cast<std::size_t>(row - rows.begin())].push_back((p.high - p.low) / usual->second);
    }
  }
  for (std::size_t i = 0; i < rows.size(); ++i)
    rows[i].width = widths[i].empty() ? std::numeric_limits<double>::quiet_NaN() : median(widths[i]);
  return rows;
}

}  // namespace birefit
