#include "io/results/write.h"

#include <algorithm>
#include <regex>
#include <system_error>

#include <fmt/format.h>

#include "core/printable.h"
#include "io/files/csv.h"
#include "io/files/file.h"
#include "io/files/whole_file.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

/// Of a fit's results, the names of those whose number follows from the config.
const std::string kPictures = R"((fitted|residual)(_[0-9]+)?\.(tif|npy|csv))";

std::string table_csv(const SignalTable& table, const FitResult& result) {
  std::string text = table.path + ",measured,fitted,residual,sigma\n";
  for (std::size_t r = 0; r < table.x.size() && table.first + r < result.micrographs.size(); ++r) {
    const MicrographResult& m = result.micrographs[table.first + r];
    if (m.fitted.empty()) continue;
    text += fmt::format("{:.10g},{:.10g},{:.10g},{:.10g},{:.4g}\n", table.x[r], m.fitted(0, 0) + m.residual(0, 0),
                        m.fitted(0, 0), m.residual(0, 0), m.sigma(0, 0));
  }
  return text;
}

/// Those of the config's derived quantities that follow from what is drawn (entries of the table) and what is exact
/// alone: of what is stated and not known exactly, draws have what it does to the fit, not its own value.
std::vector<const Derived*> derived_of_draws(const FitJob& job, const std::vector<int>& drawn) {
  std::vector<const Derived*> of_draws;
  for (const Derived& derived : job.derived) {
    const auto is_drawn = [&](int root) {
      const Parameter& parameter = job.parameters[root];
      return std::find(drawn.begin(), drawn.end(), root) != drawn.end() ||
             (!parameter.free && !(parameter.known_to.of(parameter.value) > 0));
    };
    bool all = true;
    for (const int of : derived.tie.of)
      for (const int root : job.parameters.roots(of)) all = all && is_drawn(root);
    if (all) of_draws.push_back(&derived);
  }
  return of_draws;
}

std::string samples_csv(const FitJob& job, const FitResult& result) {
  const ParameterTable& table = job.parameters;
  std::string text;
  std::vector<int> drawn;  // entries of the table, below 0 of what a fit has added itself
  for (const ParameterEstimate& p : result.parameters) {
    const ParameterRef ref = table.find(p.name);
    drawn.push_back(ref ? ref.index : -1);
    text += (text.empty() ? "" : ",") + csv_field(p.name);
  }
  const std::vector<const Derived*> derived = derived_of_draws(job, drawn);
  for (const Derived* one : derived) text += "," + csv_field(one->name);
  text += "\n";
  Theta theta = table.values();
  const Eigen::MatrixXd& values = result.samples->values;
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    for (Eigen::Index j = 0; j < values.cols(); ++j) {
      text += fmt::format("{}{:.10g}", j > 0 ? "," : "", values(i, j));
      if (const int at = drawn[static_cast<std::size_t>(j)]; at >= 0)
        theta[static_cast<std::size_t>(at)] = values(i, j);
    }
    if (!derived.empty()) table.follow(theta);
    for (const Derived* one : derived) text += fmt::format(",{:.10g}", table.value_of(one->tie, theta));
    text += "\n";
  }
  return text;
}

/// Pictures and tables of an earlier fit that `files` do not replace. Only beside a fit.json: elsewhere files of these
/// names are somebody else's.
std::vector<fs::path> left_by_earlier_fit(const fs::path& folder, const std::vector<FileContent>& files) {
  std::vector<fs::path> left;
  std::error_code code;
  if (!fs::exists(folder / "fit.json", code)) return left;
  static const std::regex kOurs(kPictures + R"(|samples\.csv)");
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, code))
    if (std::regex_match(entry.path().filename().string(), kOurs) &&
        std::none_of(files.begin(), files.end(),
                     [&](const FileContent& file) { return file.path.filename() == entry.path().filename(); }))
      left.push_back(entry.path());
  return left;
}

}  // namespace

std::vector<FileContent> result_files(const Config& config, const FitResult& result,
                                      const std::vector<std::string>& picture_formats) {
  std::vector<FileContent> files;
  for (std::size_t k = 0; k < config.signals.size(); ++k)
    files.push_back({"fitted" + (config.signals.size() > 1 ? "_" + std::to_string(k) : "") + ".csv",
                     table_csv(config.signals[k], result)});
  for (std::size_t i = 0; config.signals.empty() && i < result.micrographs.size(); ++i) {
    const std::string number = result.micrographs.size() > 1 ? "_" + std::to_string(i) : "";
    const Picture* measured = picture_at(config.job.measurements, i);
    const ParameterRef size = measured ? measured->scene.view.pixel_size_um : ParameterRef{};
    const double pixel_size_um = !size                                   ? 0
                                 : size.index < std::ssize(result.theta) ? size.in(result.theta)
                                                                         : size.in(config.job.parameters.values());
    const auto add = [&](const std::string& name, const Image& image) {
      if (image.empty()) return;
      for (const std::string& format : picture_formats) {
        const fs::path path = name + number + format;
        files.push_back({path, encode_image(image, path, pixel_size_um)});
      }
    };
    add("fitted", result.micrographs[i].fitted);
    add("residual", result.micrographs[i].residual);
  }
  if (result.samples) files.push_back({"samples.csv", samples_csv(config.job, result)});
  files.push_back({"config.yaml", config.text});
  files.push_back({"log.txt", log_text(config, result)});
  files.push_back({"report.html", report_html(config, result)});
  // Last: a script that waits for fit.json finds everything else in place.
  files.push_back({"fit.json", fit_json(config, result)});
  return files;
}

void refuse_to_replace_inputs(const fs::path& folder, const Config& config) {
  static const std::regex kOurs(kPictures + R"(|samples\.csv|log\.txt|report\.html|fit\.json)");
  const auto is_there = [&](const fs::path& file) {
    std::error_code code;
    return fs::equivalent(file.parent_path().empty() ? "." : file.parent_path(), folder, code);
  };
  const auto refuse = [&](const fs::path& file, const char* whose) {
    throw UserError({folder.string()},
                    "holds " + printable(file.filename().string()) + ", " + whose + " the results would replace",
                    "choose another --out");
  };
  for (const fs::path& input : config.inputs)
    if (std::regex_match(input.filename().string(), kOurs) && is_there(input))
      refuse(input, "which the config reads and");
  constexpr std::uintmax_t kMostMb = 64;
  // As it was run is written without its remarks and with what --set says.
  std::error_code code;
  if (config.path.filename() == "config.yaml" && is_there(config.path) && fs::exists(config.path, code) &&
      read_whole(config.path, kMostMb, {config.path.string()}, "", "") != config.text)
    refuse(config.path, "this very config, which");
}

void write_result_files(const fs::path& folder, std::vector<FileContent> files) {
  std::error_code code;
  fs::create_directories(folder, code);
  if (code || !fs::is_directory(folder, code))
    throw UserError({folder.string()},
                    "cannot be created as a folder: " + (code ? code.message() : "a file is in its place"),
                    "choose another --out");
  for (FileContent& file : files) file.path = folder / file.path;
  write_files(files, left_by_earlier_fit(folder, files));
}

void write_results(const fs::path& folder, const Config& config, const FitResult& result,
                   const std::vector<std::string>& picture_formats) {
  refuse_to_replace_inputs(folder, config);
  write_result_files(folder, result_files(config, result, picture_formats));
}

}  // namespace birefit
