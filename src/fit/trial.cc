#include "fit/trial.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "fit/problem/frame.h"
#include "fit/problem/light.h"
#include "fit/standing.h"

namespace birefit {
namespace {

using namespace estimation;

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

Trials::Trials(FitJob job) : state_(std::make_unique<State>(as_begun(std::move(job)))) {}

Trials::Trials(FitJob job, const FitResult& result)
    : state_(std::make_unique<State>(as_ended(std::move(job), result))) {
  State& state = *state_;
  for (std::size_t j = 0; j < state.start.size(); ++j)
    state.start[j] = result.theta.at(static_cast<std::size_t>(state.task.unknowns.searched[j]));
  take_from(result, state.frames);
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
