#include "app/frames.h"

#include <stdexcept>
#include <utility>

#include "io/results/work.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

/// A frame's fit; nothing, and the frame marked `unreadable`, where its picture is of no use.
std::optional<FitResult> fit_frame(SeriesFrame& frame, const Config& config) {
  return do_work(config, memory_to_fit(config.job), [&]() -> std::optional<FitResult> {
    try {
      return fit(config.job);
    } catch (const UserError& error) {
      frame.unreadable = error.what();
      return std::nullopt;
    }
  });
}

}  // namespace

void remove_parts(const fs::path& folder) {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored))
    if (entry.path().extension() == ".part" && entry.path().filename().string().starts_with('.'))
      fs::remove(entry.path(), ignored);
}

FrameDone do_frame(SeriesFrame& frame, Config& config, const FitResult* neighbour, const fs::path& place,
                   const std::function<void()>& begin) {
  if (neighbour) start_from(config, *neighbour);
  config.fingerprint = fingerprint_of(config);
  remove_parts(place);
  FrameDone done{load_recorded_fit(place / "fit.json"), std::nullopt};
  if (done.record && done.record->fingerprint == config.fingerprint) return done;
  done.record.reset();
  begin();
  std::optional<FitResult> result = fit_frame(frame, config);
  if (!result || result->interrupted) return done;  // the next run does it whole
  write_results(place, config, *result);
  // What is read back is all that later runs will know of it.
  done.record = load_recorded_fit(place / "fit.json");
  if (!done.record) throw std::logic_error("fit.json cannot be read back");
  done.fresh = std::move(result);
  return done;
}

}  // namespace birefit
