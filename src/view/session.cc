#include "view/session.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/printable.h"
#include "io/config/edit.h"
#include "io/config/reader.h"
#include "io/report/explain.h"
#include "io/report/format.h"
#include "io/results/work.h"

namespace birefit::view {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;
static_assert(std::endian::native == std::endian::little, "the page reads what is little endian");

/// Bytes that are no UTF-8 are replaced, whoever wrote them.
std::string text_in(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

void append(std::string& bytes, const std::vector<double>& values) {
  const std::size_t begin = bytes.size();
  bytes.resize(begin + sizeof(float) * values.size());
  char* to = bytes.data() + begin;
  for (const double value : values) {
    const auto single = static_cast<float>(value);
    std::copy_n(reinterpret_cast<const char*>(&single), sizeof single, to);
    to += sizeof single;
  }
}

/// As long as a number that people read: eight digits.
double rounded(double value) { return std::strtod(fmt::format("{:.8g}", value).c_str(), nullptr); }

/// A picture, or a table, whose rows are frames of their own unless they are rings.
struct Item {
  std::size_t measurement = 0, frame = 0, frames = 1;
};

std::vector<Item> items_in(const FitJob& job) {
  std::vector<Item> items;
  std::size_t frame = 0;
  for (std::size_t m = 0; m < job.measurements.size(); ++m) {
    const Readings* table = std::get_if<Readings>(&job.measurements[m]);
    items.push_back({m, frame, table ? table->rows.size() : 1});
    frame += items.back().frames;
  }
  return items;
}

Json estimates_of(const FitResult& result) {
  Json list = Json::array();
  for (const ParameterEstimate& p : result.parameters)
    list.push_back({{"name", p.name},
                    {"label", short_name(p.name)},
                    {"unit", p.unit},
                    {"value", p.value},
                    {"stderr", p.stderr_},
                    {"low", p.interval95_low},
                    {"high", p.interval95_high},
                    {"text", format_value(p.value, p.stderr_)},
                    {"error_text", format_error(p.stderr_)},
                    {"low_text", format_value(p.interval95_low, p.stderr_)},
                    {"high_text", format_value(p.interval95_high, p.stderr_)},
                    {"limit", p.limit},
                    {"limit_text", fmt::format("{:.4g}", p.limit_value)},
                    {"at_bound", p.at_bound},
                    {"linear", p.linear}});
  return list;
}

Json summary_of(const FitResult& result) {
  return {{"grade", result.grade()},
          {"answer", result.has_answer()},
          {"interrupted", result.interrupted},
          {"verdict", result.verdict},
          {"misfit", result.misfit},
          {"warnings", result.warnings},
          {"chi_square", result.chi_square},
          {"reduced_chi_square", result.reduced_chi_square},
          {"departures", result.departures.size()},
          {"seconds", result.seconds},
          {"parameters", estimates_of(result)}};
}

/// How a place in a scene follows from a searched parameter; -1: it is not searched.
Json place_of(const ParameterRef& ref, const std::vector<int>& searched) {
  const auto at = std::find(searched.begin(), searched.end(), ref.index);
  return {{"parameter", ref && at != searched.end() ? at - searched.begin() : -1},
          {"times", ref.times},
          {"plus", ref.plus}};
}

void check_name(const std::string& name) {
  const auto is_odd = [](unsigned char c) { return c == '/' || c == '\\' || c < 0x20 || c == 0x7f; };
  const bool yaml = name.size() > 5 && (name.ends_with(".yaml") || name.ends_with(".yml"));
  if (!yaml || name.front() == '.' || std::any_of(name.begin(), name.end(), is_odd) || printable(name) != name)
    throw UserError({printable(name)}, "is no name for a config beside the one that is shown",
                    "a file name without folders that ends in .yaml");
}

}  // namespace

/// What is shown: replaced as a whole, so that whoever reads it keeps it.
struct Session::Shown {
  Config config;
  std::unique_ptr<Trials> trials;  ///< under busy_
  std::vector<Item> items;
  std::vector<double> origin;  ///< values of the searched parameters in the config that was opened first
  std::vector<double> begin;   ///< values of the searched parameters in the config
  std::vector<double> values;  ///< where the page begins: the same, or where a fit ended
  std::optional<FitResult> result;
  std::vector<double> planned;  ///< under busy_: where `trials` was planned
  double plan_seconds = 0;      ///< the same: what that took

  const Parameter& searched(std::size_t j) const { return config.job.parameters[trials->searched()[j]]; }
  bool has_prior(std::size_t j) const {
    const std::optional<JointPrior>& joint = config.job.prior;
    return searched(j).prior_sd ||
           (joint && std::find(joint->names.begin(), joint->names.end(), searched(j).name) != joint->names.end());
  }
};

Session::Session(int threads) : threads_(threads) {}

Session::~Session() {
  stop_ = true;
  close();
  if (fit_.joinable()) fit_.join();
}

void Session::close() {
  const std::lock_guard lock(guard_);
  ended_ = true;
  news_.notify_all();
}

std::shared_ptr<Session::Shown> Session::shown() const {
  const std::lock_guard lock(guard_);
  if (!shown_) throw UserError({}, "there is nothing to show yet", "choose a kind of sample first");
  return shown_;
}

void Session::changed() {
  ++state_;
  news_.notify_all();
}

std::shared_ptr<Session::Shown> Session::shown_of(Config config, std::optional<FitResult> result) const {
  auto next = std::make_shared<Shown>();
  next->config = std::move(config);
  next->trials = std::make_unique<Trials>(next->config.job);
  next->origin = next->begin = next->values = next->trials->start();
  next->items = items_in(next->config.job);
  if (result && !result->theta.empty()) {
    next->trials = std::make_unique<Trials>(next->config.job, *result);
    next->values = next->trials->start();
    next->result = std::move(result);
  }
  next->planned = next->values;
  return next;
}

void Session::open(Config config, std::optional<FitResult> result) {
  if (threads_ >= 0) config.job.options.threads = threads_;
  const Config& of = config;
  std::shared_ptr<Shown> next = do_work(of, memory_to_fit(of.job), [&] { return shown_of(config, std::move(result)); });
  const std::lock_guard lock(guard_);
  shown_ = std::move(next);
  description_ = state_ + 1;
  changed();
}

std::string Session::description() const {
  std::shared_ptr<Shown> now;
  Json json;
  {
    const std::lock_guard lock(guard_);
    now = shown_;
    json["version"] = description_;
    json["running"] = running_;
    json["columns"] = columns_;
    json["rows"] = rows_;
    json["rows_set"] = rows_set_;
  }
  json["ready"] = now != nullptr;
  if (!now) return text_in(json);
  const FitJob& job = now->config.job;
  json["file"] = now->config.path.filename().string();
  std::error_code code;  // of an image that had no config the name is free
  const std::string stem = now->config.path.stem().string();
  json["save_as"] = stem + (std::filesystem::exists(now->config.path, code) ? "-tried.yaml" : ".yaml");
  json["items"] = Json::array();
  for (const Item& item : now->items) {
    if (const Picture* picture = std::get_if<Picture>(&job.measurements[item.measurement])) {
      const View& view = picture->scene.view;
      json["items"].push_back({{"kind", "picture"},
                               {"name", picture->name},
                               {"width", picture->values.width()},
                               {"height", picture->values.height()},
                               {"x0", view.file.x0},
                               {"y0", view.file.y0},
                               {"bin", view.file.bin},
                               {"pixel_um", view.pixel_size_um ? view.pixel_size_um.in(job.parameters.values()) : 0},
                               {"centre_x", place_of(view.center_x_px, now->trials->searched())},
                               {"centre_y", place_of(view.center_y_px, now->trials->searched())}});
      continue;
    }
    const Readings& table = std::get<Readings>(job.measurements[item.measurement]);
    const auto of = std::find_if(now->config.signals.begin(), now->config.signals.end(),
                                 [&](const SignalTable& signal) { return signal.first == item.frame; });
    const bool along = of != now->config.signals.end() && std::ssize(of->x) == table.values.size();
    json["items"].push_back({{"kind", "table"},
                             {"name", table.name},
                             {"width", table.values.size()},
                             {"height", 1},
                             {"x", along ? Json(of->x) : Json(nullptr)},
                             {"x_label", along ? short_name(of->path) : "number"},
                             {"y_label", of != now->config.signals.end() ? of->quantity : "value"}});
  }
  json["parameters"] = Json::array();
  for (std::size_t j = 0; j < now->begin.size(); ++j) {
    const Parameter& p = now->searched(j);
    json["parameters"].push_back({{"name", p.name},
                                  {"label", short_name(p.name)},
                                  {"unit", p.unit},
                                  {"start", now->origin[j]},
                                  {"value", now->values[j]},
                                  {"lower", p.lower},
                                  {"upper", p.upper},
                                  {"prior", now->has_prior(j)}});
  }
  json["notes"] = job.warnings;
  json["result"] = now->result ? summary_of(*now->result) : Json(nullptr);
  return text_in(json);
}

std::string Session::measured(std::size_t at) const {
  const std::lock_guard lock(busy_);  // plans change while a picture is made
  const std::shared_ptr<Shown> now = shown();
  if (at >= now->items.size()) throw UserError({}, "there is no such picture");
  const Item& item = now->items[at];
  std::string bytes;
  std::vector<double> sigma;
  for (std::size_t g = item.frame; g < item.frame + item.frames; ++g) {
    const Image of = now->trials->sigma(g);
    sigma.insert(sigma.end(), of.values().begin(), of.values().end());
  }
  const Measurement& measurement = now->config.job.measurements[item.measurement];
  if (const Picture* picture = std::get_if<Picture>(&measurement)) {
    append(bytes, picture->values.values());
  } else {
    const Eigen::VectorXd& values = std::get<Readings>(measurement).values;
    append(bytes, {values.begin(), values.end()});
  }
  append(bytes, sigma);
  return bytes;
}

std::optional<std::string> Session::draw(std::size_t at, const std::vector<double>& values, bool settle) {
  const long ticket = ++latest_;
  const std::lock_guard lock(busy_);
  if (ticket != latest_) return std::nullopt;
  const std::shared_ptr<Shown> now = shown();
  if (at >= now->items.size()) throw UserError({}, "there is no such picture");
  if (values.size() != now->begin.size()) throw UserError({}, "a value for each slider is needed");
  for (const double value : values)
    if (!std::isfinite(value)) throw UserError({}, "a value is no number");
  constexpr double kQuick = 0.004;  // s: a plan that may be made for every picture
  const Clock::time_point begin = Clock::now();
  const auto since = [&] { return std::chrono::duration<double>(Clock::now() - begin).count(); };
  if (values != now->planned && (settle || now->plan_seconds < kQuick)) {
    now->trials->plan_at(values);
    now->planned = values;
    now->plan_seconds = since();
  }
  const double planning = since();
  const Trial trial = now->trials->at(values);
  const Item& item = now->items[at];
  const ParameterTable& table = now->config.job.parameters;
  Json header = {{"chi_square", trial.chi_square},
                 {"reduced_chi_square", trial.reduced_chi_square},
                 {"seconds", since()},
                 {"render_seconds", since() - planning},
                 {"planned", values == now->planned},
                 {"method", now->trials->plan(item.frame).method},
                 {"linear", Json::array()}};
  for (int i = 0; i < table.size(); ++i)
    if (table[i].free && table[i].linear)
      header["linear"].push_back(
          {{"label", short_name(table[i].name)}, {"value", trial.theta[static_cast<std::size_t>(i)]}});
  std::string words = text_in(header);
  words.resize((words.size() + 3) / 4 * 4, ' ');
  std::string bytes(4, '\0');
  const auto length = static_cast<std::uint32_t>(words.size());
  std::copy_n(reinterpret_cast<const char*>(&length), 4, bytes.data());
  bytes += words;
  for (std::size_t g = item.frame; g < item.frame + item.frames; ++g) append(bytes, trial.fitted[g].values());
  return bytes;
}

std::string Session::config_text(const std::vector<double>& values) const {
  const std::shared_ptr<Shown> now = shown();
  if (values.size() != now->begin.size()) throw UserError({}, "a value for each slider is needed");
  std::vector<NewStart> starts;
  for (std::size_t j = 0; j < values.size(); ++j) {
    const Parameter& p = now->searched(j);
    // The value of a parameter with a prior is the prior's centre, which no trial moves.
    if (values[j] == now->begin[j] || !std::isfinite(values[j]) || now->has_prior(j)) continue;
    starts.push_back({p.name, rounded(std::clamp(values[j], p.lower, p.upper)), rounded(p.lower), rounded(p.upper)});
  }
  // A centre is two numbers in one list.
  for (std::size_t j = 0; j < values.size(); ++j) {
    const Parameter& p = now->searched(j);
    if (!p.automatic || (!p.name.ends_with(".x") && !p.name.ends_with(".y"))) continue;
    const std::string twin = p.name.substr(0, p.name.size() - 1) + (p.name.back() == 'x' ? "y" : "x");
    const auto named = [&](const std::string& name) {
      return std::any_of(starts.begin(), starts.end(), [&](const NewStart& s) { return s.name == name; });
    };
    if (named(twin) && !named(p.name))
      starts.push_back({p.name, rounded(values[j]), rounded(p.lower), rounded(p.upper)});
  }
  return starts.empty() ? now->config.text : with_starts(now->config.text, starts);
}

std::filesystem::path Session::save(const std::string& name, const std::vector<double>& values, bool overwrite) const {
  check_name(name);
  const std::filesystem::path path = shown()->config.path.parent_path() / name;
  std::error_code code;
  if (!overwrite && std::filesystem::exists(path, code))
    throw UserError({path.string()}, "is there already", "another name, or overwrite it");
  const std::string text = config_text(values);
  const auto is_rewritten = [](const std::string& of) { return of.starts_with("# As set on the command line"); };
  if (path == shown()->config.path && is_rewritten(text) && std::filesystem::exists(path, code) &&
      !is_rewritten(read_text(path)))
    throw UserError({path.string()}, "would lose its comments: these values have no place in it as it is written",
                    "another name");
  write_file(path, text);
  return path;
}

std::string Session::words(const std::vector<double>& values) const {
  const std::filesystem::path path = shown()->config.path;
  Config config = load_config_text(config_text(values), path, ConfigUse::plan);
  if (threads_ >= 0) config.job.options.threads = threads_;
  return explanation_text(config, explain(config));
}

std::string Session::report() const {
  const std::shared_ptr<Shown> now = shown();
  if (!now->result) throw UserError({}, "nothing was fitted yet", "press Fit first");
  return report_html(now->config, *now->result);
}

void Session::start_fit(const std::vector<double>& values) {
  const std::shared_ptr<Shown> of = shown();
  std::string text = config_text(values);
  const std::lock_guard lock(guard_);
  if (running_) throw UserError({}, "a fit is running", "stop it first");
  if (fit_.joinable()) fit_.join();
  stop_ = false;
  fit_ = std::thread([this, of, text = std::move(text)]() mutable { run_fit(of, std::move(text)); });
  running_ = true;  // the fit's first word waits for the lock
  log_.push_back("fit from these values");
  changed();
}

void Session::run_fit(std::shared_ptr<Shown> of, std::string text) {
  std::string end;
  try {
    Config config = load_config_text(std::move(text), of->config.path, ConfigUse::fit);
    if (threads_ >= 0) config.job.options.threads = threads_;
    config.job.options.interrupted = &stop_;
    config.job.options.progress = [&](const std::string& line) { say(line); };
    FitResult result = fit_config(config);
    config.job.options.interrupted = nullptr;
    config.job.options.progress = {};
    end = fmt::format("{} after {}", result.grade(), describe_duration(result.seconds));
    std::shared_ptr<Shown> next = shown_of(std::move(config), std::move(result));
    // Reset leads to where the user began, not to where this fit did.
    for (std::size_t j = 0; j < next->origin.size(); ++j)
      for (std::size_t k = 0; k < of->origin.size(); ++k)
        if (next->searched(j).name == of->searched(k).name) next->origin[j] = of->origin[k];
    const std::lock_guard lock(guard_);
    if (shown_ == of) {
      shown_ = std::move(next);
      description_ = state_ + 1;
    }
  } catch (const std::exception& error) {
    end = printable_lines(error.what());
  }
  const std::lock_guard lock(guard_);
  running_ = false;
  log_.push_back(std::move(end));
  changed();
}

void Session::stop_fit() { stop_ = true; }

void Session::say(const std::string& line) {
  const std::lock_guard lock(guard_);
  log_.push_back(printable(line));
  changed();
}

void Session::set_row(std::size_t at, const std::vector<std::string>& columns, std::vector<std::string> cells) {
  const std::lock_guard lock(guard_);
  columns_ = columns;
  if (at >= rows_.size()) rows_.resize(at + 1);
  rows_[at] = std::move(cells);
  ++rows_set_;
  changed();
}

std::string Session::news(long seen, std::size_t line, double seconds) {
  std::unique_lock lock(guard_);
  news_.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return ended_ || state_ != seen; });
  Json json = {{"state", state_}, {"version", description_}, {"running", running_}, {"lines", Json::array()}};
  for (std::size_t i = std::min(line, log_.size()); i < log_.size(); ++i) json["lines"].push_back(log_[i]);
  json["line"] = log_.size();
  json["rows_set"] = rows_set_;
  return text_in(json);
}

}  // namespace birefit::view
