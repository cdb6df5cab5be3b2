#include "fit/problem/least_squares.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <tuple>
#include <utility>

#include "birefit/render.h"
#include "core/threads.h"
#include "fit/errors/statistics.h"
#include "fit/problem/small_systems.h"
#include "medium/references.h"

namespace birefit::estimation {
namespace {

constexpr Eigen::Index kTileRows = 4096;

std::size_t parts_of(Eigen::Index rows) { return static_cast<std::size_t>((rows + kTileRows - 1) / kTileRows); }

/// body(part, first row, rows) over the rows of a frame, some thousand at a time. What the parts sum up is added in
/// their order, so that it does not depend on the number of threads.
template <class Body>
void for_parts(Eigen::Index rows, int threads, const Body& body) {
  parallel_for(static_cast<int>(parts_of(rows)), threads, [&](int part) {
    const Eigen::Index begin = part * kTileRows;
    body(static_cast<std::size_t>(part), begin, std::min(kTileRows, rows - begin));
  });
}

int position(const std::vector<int>& indices, int index) {
  const auto found = std::find(indices.begin(), indices.end(), index);
  return found == indices.end() ? -1 : static_cast<int>(found - indices.begin());
}

}  // namespace

LeastSquares::LeastSquares(const Task& task, std::vector<RenderPlan> plans, std::vector<PixelSet> pixels)
    : task_(task),
      job_(task.job),
      unknowns_(task.unknowns),
      plans_(std::move(plans)),
      theta_(task.job.parameters.values()) {
  for (std::size_t g = 0; g < pixels.size(); ++g) {
    const Picture& picture = task.picture(static_cast<int>(g));
    Frame frame;
    frame.set = std::move(pixels[g]);
    frame.begin = pixel_rows_;
    frame.count = frame.set.value.size();
    frame.inverse_sigma = frame.set.sigma.cwiseInverse();
    frame.inverse_sigma_norm = frame.inverse_sigma.norm();
    frame.shared = frame.set.shared_sd * frame.inverse_sigma_norm;
    for (const LightTerm& light : light_terms(picture)) {
      Term term{light,
                light.coefficient ? position(unknowns_.linear, light.coefficient.index) : -1,
                light.coefficient ? position(unknowns_.searched, light.coefficient.index) : -1,
                {},
                {}};
      if (term.shape) {
        term.at_pixels.resize(frame.count);
        for (Eigen::Index i = 0; i < frame.count; ++i)
          term.at_pixels[i] = term.shape_at(picture.scene.view, frame.set.pixels[static_cast<std::size_t>(i)][0],
                                            frame.set.pixels[static_cast<std::size_t>(i)][1]);
      }
      frame.terms.push_back(std::move(term));
    }
    std::set<int> read;
    for_each_ref(picture.scene, [&](const ParameterRef& ref) {
      if (!ref || !frame.direct.insert(ref.index).second) return;
      for (const int root : job_.parameters.roots(ref.index)) read.insert(position(unknowns_.searched, root));
      if (job_.parameters.tie_of(ref.index)) frame.tied.push_back(ref.index);
    });
    frame.read.assign(read.lower_bound(0), read.end());
    for (Eigen::Index begin = 0; begin < frame.count; begin += kTileRows)
      tiles_.push_back({static_cast<int>(g), begin, std::min(kTileRows, frame.count - begin)});
    pixel_rows_ += frame.count;
    frames_.push_back(std::move(frame));
  }
  set_priors();
  if (prior_root_.rows() > 0) tiles_.push_back({-1, 0, prior_root_.rows()});
  intensity_.resize(pixel_rows_);
  residual_.resize(pixel_rows_ + prior_root_.rows());
  whitened_value_.resize(pixel_rows_);
  set_misfit(std::vector<Misfit>(frames_.size()));
}

void LeastSquares::set_misfit(const std::vector<Misfit>& misfit) {
  misfit_ = misfit;
  for (std::size_t g = 0; g < frames_.size(); ++g) {
    Frame& frame = frames_[g];
    frame.shape_factor = 1 / std::sqrt(misfit_[g].shape_variance);
    const double ratio = misfit_[g].mean_sd * frame.inverse_sigma_norm;  // of the mean's misfit to its noise
    const double beyond = misfit_[g].mean_follows_shape ? misfit_[g].shape_variance : 1 + ratio * ratio;
    frame.mean_factor = frame.shared > 0 || !misfit_[g].mean_follows_shape
                            ? 1 / std::sqrt(beyond + frame.shared * frame.shared)
                            : frame.shape_factor;
    auto value = whitened_value_.segment(frame.begin, frame.count);
    value = frame.set.value;
    const int threads = thread_count(job_.options.threads);
    whiten(frame, value, threads);
    for (Term& term : frame.terms) {
      if (term.of_intensity || term.effect) continue;  // with the light itself
      term.whitened = term.shape ? term.at_pixels : Eigen::VectorXd::Ones(frame.count);
      whiten(frame, term.whitened, threads);
    }
  }
}

/// Multiplies by the inverse square root of diag(sigma^2) with the misfit's two parts. With u = 1/sigma normalised the
/// generalised mean is the component along u of the noise-whitened vector, so that the inverse square root of
/// I + (mean_sd |1/sigma|)^2 u u^T is another factor along u (Sherman & Morrison).
void LeastSquares::whiten(const Frame& frame, Eigen::Ref<Eigen::MatrixXd> columns, int threads) const {
  const bool alike = frame.shape_factor == frame.mean_factor;
  std::vector<Eigen::RowVectorXd> parts(alike ? 0 : parts_of(frame.count));
  for_parts(frame.count, threads, [&](std::size_t part, Eigen::Index begin, Eigen::Index rows) {
    const auto inverse_sigma = frame.inverse_sigma.segment(begin, rows);
    for (Eigen::Index j = 0; j < columns.cols(); ++j)
      columns.col(j).segment(begin, rows).array() *= frame.shape_factor * inverse_sigma.array();
    if (!alike) parts[part] = inverse_sigma.transpose() * columns.middleRows(begin, rows);
  });
  if (alike) return;
  Eigen::RowVectorXd along = Eigen::RowVectorXd::Zero(columns.cols());  // times the norm and the shape's factor
  for (const Eigen::RowVectorXd& part : parts) along += part;
  along *= (frame.mean_factor / frame.shape_factor - 1) / (frame.inverse_sigma_norm * frame.inverse_sigma_norm);
  for_parts(frame.count, threads, [&](std::size_t, Eigen::Index begin, Eigen::Index rows) {
    for (Eigen::Index j = 0; j < columns.cols(); ++j)
      columns.col(j).segment(begin, rows) += along[j] * frame.inverse_sigma.segment(begin, rows);
  });
}

void LeastSquares::set_priors() {
  const int n = unknowns_.size();
  std::vector<Eigen::RowVectorXd> rows;
  std::vector<double> target;
  for (int j = 0; j < n; ++j) {
    const Parameter& parameter = job_.parameters[unknowns_.table_index(j)];
    if (!parameter.prior_sd) continue;
    rows.push_back(Eigen::RowVectorXd::Unit(n, j) / *parameter.prior_sd);
    target.push_back(parameter.value / *parameter.prior_sd);
    student_.push_back(parameter.nuisance);
    linear_prior_.push_back(j >= searched_size());
  }
  if (job_.prior && !job_.prior->names.empty()) {
    const JointPrior& prior = *job_.prior;
    const Eigen::MatrixXd root = whitening_root(prior.covariance);
    for (Eigen::Index i = 0; i < root.rows(); ++i) {
      Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(n);
      double mean = root.row(i).dot(prior.mean);
      for (std::size_t k = 0; k < prior.names.size(); ++k) {
        const ParameterRef ref = job_.parameters.find(prior.names[k]);
        const int column = ref ? unknowns_.of_entry(ref.index) : -1;
        if (column >= 0) row[column] += root(i, static_cast<Eigen::Index>(k));
        // A parameter that is known here conditions the others on its value.
        else
          mean -= root(i, static_cast<Eigen::Index>(k)) *
                  (ref ? job_.parameters[ref].value : prior.mean[static_cast<Eigen::Index>(k)]);
      }
      rows.push_back(row);
      target.push_back(mean);
      student_.push_back(false);
      linear_prior_.push_back(false);
    }
  }
  prior_root_.resize(static_cast<Eigen::Index>(rows.size()), n);
  prior_target_.resize(static_cast<Eigen::Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    prior_root_.row(static_cast<Eigen::Index>(i)) = rows[i];
    prior_target_[static_cast<Eigen::Index>(i)] = target[i];
  }
  prior_slope_ = Eigen::VectorXd::Ones(prior_root_.rows());
}

/// Intensity of a frame's used pixels and its derivatives by table entries.
void LeastSquares::render_used(std::size_t g, const std::vector<int>& active, int threads,
                               Eigen::Ref<Eigen::VectorXd> intensity, const ColumnOf& derivative) {
  Frame& frame = frames_[g];
  const Scene& scene = task_.picture(static_cast<int>(g)).scene;
  const std::vector<std::array<int, 2>>& pixels = frame.set.pixels;
  if (picture_is_cheaper(scene, plans_[g], pixels)) {
    render(scene, plans_[g], theta_, active, threads, frame.rendering);
    const Rendering& rendering = frame.rendering;
    for_parts(frame.count, threads, [&](std::size_t, Eigen::Index begin, Eigen::Index rows) {
      const auto gather = [&](const Image& image, auto&& out) {
        for (Eigen::Index i = begin; i < begin + rows; ++i)
          out[i] = image(pixels[static_cast<std::size_t>(i)][0], pixels[static_cast<std::size_t>(i)][1]);
      };
      gather(rendering.intensity, intensity);
      for (std::size_t j = 0; j < active.size(); ++j) gather(rendering.derivatives[j], derivative(j));
    });
  } else {
    const PixelRendering rendering = render_pixels(scene, plans_[g], theta_, pixels, active, threads);
    intensity = rendering.intensity;
    for (std::size_t j = 0; j < active.size(); ++j)
      derivative(j) = rendering.derivatives.col(static_cast<Eigen::Index>(j));
  }
}

/// The same by entries that are not tied, with what they do through those that are: scenes know nothing of ties.
void LeastSquares::render_tied(std::size_t g, const std::vector<int>& wanted, int threads,
                               Eigen::Ref<Eigen::VectorXd> intensity, const ColumnOf& derivative) {
  const Frame& frame = frames_[g];
  if (frame.tied.empty()) return render_used(g, wanted, threads, intensity, derivative);
  struct Link {
    std::size_t wanted, tied;
    double slope;
  };
  std::vector<int> active;
  std::vector<std::size_t> own;  // of the active ones that are wanted themselves, which
  for (std::size_t j = 0; j < wanted.size(); ++j)
    if (frame.direct.contains(wanted[j])) active.push_back(wanted[j]), own.push_back(j);
  std::vector<Link> links;
  for (const int tied : frame.tied) {
    const std::size_t before = links.size();
    for (const TieSlope& slope : job_.parameters.slopes(tied, theta_))
      if (const int at = position(wanted, slope.index); at >= 0)
        links.push_back({static_cast<std::size_t>(at), active.size() - own.size(), slope.by});
    if (links.size() > before) active.push_back(tied);
  }
  Eigen::MatrixXd by_tied(frame.count, static_cast<Eigen::Index>(active.size() - own.size()));
  render_used(g, active, threads, intensity, [&](std::size_t k) -> Eigen::Ref<Eigen::VectorXd> {
    if (k < own.size()) return derivative(own[k]);
    return by_tied.col(static_cast<Eigen::Index>(k - own.size()));
  });
  for (std::size_t j = 0; j < wanted.size(); ++j)
    if (!frame.direct.contains(wanted[j])) derivative(j).setZero();
  for (const Link& link : links)
    derivative(link.wanted) += link.slope * by_tied.col(static_cast<Eigen::Index>(link.tied));
}

/// body(frame, threads). A core a frame pays as soon as there are several a core, and for frames of a few pixels
/// nothing else does. Waves take memory by the gigabyte: one at a time.
template <class Body>
void LeastSquares::for_frames(const Body& body) {
  const int frames = static_cast<int>(frames_.size()), threads = thread_count(job_.options.threads);
  const bool apart = frames >= 4 * threads && std::none_of(plans_.begin(), plans_.end(),
                                                           [](const RenderPlan& plan) { return plan.wave != nullptr; });
  parallel_for(frames, apart ? threads : 1, [&](int g) { body(static_cast<std::size_t>(g), apart ? 1 : threads); });
}

/// `known`: intensity and, where asked for, derivatives are those of this point already.
void LeastSquares::render_frame(std::size_t g, bool derivatives, bool known, int threads) {
  Frame& frame = frames_[g];
  std::vector<int> active;
  if (derivatives)
    for (const int j : frame.read) active.push_back(unknowns_.searched[static_cast<std::size_t>(j)]);
  auto intensity = intensity_.segment(frame.begin, frame.count);
  if (derivatives)
    for (int j = 0; j < searched_size(); ++j)
      if (std::find(frame.read.begin(), frame.read.end(), j) == frame.read.end())
        searched_columns_.col(j).segment(frame.begin, frame.count).setZero();
  if (!known)
    render_tied(g, active, threads, intensity,
                [&](std::size_t j) { return searched_columns_.col(frame.read[j]).segment(frame.begin, frame.count); });
  frame.intensity_low = frame.count ? intensity.minCoeff() : 0;
  frame.intensity_high = frame.count ? intensity.maxCoeff() : 0;
  set_effects(frame, intensity);
  for (Term& term : frame.terms) {
    if (!term.of_intensity) continue;
    term.whitened.resize(frame.count);
    for_parts(frame.count, threads, [&](std::size_t, Eigen::Index begin, Eigen::Index rows) {
      auto whitened = term.whitened.segment(begin, rows);
      whitened = intensity.segment(begin, rows);
      if (term.shape) whitened.array() *= term.at_pixels.segment(begin, rows).array();
    });
    whiten(frame, term.whitened, threads);
  }
}

void LeastSquares::render_frames(const Eigen::VectorXd& searched, bool derivatives) {
  constexpr Eigen::Index kMostKept = 1 << 23;  // 64 MB
  const Eigen::Index p = searched.size();
  const bool known = rendered_at_ == searched;
  if (known) intensity_ = rendered_.col(p);
  if (known && derivatives) searched_columns_.topRows(pixel_rows_) = rendered_.leftCols(p);
  for_frames([&](std::size_t g, int threads) { render_frame(g, derivatives, known, threads); });
  if (known || !derivatives || pixel_rows_ * (p + 1) > kMostKept) return;
  rendered_.resize(pixel_rows_, p + 1);
  rendered_ << searched_columns_.topRows(pixel_rows_), intensity_;
  rendered_at_ = searched;
}

Eigen::MatrixXd LeastSquares::intensity_by(const std::vector<int>& table_indices) {
  Eigen::MatrixXd columns(pixel_rows_, static_cast<Eigen::Index>(table_indices.size()));
  for_frames([&](std::size_t g, int threads) {
    const Frame& frame = frames_[g];
    Eigen::VectorXd intensity(frame.count);
    render_tied(g, table_indices, threads, intensity, [&](std::size_t j) {
      return columns.col(static_cast<Eigen::Index>(j)).segment(frame.begin, frame.count);
    });
  });
  return columns;
}

Eigen::VectorXd LeastSquares::shift_by(const Eigen::VectorXd& intensity_change,
                                       const Eigen::MatrixXd& covariance) const {
  Eigen::VectorXd pull = Eigen::VectorXd::Zero(unknowns_.size());
  Eigen::VectorXd change = intensity_change;
  for (const Frame& frame : frames_) {
    auto part = change.segment(frame.begin, frame.count);
    to_values(frame, part, {}, thread_count(job_.options.threads));
    whiten(frame, part, thread_count(job_.options.threads));
  }
  for (const Tile& tile : tiles_)
    if (tile.micrograph >= 0)
      pull += full_rows(tile).transpose() * change.segment(frames_[tile.micrograph].begin + tile.begin, tile.count);
  return -covariance * pull;
}

LeastSquares::Beside LeastSquares::beside(Eigen::MatrixXd columns) const {
  const Eigen::Index n = unknowns_.size(), k = columns.cols();
  Beside sums{Eigen::MatrixXd::Zero(k, k), Eigen::MatrixXd::Zero(n, k), Eigen::VectorXd::Zero(k)};
  if (k == 0) return sums;  // a matrix without columns has no rows to take a part of
  for (const Frame& frame : frames_) {
    auto part = columns.middleRows(frame.begin, frame.count);
    to_values(frame, part, {}, thread_count(job_.options.threads));
    whiten(frame, part, thread_count(job_.options.threads));
  }
  for (const Tile& tile : tiles_) {
    if (tile.micrograph < 0) continue;
    const Eigen::Index begin = frames_[tile.micrograph].begin + tile.begin;
    const auto here = columns.middleRows(begin, tile.count);
    sums.among += here.transpose() * here;
    sums.with_unknowns += full_rows(tile).transpose() * here;
    sums.with_residual += here.transpose() * residual_.segment(begin, tile.count);
  }
  return sums;
}

/// Sums of products of the linear unknowns' rows with each other and with `columns`, over one frame.
template <class Columns>
void LeastSquares::add_products(const Frame& frame, int threads, const Columns& columns, Eigen::MatrixXd& gram,
                                Eigen::MatrixXd& cross) const {
  struct Products {
    Eigen::MatrixXd gram, cross;
  };
  std::vector<const Term*> terms;
  for (const Term& term : frame.terms)
    if (term.unknown >= 0) terms.push_back(&term);
  const Eigen::Index l = static_cast<Eigen::Index>(terms.size());
  std::vector<Products> parts(parts_of(frame.count));
  for_parts(frame.count, threads, [&](std::size_t part, Eigen::Index begin, Eigen::Index rows) {
    Products& sum = parts[part];
    sum.gram.resize(l, l);
    const auto& right = columns(begin, rows);
    sum.cross.resize(l, right.cols());
    for (Eigen::Index i = 0; i < l; ++i) {
      const auto row = terms[static_cast<std::size_t>(i)]->whitened.segment(begin, rows);
      for (Eigen::Index j = 0; j <= i; ++j)
        sum.gram(i, j) = sum.gram(j, i) = row.dot(terms[static_cast<std::size_t>(j)]->whitened.segment(begin, rows));
      for (Eigen::Index j = 0; j < right.cols(); ++j) sum.cross(i, j) = row.dot(right.col(j));
    }
  });
  for (const Products& sum : parts)
    for (Eigen::Index i = 0; i < l; ++i) {
      const int at = terms[static_cast<std::size_t>(i)]->unknown;
      cross.row(at) += sum.cross.row(i);
      for (Eigen::Index j = 0; j < l; ++j) gram(at, terms[static_cast<std::size_t>(j)]->unknown) += sum.gram(i, j);
    }
}

void LeastSquares::evaluate(const Eigen::VectorXd& searched, bool derivatives) {
  const Eigen::Index p = searched.size();
  for (Eigen::Index j = 0; j < p; ++j) theta_[unknowns_.searched[j]] = searched[j];
  job_.parameters.follow(theta_);
  has_derivatives_ = false;
  if (derivatives) searched_columns_.resize(residual_.size(), p);
  ++evaluations_;
  render_frames(searched, derivatives);
  solve_linear();
  if (!derivatives) return;

  const int l = static_cast<int>(unknowns_.linear.size());
  std::vector<int> all(static_cast<std::size_t>(p));
  std::iota(all.begin(), all.end(), 0);
  for_frames([&](std::size_t g, int threads) {
    const Frame& frame = frames_[g];
    auto columns = searched_columns_.middleRows(frame.begin, frame.count);
    to_values(frame, columns, all, threads);
    whiten(frame, columns, threads);
    for (const Term& term : frame.terms)
      if (term.searched >= 0) columns.col(term.searched) += term.whitened;
  });
  if (prior_root_.rows() > 0)
    searched_columns_.bottomRows(prior_root_.rows()) = prior_slope_.asDiagonal() * prior_root_.leftCols(p);

  // How the freely solved linear unknowns follow: projection = (X^T X)^-1 X^T D.
  projection_ = Eigen::MatrixXd::Zero(l, p);
  std::vector<int> moving;
  for (int j = 0; j < l; ++j) {
    const Parameter& parameter = job_.parameters[unknowns_.linear[j]];
    const double value = theta_[unknowns_.linear[j]];
    if (value > parameter.lower && value < parameter.upper) moving.push_back(j);
  }
  if (!moving.empty() && p > 0) {
    Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(l, l), cross = Eigen::MatrixXd::Zero(l, p);
    for (const Frame& frame : frames_)
      add_products(
          frame, thread_count(job_.options.threads),
          [&](Eigen::Index begin, Eigen::Index rows) {
            return searched_columns_.middleRows(frame.begin + begin, rows);
          },
          gram, cross);
    if (prior_root_.rows() > 0) {
      const Eigen::MatrixXd rows = prior_slope_.asDiagonal() * prior_root_;
      gram += rows.rightCols(l).transpose() * rows.rightCols(l);
      cross += rows.rightCols(l).transpose() * rows.leftCols(p);
    }
    const Eigen::MatrixXd solved = solve_semidefinite(gram(moving, moving), cross(moving, Eigen::all));
    for (std::size_t j = 0; j < moving.size(); ++j)
      projection_.row(moving[j]) = solved.row(static_cast<Eigen::Index>(j));
  }
  has_derivatives_ = true;
}

void LeastSquares::solve_linear() {
  const int l = static_cast<int>(unknowns_.linear.size());
  const int p = static_cast<int>(unknowns_.searched.size());
  const int threads = thread_count(job_.options.threads);
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(l, l), cross = Eigen::MatrixXd::Zero(l, 1);
  for (const Frame& frame : frames_) {
    if (l == 0) break;
    add_products(
        frame, threads,
        [&](Eigen::Index begin, Eigen::Index rows) {
          Eigen::VectorXd left = whitened_value_.segment(frame.begin + begin, rows);
          for (const Term& term : frame.terms)
            if (const double coefficient = term.coefficient_in(theta_); term.unknown < 0 && coefficient != 0)
              left -= coefficient * term.whitened.segment(begin, rows);
          return left;
        },
        gram, cross);
  }
  Eigen::VectorXd searched(p), lower(l), upper(l);
  for (int j = 0; j < p; ++j) searched[j] = theta_[unknowns_.searched[j]];
  for (int j = 0; j < l; ++j) {
    const Parameter& parameter = job_.parameters[unknowns_.linear[j]];
    lower[j] = parameter.lower, upper[j] = parameter.upper;
  }
  const Eigen::Index priors = prior_root_.rows();
  const Eigen::VectorXd apart =
      priors > 0 ? Eigen::VectorXd(prior_target_ - prior_root_.leftCols(p) * searched) : Eigen::VectorXd();
  // Student's tails make a weight of each prior, which follows the solution: to rounding, because the projected
  // gradient is exact only there.
  constexpr int kTimes = 100;
  constexpr double kRounding = 1e-10;
  Eigen::VectorXd linear = Eigen::VectorXd::Zero(l), weight = Eigen::VectorXd::Ones(priors);
  for (int time = 0; time < kTimes; ++time) {
    if (priors > 0 && l > 0) {
      const Eigen::MatrixXd rows = weight.asDiagonal() * prior_root_.rightCols(l);
      linear = solve_within_bounds(gram + prior_root_.rightCols(l).transpose() * rows,
                                   cross.col(0) + rows.transpose() * apart, lower, upper);
    } else {
      linear = solve_within_bounds(gram, cross.col(0), lower, upper);
    }
    const Eigen::VectorXd before = weight;
    for (Eigen::Index i = 0; i < priors; ++i)
      if (student_[static_cast<std::size_t>(i)] && linear_prior_[static_cast<std::size_t>(i)])
        weight[i] = student_weight(prior_root_.row(i).rightCols(l).dot(linear) - apart[i]);
    if (priors == 0 || (weight - before).cwiseAbs().maxCoeff() <= kRounding) break;
  }
  for (int j = 0; j < l; ++j) theta_[unknowns_.linear[j]] = linear[j];
  linear_information_ = gram;
  if (priors > 0)
    linear_information_ += prior_root_.rightCols(l).transpose() * weight.asDiagonal() * prior_root_.rightCols(l);

  for_frames([&](std::size_t g, int threads_of_frame) {
    const Frame& frame = frames_[g];
    for_parts(frame.count, threads_of_frame, [&](std::size_t, Eigen::Index begin, Eigen::Index rows) {
      auto residual = residual_.segment(frame.begin + begin, rows);
      residual = -whitened_value_.segment(frame.begin + begin, rows);
      for (const Term& term : frame.terms)
        if (const double coefficient = term.coefficient_in(theta_); coefficient != 0)
          residual += coefficient * term.whitened.segment(begin, rows);
    });
  });
  if (prior_root_.rows() == 0) return;
  auto of_priors = residual_.tail(prior_root_.rows());
  of_priors = prior_root_.leftCols(p) * searched + prior_root_.rightCols(l) * linear - prior_target_;
  for (Eigen::Index i = 0; i < of_priors.size(); ++i)
    if (student_[static_cast<std::size_t>(i)]) std::tie(of_priors[i], prior_slope_[i]) = student_root(of_priors[i]);
}

/// Triangular factor of the rows that rows_of(tile) gives, of some tiles at a time and then of those factors.
template <class Rows>
Eigen::MatrixXd LeastSquares::factor_of(Eigen::Index columns, const Rows& rows_of) const {
  constexpr std::size_t kTogether = 4;
  std::vector<Eigen::MatrixXd> factors((tiles_.size() + kTogether - 1) / kTogether);
  parallel_for(static_cast<int>(factors.size()), thread_count(job_.options.threads), [&](int part) {
    TallQr qr(static_cast<int>(columns));
    const std::size_t first = static_cast<std::size_t>(part) * kTogether;
    for (std::size_t t = first; t < std::min(first + kTogether, tiles_.size()); ++t) qr.add(rows_of(tiles_[t]));
    factors[static_cast<std::size_t>(part)] = qr.factor();
  });
  TallQr all(static_cast<int>(columns));
  for (const Eigen::MatrixXd& factor : factors) all.add(factor);
  return all.factor();
}

Eigen::MatrixXd LeastSquares::projected_factor(const Eigen::VectorXd& scale) const {
  const Eigen::Index p = scale.size();
  return factor_of(p + 1, [&](const Tile& tile) {
    Eigen::MatrixXd rows(tile.count, p + 1);
    const Eigen::Index begin =
        tile.micrograph < 0 ? pixel_rows_ : frames_[static_cast<std::size_t>(tile.micrograph)].begin + tile.begin;
    rows.leftCols(p) = searched_columns_.middleRows(begin, tile.count);
    if (tile.micrograph < 0) {
      rows.leftCols(p) -= prior_slope_.asDiagonal() * (prior_root_.rightCols(projection_.rows()) * projection_);
    } else {
      for (const Term& term : frames_[static_cast<std::size_t>(tile.micrograph)].terms)
        if (term.unknown >= 0)
          rows.leftCols(p) -= term.whitened.segment(tile.begin, tile.count) * projection_.row(term.unknown);
    }
    rows.leftCols(p) *= scale.asDiagonal();
    rows.col(p) = residual_.segment(begin, tile.count);
    return rows;
  });
}

Eigen::MatrixXd LeastSquares::full_rows(const Tile& tile) const {
  const Eigen::Index p = searched_size();
  if (tile.micrograph < 0) return prior_slope_.asDiagonal() * prior_root_;
  const Frame& frame = frames_[tile.micrograph];
  const Eigen::Index begin = frame.begin + tile.begin;
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(tile.count, unknowns_.size());
  rows.leftCols(p) = searched_columns_.middleRows(begin, tile.count);
  for (const Term& term : frame.terms)
    if (term.unknown >= 0) rows.col(p + term.unknown) += term.whitened.segment(tile.begin, tile.count);
  return rows;
}

void LeastSquares::for_noise_whitened_rows(
    int micrograph,
    const std::function<void(Eigen::Index, const Eigen::MatrixXd&, const Eigen::VectorXd&)>& what) const {
  const Frame& frame = frames_[micrograph];
  for (const Tile& tile : tiles_)
    if (tile.micrograph == micrograph)
      what(tile.begin, full_rows(tile) / frame.shape_factor,
           residual_.segment(frame.begin + tile.begin, tile.count) / frame.shape_factor);
}

Eigen::MatrixXd LeastSquares::factor(bool with_priors) const {
  return factor_of(unknowns_.size(), [&](const Tile& tile) -> Eigen::MatrixXd {
    if (tile.micrograph < 0 && !with_priors) return Eigen::MatrixXd::Zero(1, unknowns_.size());
    return full_rows(tile);
  });
}

Eigen::VectorXd LeastSquares::gradient() const {
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(unknowns_.size());
  for (const Tile& tile : tiles_) {
    const Eigen::Index begin = tile.micrograph < 0 ? pixel_rows_ : frames_[tile.micrograph].begin + tile.begin;
    gradient += 2 * full_rows(tile).transpose() * residual_.segment(begin, tile.count);
  }
  return gradient;
}

LeastSquares::FrameMisfit LeastSquares::frame_misfit(int micrograph) const {
  const Frame& frame = frames_[micrograph];
  const Eigen::VectorXd noise = noise_whitened_residual(micrograph);
  const Eigen::VectorXd along = frame.inverse_sigma / frame.inverse_sigma_norm;
  FrameMisfit misfit;
  misfit.chi_square = noise.squaredNorm();
  // The noise of a mean is that of its pixels and what they share.
  const double of_mean = std::hypot(1, frame.shared);
  misfit.mean_noise_sd = of_mean / frame.inverse_sigma_norm;
  misfit.mean_whitened = along.dot(noise) / of_mean;
  misfit.mean_chi_square = std::pow(along.dot(noise), 2);
  misfit.mean_residual = misfit.mean_whitened * misfit.mean_noise_sd;
  const Eigen::ArrayXd bright =
      light(frame, true, 0, frame.count).array() * intensity_.segment(frame.begin, frame.count).array();
  misfit.mean_light = along.dot((bright * frame.inverse_sigma.array()).matrix()) / frame.inverse_sigma_norm;
  const Eigen::Index p = searched_size();
  misfit.mean_jacobian_whitened = Eigen::VectorXd::Zero(unknowns_.size());
  if (has_derivatives_)
    misfit.mean_jacobian_whitened.head(p) =
        searched_columns_.middleRows(frame.begin, frame.count).transpose() * along / (frame.mean_factor * of_mean);
  for (const Term& term : frame.terms)
    if (term.unknown >= 0)
      misfit.mean_jacobian_whitened[p + term.unknown] += term.whitened.dot(along) / (frame.mean_factor * of_mean);
  return misfit;
}

Eigen::VectorXd LeastSquares::noise_whitened_residual(int micrograph) const {
  const Frame& frame = frames_[micrograph];
  const Eigen::VectorXd gain = light(frame, true, 0, frame.count), offset = light(frame, false, 0, frame.count);
  return ((gain.array() * intensity_.segment(frame.begin, frame.count).array() + offset.array() -
           frame.set.value.array()) *
          frame.inverse_sigma.array())
      .matrix();
}

std::array<double, 2> LeastSquares::intensity_range(int micrograph) const {
  return {frames_[micrograph].intensity_low, frames_[micrograph].intensity_high};
}

double LeastSquares::prior_chi_square() const { return residual_.tail(prior_root_.rows()).squaredNorm(); }

}  // namespace birefit::estimation
