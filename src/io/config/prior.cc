#include "io/config/prior.h"

#include <cmath>

#include "io/config/yaml.h"
#include "io/results/fit_file.h"

namespace birefit {
namespace {

using nlohmann::json;

/// A finite number at a key, or nothing.
std::optional<double> number_at(const json& object, const char* key) {
  if (!object.is_object() || !object.contains(key) || !object[key].is_number()) return std::nullopt;
  const double value = object[key].get<double>();
  return std::isfinite(value) ? std::optional<double>(value) : std::nullopt;
}

}  // namespace

JointPrior load_prior(const std::filesystem::path& path, const std::vector<std::pair<std::string, Where>>& names,
                      const Where& where, std::vector<std::string>& warnings) {
  const std::string file = path.string();
  const json root = read_fit_file(path, where);
  const auto not_a_fit = [&](const std::string& lacks) {
    return UserError(where, file + " has no " + lacks, "expected the fit.json of an earlier fit");
  };
  if (!root.is_object() || !root.contains("parameters") || !root["parameters"].is_object())
    throw not_a_fit("`parameters`");
  const json& covariance = root.contains("covariance") ? root["covariance"] : json();
  if (!covariance.is_object() || !covariance.contains("names") || !covariance["names"].is_array() ||
      !covariance.contains("matrix") || !covariance["matrix"].is_array())
    throw not_a_fit("`covariance` with names and matrix");

  std::vector<std::string> known;
  for (const json& name : covariance["names"]) known.push_back(name.is_string() ? name.get<std::string>() : "");

  JointPrior prior;
  prior.source = file;
  prior.mean.resize(names.size());
  prior.covariance.resize(names.size(), names.size());
  std::vector<std::size_t> rows;
  Problems problems;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto& [name, name_where] = names[i];
    std::size_t row = 0;
    while (row < known.size() && known[row] != name) ++row;
    if (row == known.size()) {
      const std::string near = nearest_word(name, known);
      problems.add(name_where, name + " was not fitted in " + file, near.empty() ? "" : "did you mean " + near + "?");
      continue;
    }
    const json entry = root["parameters"].contains(name) ? root["parameters"][name] : json();
    const std::optional<double> value = number_at(entry, "value");
    if (!value) {
      problems.add(name_where, name + " has no value in " + file);
      continue;
    }
    prior.mean[static_cast<Eigen::Index>(prior.names.size())] = *value;
    prior.names.push_back(name);
    rows.push_back(row);
  }
  problems.throw_if_any();

  const json& matrix = covariance["matrix"];
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t j = 0; j < rows.size(); ++j) {
      if (rows[i] >= matrix.size() || !matrix[rows[i]].is_array() || rows[j] >= matrix[rows[i]].size())
        throw not_a_fit("covariance matrix of the size its names say");
      const json& cell = matrix[rows[i]][rows[j]];
      if (!cell.is_number())
        throw UserError(names[i].second, names[i].first + " has no covariance in " + file,
                        "the earlier fit could not determine it; leave it out or repair that fit");
      prior.covariance(i, j) = cell.get<double>();
    }
  }
  // Scaled to unit diagonal, so that parameters of very different size do not hide a lost direction.
  const Eigen::VectorXd sd = prior.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (!(sd[i] > 0) || !std::isfinite(sd[i]))
      throw UserError(names[i].second, names[i].first + " has no positive variance in " + file);
  const Eigen::MatrixXd scaled = sd.cwiseInverse().asDiagonal() * prior.covariance * sd.cwiseInverse().asDiagonal();
  if (!scaled.isApprox(scaled.transpose(), 1e-6) || Eigen::LLT<Eigen::MatrixXd>(scaled).info() != Eigen::Success)
    throw UserError(where, "the covariance in " + file + " is not symmetric and positive definite");

  const std::optional<double> freedom = number_at(root, "interval_degrees_of_freedom");
  if (freedom && *freedom > 0) prior.degrees_of_freedom = *freedom;
  if (root.contains("frame_scatter")) {
    const std::optional<double> intensity_sd = number_at(root["frame_scatter"], "intensity_sd");
    const std::optional<double> scatter_freedom = number_at(root["frame_scatter"], "degrees_of_freedom");
    if (intensity_sd && *intensity_sd >= 0 && scatter_freedom && *scatter_freedom > 0)
      prior.frame_scatter = JointPrior::FrameScatter{*intensity_sd, *scatter_freedom};
  }
  if (root.value("converged", json(true)) == json(false))
    warnings.push_back("The prior's fit (" + file + ") had not converged.");
  if (root.value("ambiguous", json(false)) == json(true))
    warnings.push_back("The prior's fit (" + file + ") was ambiguous: its covariance describes one of several minima.");
  return prior;
}

}  // namespace birefit
