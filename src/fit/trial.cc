#include "fit/trial.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "fit/problem/frame.h"
#include "fit/problem/light.h"
#include "fit/zone.h"

namespace birefit {
namespace {

using namespace estimation;

/// Without the pixels that samples take out where the job begins.
FitJob without_zones(FitJob job) {
  const Theta theta = job.parameters.values();
  for (Measurement& measurement : job.measurements)
    if (Picture* picture = std::get_if<Picture>(&measurement)) picture->mask = fitted_pixels(*picture, theta);
  return job;
}

/// The job in which the fit ended: its branch, its physics, and what is stated where it had that.
FitJob as_fitted(FitJob job, const FitResult& result) {
  for (int i = 0; i < job.parameters.size() && i < static_cast<int>(result.theta.size()); ++i)
    if (!job.parameters[i].free) job.parameters[i].value = result.theta[static_cast<std::size_t>(i)];
  if (!result.micrographs.empty()) {
    const std::shared_ptr<Memo> memo = job.demand.memo;
    job.demand = result.micrographs[0].plan.demand;
    job.demand.memo = memo;
  }
  for (const BranchResult& branch : result.branches)
    for (const SampleBranch& of : job.branches) {
      if (!branch.reported || of.name != branch.name) continue;
      std::size_t next = 0;
      for_each_scene(job.measurements, [&](Scene& scene) {
        if (next < of.samples.size()) scene.sample = of.samples[next++];
      });
    }
  return job;
}

}  // namespace

struct Trials::State {
  explicit State(FitJob of) : job(std::move(of)), task(job) {
    Start begun = prepare(task);
    frames = std::move(begun.frames);
    start.assign(begun.searched.begin(), begun.searched.end());
    misfit = misfit_of_prior(task, begun.theta);
    rebuild();
  }
  void rebuild() { problem = problem_of(task, frames, misfit); }

  FitJob job;
  Task task;
  Frames frames;
  std::vector<Misfit> misfit;
  std::vector<double> start;
  std::unique_ptr<LeastSquares> problem;
};

Trials::Trials(FitJob job) : state_(std::make_unique<State>(without_zones(std::move(job)))) {}

Trials::Trials(FitJob job, const FitResult& result)
    : state_(std::make_unique<State>(as_fitted(std::move(job), result))) {
  State& state = *state_;
  for (std::size_t j = 0; j < state.start.size(); ++j)
    state.start[j] = result.theta.at(static_cast<std::size_t>(state.task.unknowns.searched[j]));
  for (std::size_t g = 0; g < state.frames.size() && g < result.micrographs.size(); ++g) {
    const MicrographResult& of = result.micrographs[g];
    Frame& frame = state.frames[g];
    frame.plan = of.plan;
    frame.noise = of.noise;
    frame.sigma = of.sigma;
    frame.pixels.clear();
    for (int y = 0; y < of.residual.height(); ++y)
      for (int x = 0; x < of.residual.width(); ++x)
        if (std::isfinite(of.residual(x, y))) frame.pixels.push_back({x, y});
  }
  state.rebuild();
}

Trials::~Trials() = default;

const std::vector<int>& Trials::searched() const { return state_->task.unknowns.searched; }
const std::vector<double>& Trials::start() const { return state_->start; }
const FitJob& Trials::job() const { return state_->job; }
const RenderPlan& Trials::plan(std::size_t frame) const { return state_->frames.at(frame).plan; }

Image Trials::sigma(std::size_t g) const {
  const Frame& frame = state_->frames.at(g);
  Image used(frame.sigma.width(), frame.sigma.height(), std::numeric_limits<double>::quiet_NaN());
  for (const auto& [x, y] : frame.pixels) used(x, y) = frame.sigma(x, y);
  return used;
}

void Trials::plan_at(const std::vector<double>& values) {
  State& state = *state_;
  const Eigen::VectorXd searched = Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
  const Theta theta = state.task.with(state.problem->theta(), searched);
  std::vector<RenderPlan> plans;  // all or none: a place that cannot be planned leaves what there was
  for (int g = 0; g < state.task.frames(); ++g) plans.push_back(state.task.planned(g, theta));
  for (std::size_t g = 0; g < plans.size(); ++g) state.frames[g].plan = std::move(plans[g]);
  state.rebuild();
}

Trial Trials::at(const std::vector<double>& values) {
  State& state = *state_;
  if (values.size() != state.start.size()) throw std::invalid_argument("a value for each searched parameter");
  LeastSquares& problem = *state.problem;
  problem.evaluate(Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values)), false);
  Trial trial;
  trial.theta = problem.theta();
  Eigen::Index begin = 0;
  for (int g = 0; g < state.task.frames(); ++g) {
    const Pixels& pixels = state.frames[static_cast<std::size_t>(g)].pixels;
    const View& view = state.task.picture(g).scene.view;
    // What was rendered already is the whole picture unless pixels were left out.
    Image intensity(view.width, view.height);
    const bool whole = pixels.size() == intensity.size();
    for (std::size_t i = 0; whole && i < pixels.size(); ++i)
      intensity(pixels[i][0], pixels[i][1]) = problem.intensity()[begin + static_cast<Eigen::Index>(i)];
    begin += static_cast<Eigen::Index>(pixels.size());
    trial.fitted.push_back(whole ? lit(state.task.picture(g), trial.theta, std::move(intensity))
                                 : fitted_image(state.task, state.frames, g, trial.theta));
    trial.chi_square += problem.frame_misfit(g).chi_square;
  }
  trial.chi_square += problem.prior_chi_square();
  const double freedom = static_cast<double>(problem.pixel_rows()) + problem.prior_rows() - state.task.unknowns.size();
  trial.reduced_chi_square = trial.chi_square / std::max(1.0, freedom);
  return trial;
}

}  // namespace birefit
