#pragma once
// What every stage of a fit reads and none changes.

#include <algorithm>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Dense>

#include "birefit/fit.h"

namespace birefit::estimation {

/// Which table entries are estimated, and how.
struct Unknowns {
  std::vector<int> searched;  ///< table indices: the solver's parameters
  std::vector<int> linear;    ///< table indices: gains, offsets and uneven light, solved exactly
  int size() const { return static_cast<int>(searched.size() + linear.size()); }
  /// Table index of unknown j, searched first.
  int table_index(int j) const {
    const int p = static_cast<int>(searched.size());
    return j < p ? searched[j] : linear[j - p];
  }
  /// The unknown that is this entry of the table; -1: none is.
  int of_entry(int table_index) const {
    for (int j = 0; j < size(); ++j)
      if (this->table_index(j) == table_index) return j;
    return -1;
  }
  static Unknowns of(const FitJob& job);
};

/// What the solver sees at once, whose mean residual is one observation among those of the others: a picture, or of a
/// table a row, or all its rings. What is no picture stands there as one, with a pixel a value.
struct Sight {
  std::shared_ptr<const Picture> picture;  ///< the job's, or its own
  Observable observable;
  std::string table;  ///< name of the table that it is a row of; of pictures and rings their own
  /// Its noise was read off neighbouring rows: it holds a lamp's jitter, and is no better known than by so many rows.
  bool noise_of_rows = false;
};

/// The sights of a job's measurements, in their order. The job has to outlive them.
std::vector<Sight> sights_of(const FitJob& job);

struct Task;
/// Whether the number is that entry, or tied to it.
bool follows_from(const ParameterTable& table, ParameterRef number, int index);
/// Table indices of the numbers that some frame of a task reads, or what it reads follows from, and that are not
/// fitted, in ascending order; and of those that every frame does.
std::vector<int> known_to_some_frames(const Task& task);
std::vector<int> known_to_all_frames(const Task& task);

/// A job and what is estimated of it. Refers to the job, which has to outlive it.
struct Task {
  explicit Task(const FitJob& of) : job(of), unknowns(Unknowns::of(of)), sights(sights_of(of)) {}

  const FitJob& job;
  Unknowns unknowns;
  std::vector<Sight> sights;

  int frames() const { return static_cast<int>(sights.size()); }
  const Picture& picture(int frame) const { return *sights[static_cast<std::size_t>(frame)].picture; }
  const Observable& observable(int frame) const { return sights[static_cast<std::size_t>(frame)].observable; }
  /// As the job demands, but no more exactly than `accuracy` (of the incident intensity).
  RenderPlan planned(int frame, const Theta& theta, double accuracy = 0) const {
    Demand demand = job.demand;
    demand.intensity_accuracy = std::max(demand.intensity_accuracy, accuracy);
    return plan(picture(frame).scene, demand, theta, observable(frame));
  }
  const Parameter& searched(std::size_t j) const { return job.parameters[unknowns.searched[j]]; }
  /// `searched` in the table's places.
  Theta with(Theta theta, const Eigen::VectorXd& searched) const {
    if (searched.size() != static_cast<Eigen::Index>(unknowns.searched.size()))
      throw std::logic_error("a place of another task");
    for (std::size_t j = 0; j < unknowns.searched.size(); ++j)
      theta[static_cast<std::size_t>(unknowns.searched[j])] = searched[static_cast<Eigen::Index>(j)];
    job.parameters.follow(theta);
    return theta;
  }
  double gain_of(int frame, const Theta& theta) const {
    const ParameterRef ref = picture(frame).gain;
    return ref ? theta[static_cast<std::size_t>(ref.index)] : 1.0;
  }
  bool interrupted() const { return job.options.interrupted && job.options.interrupted->load(); }
  void say(const std::string& line) const {
    if (job.options.progress) job.options.progress(line);
  }
};

/// The frames are colours of photographs, each with a gain of its own: what one is off by as a whole is in its gain,
/// and what is left over is in the pixels.
bool are_colours(const Task& task);

}  // namespace birefit::estimation
