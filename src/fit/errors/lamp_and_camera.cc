#include "fit/errors/lamp_and_camera.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "fit/problem/light.h"
#include "samples/kind.h"

namespace birefit::estimation {
namespace {

constexpr double kUneven = 0.02, kUnevenOfCalibrated = 0.002, kBackground = 0.01, kBackgroundOfCalibrated = 0.001,
                 kGamma = 0.003;

/// d(light of every pixel)/d(what is usual of one departure), a column each.
class Columns {
 public:
  Columns(const Task& task, const LeastSquares& problem) : task_(task), problem_(problem) {}
  /// `at`(frame, x, y, light), in units of the light.
  template <class At>
  void add(const At& at) {
    Eigen::VectorXd column(problem_.intensity().size());
    Eigen::Index i = 0;
    for (int g = 0; g < task_.frames(); ++g)
      for (const auto& [x, y] : problem_.pixels(g).pixels) {
        column[i] = at(g, x, y, problem_.intensity()[i]);
        ++i;
      }
    columns_.conservativeResize(column.size(), columns_.cols() + 1);
    columns_.rightCols(1) = column;
  }
  const Eigen::MatrixXd& all() const { return columns_; }

 private:
  const Task& task_;
  const LeastSquares& problem_;
  Eigen::MatrixXd columns_;
};

/// What the lamp's light in the last of several pictures of one gain is usually off by, as a share of the first's; 0
/// where they have none, or it is exact.
double usual_drift(const Task& task) {
  const ParameterRef gain = task.picture(0).gain;
  if (task.frames() < 2 || !gain) return 0;
  for (int g = 0; g < task.frames(); ++g)
    if (!(task.picture(g).gain == gain) || task.observable(g).quantity != Quantity::intensity) return 0;
  return task.job.parameters[gain].known_to.share;
}

/// May the camera's curve change what the pictures tell? Not where gains are exact.
bool may_be_bent(const Task& task) {
  for (int g = 0; g < task.frames(); ++g) {
    const ParameterRef gain = task.picture(g).gain;
    if (!gain || !(task.job.parameters[gain].known_to.share > 0)) return false;
  }
  return true;
}

bool are_pictures_of_what_is_flat(const Task& task) {
  for (int g = 0; g < task.frames(); ++g) {
    const Picture& picture = task.picture(g);
    if (task.observable(g).quantity != Quantity::intensity || traits_of(picture.scene).round ||
        picture.values.width() == 1 || picture.values.height() == 1)
      return false;
  }
  return true;
}

bool are_even(const Task& task) {
  return std::all_of(task.sights.begin(), task.sights.end(),
                     [](const Sight& sight) { return traits_of(sight.picture->scene).even; });
}

bool is_stated(const Picture& picture, bool of_intensity, UnevenLight::Shape shape) {
  return std::any_of(picture.uneven.begin(), picture.uneven.end(),
                     [&](const UnevenLight& own) { return own.of_intensity == of_intensity && own.shape == shape; });
}

/// All of what round samples depart by is asked for where something is left over (catalogue.h); of flat ones only where
/// they change over the picture, and field and light can be taken for each other.
/// `frames_scatter`: the errors hold what a lamp does from one picture to the next.
Columns columns_of(const Task& task, const LeastSquares& problem, bool frames_scatter) {
  Columns columns(task, problem);
  const double drift = usual_drift(task);
  // The frames' scatter holds what a lamp does from one to the next, and not what is alike in all of them.
  if (drift > 0 && !frames_scatter)
    columns.add([&](int g, int, int, double light) {
      return drift * (static_cast<double>(g) / (task.frames() - 1) - 0.5) * light;
    });
  if (!are_pictures_of_what_is_flat(task)) return columns;
  const bool even = are_even(task);
  for (const auto& [of_intensity, usual, behind_calibration] :
       {std::tuple{true, kUneven, kUnevenOfCalibrated}, std::tuple{false, kBackground, kBackgroundOfCalibrated}})
    for (const auto shape : {UnevenLight::Shape::x, UnevenLight::Shape::y, UnevenLight::Shape::square}) {
      if (even || is_stated(task.picture(0), of_intensity, shape)) continue;
      LightTerm uneven;
      uneven.shape = shape;
      // About its mean: what all of the light is off by is the gain's.
      std::vector<double> mean;
      for (int g = 0; g < task.frames(); ++g) {
        double sum = 0;
        const auto& pixels = problem.pixels(g).pixels;
        for (const auto& [x, y] : pixels) sum += uneven.shape_at(task.picture(g).scene.view, x, y);
        mean.push_back(sum / std::max(1.0, static_cast<double>(pixels.size())));
      }
      columns.add(
          [&, of_light = of_intensity, plain = usual, divided = behind_calibration](int g, int x, int y, double light) {
            const Picture& picture = task.picture(g);
            return (picture.variance_scale.empty() ? plain : divided) * (of_light ? light : 1) *
                   (uneven.shape_at(picture.scene.view, x, y) - mean[static_cast<std::size_t>(g)]);
          });
    }
  const bool bent = std::any_of(task.picture(0).effects.begin(), task.picture(0).effects.end(),
                                [](const PictureEffect& own) { return own.kind == PictureEffect::Kind::gamma; });
  if (may_be_bent(task) && !bent)
    columns.add([&](int, int, int, double light) { return light > 0 ? kGamma * light * std::log(light) : 0; });
  return columns;
}

/// What the unknowns move by for each of the columns.
Eigen::MatrixXd shift_by(const LeastSquares::Beside& sums, const Eigen::MatrixXd& covariance) {
  return -covariance * sums.with_unknowns;
}

}  // namespace

LampAndCamera by_lamp_and_camera(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& covariance) {
  Eigen::MatrixXd columns = columns_of(task, *optimum.problem, optimum.misfit.frames_scatter).all();
  const Eigen::Index k = columns.cols();
  if (k == 0) return {};
  const LeastSquares::Beside sums = optimum.problem->beside(std::move(columns));
  const Eigen::MatrixXd shift = shift_by(sums, covariance),
                        information = sums.among + sums.with_unknowns.transpose() * shift;
  if (!shift.allFinite() || !information.allFinite()) return {};
  // The estimates are those without any of it: its mean square by the pictures and its prior, not its variance.
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(k, k), variance = (one + information).ldlt().solve(one);
  const Eigen::VectorXd mean = variance * sums.with_residual;
  return {shift * (variance + mean * mean.transpose()) * shift.transpose(),
          k == 1 && !are_pictures_of_what_is_flat(task)};
}

Eigen::MatrixXd foretold_by_lamp_and_camera(const Task& task, const LeastSquares& problem,
                                            const Eigen::MatrixXd& covariance) {
  Eigen::MatrixXd columns = columns_of(task, problem, false).all();
  if (columns.cols() == 0) return {};
  const Eigen::MatrixXd shift = shift_by(problem.beside(std::move(columns)), covariance);
  return shift.allFinite() ? Eigen::MatrixXd(shift * shift.transpose()) : Eigen::MatrixXd();
}

}  // namespace birefit::estimation
