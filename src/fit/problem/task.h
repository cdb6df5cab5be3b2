#pragma once
// What every stage of a fit reads and none changes.

#include <string>

#include "birefit/fit.h"
#include "fit/problem/least_squares.h"

namespace birefit::estimation {

/// A job and what is estimated of it. Refers to the job, which has to outlive it.
struct Task {
  explicit Task(const FitJob& of) : job(of), unknowns(Unknowns::of(of)) {}

  const FitJob& job;
  Unknowns unknowns;

  int frames() const { return static_cast<int>(job.micrographs.size()); }
  const Micrograph& micrograph(int frame) const { return job.micrographs[static_cast<std::size_t>(frame)]; }
  const Parameter& searched(std::size_t j) const { return job.parameters[unknowns.searched[j]]; }
  /// `searched` in the table's places.
  Theta with(Theta theta, const Eigen::VectorXd& searched) const {
    for (std::size_t j = 0; j < unknowns.searched.size(); ++j)
      theta[static_cast<std::size_t>(unknowns.searched[j])] = searched[static_cast<Eigen::Index>(j)];
    return theta;
  }
  double gain_of(int frame, const Theta& theta) const {
    const ParameterRef ref = micrograph(frame).gain;
    return ref ? theta[static_cast<std::size_t>(ref.index)] : 1.0;
  }
  bool interrupted() const { return job.options.interrupted && job.options.interrupted->load(); }
  void say(const std::string& line) const {
    if (job.options.progress) job.options.progress(line);
  }
};

}  // namespace birefit::estimation
