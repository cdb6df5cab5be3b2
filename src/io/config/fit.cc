#include "io/config/fit.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "io/config/prior.h"

namespace birefit {

void read_fit_options(ConfigReader& reader, const Block& root, FitOptions& options) {
  const Block block =
      reader.block(root, "fit", {"max_iterations", "threads", "scan_pixels", "scan_candidates", "outliers"}, false);
  options.max_iterations = reader.integer(block, "max_iterations", 1, 100000).value_or(options.max_iterations);
  options.threads = reader.integer(block, "threads", 0, 1024).value_or(options.threads);
  options.scan_pixels = reader.integer(block, "scan_pixels", 100, 100000000).value_or(options.scan_pixels);
  options.scan_candidates = reader.integer(block, "scan_candidates", 1, 100).value_or(options.scan_candidates);
  options.leave_out_outliers = reader.choice(block, "outliers", {"keep", "leave_out"}).value_or("keep") == "leave_out";
}

void read_prior(ConfigReader& reader, const Block& root, FitJob& job) {
  if (!root.find("prior")) return;
  const Block block = reader.block(root, "prior", {"from", "parameters"}, true);
  if (!block.node) return;
  if (!block.find("from")) reader.missing(block, "from", "the fit.json of an earlier fit");
  const std::optional<std::string> from = reader.text(block, "from");
  const YamlNode* list = block.find("parameters");
  if (!list) reader.missing(block, "parameters", "a list of parameter paths");
  if (list && (!list->is_sequence() || list->items.empty())) {
    reader.problems.add(list->where, "prior.parameters must be a list of parameter paths, found " +
                                         (list->is_sequence() ? "an empty one" : list->describe()));
    list = nullptr;
  }
  if (!from || !list) return;

  std::vector<std::string> free;
  for (int i = 0; i < reader.table.size(); ++i)
    if (reader.table[i].free) free.push_back(reader.table[i].name);
  std::vector<std::pair<std::string, Where>> names;
  const std::size_t problems_before = reader.problems.all().size();
  for (const YamlNode& item : list->items) {
    if (!item.is_scalar()) {
      reader.problems.add(item.where, "prior.parameters must hold parameter paths, found " + item.describe());
      continue;
    }
    const bool repeated =
        std::any_of(names.begin(), names.end(), [&](const auto& name) { return name.first == item.text; });
    if (repeated) {
      reader.problems.add(item.where, item.text + " is listed twice");
    } else if (std::find(free.begin(), free.end(), item.text) == free.end()) {
      const std::string near = nearest_word(item.text, free);
      const bool known = static_cast<bool>(reader.table.find(item.text));
      reader.problems.add(item.where, item.text + (known ? " is not fitted here" : " is no parameter of this config"),
                          known          ? "give it {value: .., fit: [low, high]}"
                          : near.empty() ? "fitted here: " + list_words(free)
                                         : "did you mean " + near + "?");
    } else if (const Parameter& parameter = reader.table[reader.table.find(item.text)];
               parameter.prior_sd && !parameter.automatic) {
      reader.problems.add(item.where, item.text + " also has a prior_sd of its own", "give one of the two");
    }
    names.emplace_back(item.text, item.where);
  }
  if (reader.problems.all().size() > problems_before) return;
  JointPrior prior;
  try {
    prior = load_prior(reader.resolve(*from), names, block.find("from")->where, reader.warnings);
  } catch (const UserError& error) {
    reader.problems.add(error);
    return;
  }
  for (std::size_t i = 0; i < prior.names.size(); ++i) {
    Parameter& parameter = reader.table[reader.table.find(prior.names[i])];
    const double mean = prior.mean[static_cast<Eigen::Index>(i)];
    // A start of its own from the crossed frame would count the same light twice.
    parameter.prior_sd.reset();
    parameter.value = std::clamp(mean, parameter.lower, parameter.upper);
    if (parameter.value != mean)
      reader.warnings.push_back("The prior mean of " + parameter.name + ", " + show(mean) +
                                ", lies outside its bounds.");
  }
  job.prior = std::move(prior);
}

}  // namespace birefit
