// What a fit.json tells a series that goes on.

#include <cmath>
#include <limits>

#include "birefit/series.h"
#include "io/results/fit_file.h"

namespace birefit {
namespace {

using nlohmann::json;

/// JSON's null is what has no value.
double number(const json& value) {
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

ParameterEstimate estimate_of(const std::string& name, const json& entry) {
  ParameterEstimate p;
  p.name = name;
  p.unit = entry.at("unit");
  p.value = number(entry.at("value"));
  p.stderr_ = number(entry.at("stderr"));
  p.interval95_low = number(entry.at("interval_95").at(0));
  p.interval95_high = number(entry.at("interval_95").at(1));
  p.at_bound = entry.at("at_bound");
  p.linear = entry.at("linear");
  if (!entry.at("limit").is_null()) {
    p.limit = entry.at("limit").at("side");
    p.limit_value = number(entry.at("limit").at("value"));
  }
  return p;
}

Eigen::MatrixXd matrix_of(const json& rows, std::size_t size) {
  const auto n = static_cast<Eigen::Index>(size);
  Eigen::MatrixXd matrix(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      matrix(i, j) = number(rows.at(static_cast<std::size_t>(i)).at(static_cast<std::size_t>(j)));
  return matrix;
}

FitResult fit_of(const json& root) {
  FitResult fit;
  fit.converged = root.at("converged");
  fit.interrupted = root.at("interrupted");
  fit.ambiguous = root.at("ambiguous");
  fit.identifiable = root.at("identifiable");
  fit.pinned = root.at("pinned");
  fit.described = root.at("described");
  fit.verdict = root.at("verdict");
  const json& freedom = root.at("interval_degrees_of_freedom");
  fit.interval_degrees_of_freedom = freedom.is_null() ? std::numeric_limits<double>::infinity() : number(freedom);
  fit.chi_square = number(root.at("chi_square"));
  fit.reduced_chi_square = number(root.at("reduced_chi_square"));
  fit.degrees_of_freedom = root.at("degrees_of_freedom");
  fit.warnings = root.at("warnings");
  fit.names = root.at("covariance").at("names");
  fit.covariance = matrix_of(root.at("covariance").at("matrix"), fit.names.size());
  fit.stated_covariance = matrix_of(root.at("stated_covariance").at("matrix"), fit.names.size());
  fit.misfit = root.at("misfit");
  for (const std::string& name : fit.names) fit.parameters.push_back(estimate_of(name, root.at("parameters").at(name)));
  for (const json& entry : root.at("derived")) {
    DerivedEstimate derived;
    derived.name = entry.at("name");
    derived.expression = entry.at("expression");
    derived.tied = entry.at("tied");
    derived.unit = entry.at("unit");
    derived.value = number(entry.at("value"));
    derived.stderr_ = number(entry.at("stderr"));
    derived.interval95_low = number(entry.at("interval_95").at(0));
    derived.interval95_high = number(entry.at("interval_95").at(1));
    const json& slopes = entry.at("slopes");
    derived.by.resize(static_cast<Eigen::Index>(slopes.size()));
    for (std::size_t k = 0; k < slopes.size(); ++k) derived.by[static_cast<Eigen::Index>(k)] = number(slopes[k]);
    fit.derived.push_back(std::move(derived));
  }
  return fit;
}

}  // namespace

std::optional<RecordedFit> load_recorded_fit(const std::filesystem::path& fit_json) {
  std::error_code code;
  if (!std::filesystem::exists(fit_json, code)) return std::nullopt;
  try {
    const json root = read_fit_file(fit_json, Where{});
    // The fingerprint is of what went in. What came out is only trusted as it was written.
    if (root.at("checksum").get<std::string>() != checksum_of(root)) return std::nullopt;
    return RecordedFit{root.at("fingerprint"), fit_of(root)};
  } catch (const json::exception&) {
    return std::nullopt;
  } catch (const UserError&) {
    return std::nullopt;
  }
}

}  // namespace birefit
