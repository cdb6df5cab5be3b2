// Does every part of a bar, plate or disc tell the same? Strips of it, each fitted by itself from the fit of the whole.

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <fmt/format.h>

#include "core/robust.h"
#include "fit/errors/report.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

constexpr int kStrips = 16;

/// Ends of strips that hold alike numbers of the first frame's pixels.
std::vector<int> strip_ends(const Pixels& pixels, bool rows) {
  std::vector<int> at;
  for (const auto& pixel : pixels) at.push_back(pixel[rows ? 1 : 0]);
  std::sort(at.begin(), at.end());
  std::vector<int> ends{at.front()};
  for (int i = 1; i < kStrips; ++i) {
    const int end = at[at.size() * static_cast<std::size_t>(i) / kStrips];
    if (end > ends.back()) ends.push_back(end);
  }
  ends.push_back(at.back() + 1);
  return ends;
}

/// Squares of the frames' mean residuals (of the model intensity) and of all residuals by noise, about a fit of the
/// strip by itself, from the fit of the whole.
std::optional<Strip> fitted_strip(const Task& task, const Optimum& optimum, bool rows, int begin, int end) {
  std::vector<PixelSet> sets;
  std::vector<RenderPlan> plans;
  Strip strip;
  int low = std::numeric_limits<int>::max(), high = 0;
  for (int g = 0; g < task.frames(); ++g) {
    const Frame& frame = optimum.frames[static_cast<std::size_t>(g)];
    Pixels part;
    for (const auto& pixel : frame.pixels)
      if (const int at = pixel[rows ? 1 : 0]; at >= begin && at < end) {
        part.push_back(pixel);
        low = std::min(low, pixel[rows ? 0 : 1]), high = std::max(high, pixel[rows ? 0 : 1] + 1);
      }
    constexpr std::size_t kFewest = 100;
    if (part.size() < kFewest) return std::nullopt;
    sets.push_back(pixel_set(task.picture(g), frame.sigma, std::move(part)));
    plans.push_back(frame.plan);
  }
  // Stated as the config states a region: in pixels of the file.
  const FilePixels& file = task.picture(0).scene.view.file;
  const auto column = [&](int x) { return file.x0 + file.bin * x; };
  const auto row = [&](int y) { return file.y0 + file.bin * y; };
  strip.roi_px = rows ? std::array{column(low), row(begin), column(high), row(end)}
                      : std::array{column(begin), row(low), column(end), row(high)};
  LeastSquares problem(task, std::move(plans), std::move(sets));
  SolveOptions few;
  few.max_iterations = 5;  // next to linear
  few.interrupted = task.job.options.interrupted;
  Eigen::VectorXd searched = optimum.searched;
  problem.solve(searched, few);
  // Its own misfit, shared by as many pixels as it is: of one image by the area, of several by the frames' scatter.
  double chi_square = 0, squares = 0, pixels = 0, freedom = task.frames() - task.unknowns.size(), area = 1;
  for (int g = 0; g < task.frames(); ++g) {
    const LeastSquares::FrameMisfit misfit = problem.frame_misfit(g);
    chi_square += misfit.chi_square, pixels += static_cast<double>(problem.pixels(g).value.size());
    squares += std::pow(misfit.mean_residual / task.gain_of(g, problem.theta()), 2);
    const Picture& micrograph = task.picture(g);
    Image whitened(micrograph.values.width(), micrograph.values.height());
    Mask mask(whitened.width(), whitened.height());
    const Eigen::VectorXd residual = problem.noise_whitened_residual(g);
    for (Eigen::Index i = 0; i < residual.size(); ++i) {
      const auto [x, y] = problem.pixels(g).pixels[static_cast<std::size_t>(i)];
      whitened(x, y) = residual[i], mask(x, y) = 1;
    }
    area = std::max(area, correlation_area(whitened, mask));
  }
  strip.reduced_chi_square = chi_square / std::max(1.0, pixels - task.unknowns.size());
  if (freedom >= 1) strip.frame_scatter = std::sqrt(squares / freedom);
  const Inverse inverse = invert_normal_equations(problem.factor());
  const double scale = std::max(1.0, strip.reduced_chi_square) * std::min(area, pixels / task.frames());
  for (Eigen::Index j = 0; j < searched.size(); ++j) {
    const bool known = !inverse.undetermined[static_cast<std::size_t>(j)];
    strip.value.push_back(searched[j]);
    strip.stderr_.push_back(known ? std::sqrt(scale * inverse.covariance(j, j))
                                  : std::numeric_limits<double>::infinity());
  }
  return strip;
}

/// Chi-square between the strips' values of one parameter, per degree of freedom.
double disagreement(const std::vector<Strip>& strips, std::size_t j) {
  double weights = 0, mean = 0, chi_square = 0, n = -1;
  for (const Strip& s : strips)
    if (const double w = 1 / (s.stderr_[j] * s.stderr_[j]); std::isfinite(w)) weights += w, mean += w * s.value[j], ++n;
  for (const Strip& s : strips)
    if (const double w = 1 / (s.stderr_[j] * s.stderr_[j]); std::isfinite(w))
      chi_square += w * std::pow(s.value[j] - mean / weights, 2);
  return n > 0 ? chi_square / n : 0;
}

/// Strips below a part of the median of all by `measure`.
std::vector<bool> below_median(const std::vector<Strip>& strips, double Strip::*measure, double part) {
  std::vector<double> values;
  for (const Strip& s : strips) values.push_back(s.*measure);
  const double middle = median(values);
  std::vector<bool> below;
  for (const Strip& s : strips) below.push_back(s.*measure < part * middle);
  return below;
}

/// The longest run of strips next to each other of which something is true: from, and behind its last.
std::array<std::size_t, 2> longest_run(const std::vector<bool>& of) {
  std::array<std::size_t, 2> longest{0, 0};
  for (std::size_t begin = 0; begin < of.size(); ++begin) {
    std::size_t end = begin;
    while (end < of.size() && of[end]) ++end;
    if (end - begin > longest[1] - longest[0]) longest = {begin, end};
  }
  return longest;
}

std::string range(const std::vector<Strip>& strips, double Strip::*measure, const std::vector<bool>& of, bool wanted) {
  double low = std::numeric_limits<double>::infinity(), high = 0;
  for (std::size_t i = 0; i < strips.size(); ++i)
    if (of[i] == wanted) low = std::min(low, strips[i].*measure), high = std::max(high, strips[i].*measure);
  return low < high ? fmt::format("{:.2g} to {:.2g}", low, high) : fmt::format("{:.2g}", low);
}

}  // namespace

void compare_strips(const Task& task, const Optimum& optimum, FitResult& result) {
  if (task.unknowns.searched.empty() || task.interrupted() || optimum.stopped) return;
  const Traits::Strips strips_are = traits_of(task.picture(0).scene).strips;
  const bool rows = strips_are == Traits::Strips::rows;
  constexpr double kDescribed = 2;  // a model that describes the image leaves strips nothing to differ by
  if (strips_are == Traits::Strips::none || !(result.reduced_chi_square > kDescribed)) return;
  std::vector<Strip> strips;
  const std::vector<int> ends = strip_ends(optimum.frames.front().pixels, rows);
  for (std::size_t i = 1; i < ends.size(); ++i)
    if (std::optional<Strip> strip = fitted_strip(task, optimum, rows, ends[i - 1], ends[i])) strips.push_back(*strip);
  if (strips.size() < 4) return;
  std::size_t worst = 0;
  for (std::size_t j = 1; j < task.unknowns.searched.size(); ++j)
    if (disagreement(strips, j) > disagreement(strips, worst)) worst = j;
  // Sixteen strips: by chance above this once in a million.
  constexpr double kBeyondChance = 4;
  const double between = disagreement(strips, worst);
  // A region is proposed where frames scatter far less than elsewhere and the model describes them no worse. By chance
  // three strips of sixteen next to each other are both once in a hundred pictures, as scatter of two degrees of
  // freedom is below half of its median in one strip of six.
  constexpr std::size_t kFewestSteady = 3;
  const bool scatters = strips.front().frame_scatter > 0;
  const std::vector<bool> steady = scatters ? below_median(strips, &Strip::frame_scatter, 0.5) : std::vector<bool>{};
  const std::vector<bool> described = below_median(strips, &Strip::reduced_chi_square, 1);
  std::vector<bool> both(steady);
  for (std::size_t i = 0; i < both.size(); ++i) both[i] = steady[i] && described[i];
  const auto run = longest_run(steady), trusted = longest_run(both);
  const bool stands_out = run[1] - run[0] >= kFewestSteady;
  if (between < kBeyondChance && !stands_out) return;
  const std::string what = rows ? "rows" : "columns";
  const std::size_t side = rows ? 1 : 0;
  const Parameter& parameter = task.searched(worst);
  std::string words;
  for (const Strip& s : strips)
    words += fmt::format("{}{} to {} {:.4g} +- {:.2g}", words.empty() ? "" : ", ", s.roi_px[side],
                         s.roi_px[side + 2] - 1, s.value[worst], s.stderr_[worst]);
  words = fmt::format("Strips by themselves have {} ({}) of {}", parameter.name, what, words);
  words += between < kBeyondChance ? "." : fmt::format(": they differ by {:.2g} times their errors squared.", between);
  if (trusted[1] - trusted[0] >= kFewestSteady) {
    const Strip &a = strips[trusted[0]], &b = strips[trusted[1] - 1];
    std::array<int, 4> roi = a.roi_px;
    for (const std::size_t i : {0, 1}) roi[i] = std::min(roi[i], b.roi_px[i]);
    for (const std::size_t i : {2, 3}) roi[i] = std::max(roi[i], b.roi_px[i]);
    result.trusted_px = roi;
    std::vector<bool> within(strips.size());
    for (std::size_t i = trusted[0]; i < trusted[1]; ++i) within[i] = true;
    words += fmt::format(
        " In {} {} to {} the frames scatter by {} of the model intensity, elsewhere by {}, and reduced chi-square is "
        "{} against {}: roi_px: [{}, {}, {}, {}] would leave these.",
        what, roi[side], roi[side + 2] - 1, range(strips, &Strip::frame_scatter, within, true),
        range(strips, &Strip::frame_scatter, within, false), range(strips, &Strip::reduced_chi_square, within, true),
        range(strips, &Strip::reduced_chi_square, within, false), roi[0], roi[1], roi[2], roi[3]);
  } else if (stands_out) {
    words += " Where frames scatter least is not where the model describes them best: no part is to be preferred.";
  }
  result.strips = std::move(strips);
  result.warnings.push_back(std::move(words));
}

}  // namespace birefit::estimation
