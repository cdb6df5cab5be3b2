#pragma once
// Scenes and fit jobs built in code, without files.

#include <cmath>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "birefit/fit.h"
#include "pictures.h"

namespace birefit::testing {

/// How many random problems a long test solves, and from which on: BIREFIT_PROBLEMS takes another number,
/// BIREFIT_FIRST_PROBLEM others than the first ones.
inline int problems_or(int usual) {
  const char* n = std::getenv("BIREFIT_PROBLEMS");
  return n ? std::atoi(n) : usual;
}
inline int first_problem() {
  const char* n = std::getenv("BIREFIT_FIRST_PROBLEM");
  return n ? std::atoi(n) : 1;
}

/// Adds parameters to a table; every scene of a test draws its numbers from one of these.
struct TableBuilder {
  ParameterTable table;
  ParameterRef fixed(const std::string& name, double value) { return table.add_constant(name, value); }
  /// The same for what asks for a number by its name, what it may be and its value.
  auto fixing() {
    return [this](const std::string& name, const NumberSpec&, double value) { return fixed(name, value); };
  }
  ParameterRef fitted(const std::string& name, double start, double lower, double upper) {
    Parameter p;
    p.name = name;
    p.value = start;
    p.free = true;
    p.lower = lower;
    p.upper = upper;
    return table.add(p);
  }
  ParameterRef linear(const std::string& name, double start) {
    Parameter p;
    p.name = name;
    p.value = start;
    p.free = p.linear = true;
    return table.add(p);
  }
};

inline Image image_of(const std::vector<double>& values, int width, int height) {
  Image image(width, height);
  image.values() = values;
  return image;
}

inline Picture micrograph_of(std::string name, Scene scene, const std::vector<double>& counts, ParameterRef gain,
                             ParameterRef offset, NoiseModel noise) {
  Picture m;
  m.name = std::move(name);
  m.values = image_of(counts, scene.view.width, scene.view.height);
  m.mask = Mask(scene.view.width, scene.view.height, 1);
  m.scene = std::move(scene);
  m.gain = gain;
  m.offset = offset;
  m.noise = noise;
  return m;
}

inline const ParameterEstimate* find_estimate(const FitResult& result, const std::string& name) {
  for (const ParameterEstimate& p : result.parameters)
    if (p.name == name) return &p;
  return nullptr;
}

/// Whether the 95 % interval of a parameter holds its truth.
inline bool holds(const FitResult& result, const std::string& name, double truth) {
  const ParameterEstimate* estimate = find_estimate(result, name);
  return estimate->interval95_low <= truth && truth <= estimate->interval95_high;
}

/// Errors of one parameter over many repetitions, for comparing their spread with the stated standard errors.
struct Spread {
  std::vector<double> error, stderr_;
  void add(double e, double s) {
    error.push_back(e);
    stderr_.push_back(s);
  }
  /// Root mean square about the mean (not about the truth: a bias is tested separately) over the RMS standard error.
  double ratio() const {
    const double n = static_cast<double>(error.size());
    double mean = 0, var = 0, stated = 0;
    for (double e : error) mean += e / n;
    for (double e : error) var += (e - mean) * (e - mean) / (n - 1);
    for (double s : stderr_) stated += s * s / n;
    return std::sqrt(var / stated);
  }
  /// Mean error in units of the standard error of one estimate.
  double bias() const {
    double sum = 0;
    for (std::size_t i = 0; i < error.size(); ++i) sum += error[i] / stderr_[i];
    return sum / static_cast<double>(error.size());
  }
  double worst() const {
    double w = 0;
    for (std::size_t i = 0; i < error.size(); ++i) w = std::max(w, std::abs(error[i]) / stderr_[i]);
    return w;
  }
};

}  // namespace birefit::testing
