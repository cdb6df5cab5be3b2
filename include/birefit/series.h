#pragma once
// A series: many images of one setup, each fitted by itself from where its neighbour ended, with parameters of its own
// and shared ones (docs/configuration.md, "A series").

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "birefit/combine.h"
#include "birefit/io.h"

namespace birefit {

/// One image, or page of a stack, and what its row of the table sets.
struct SeriesFrame {
  /// What stands in the table, and where.
  struct Cell {
    std::string text;
    Where where;
  };
  /// the file's name without extension, and of a stack the page, of which there is no second: the folder of its results
  std::string name;
  std::string file;         ///< as found, from the config's folder on
  std::optional<int> page;  ///< of a file with several, from 0
  Where where;              ///< of the table's row, else of `files`
  std::vector<Cell> cells;  ///< one for each of ImageSeries::columns
  std::string unreadable;   ///< why its image cannot be fitted; empty: it can
};

/// What is wrong with a frame's own image, in a config that is sound: other frames can be fitted.
class FrameError : public UserError {
 public:
  using UserError::UserError;
};

/// A series as it was read and checked.
struct ImageSeries {
  /// A column that sets a parameter in every frame.
  struct Column {
    std::string name;  ///< a parameter's path
    Where where;
  };
  std::filesystem::path path;
  std::string text;                  ///< the config as read
  std::vector<std::string> set;      ///< what `--set` changes in it
  std::vector<SeriesFrame> frames;   ///< by rows of the table, else by name with numbers counted as such
  std::vector<Column> columns;       ///< of the table, `file` left out
  std::optional<std::size_t> along;  ///< column to draw the estimates against, which then may be no parameter
  std::vector<std::pair<std::string, Where>> shared;  ///< paths of the parameters that all frames have in common
  std::vector<std::pair<std::string, Where>> own;     ///< of one fit of all: what each image has for itself
  std::vector<std::string> notes;                     ///< of what was done to read the table
};

/// Reads and checks a series completely, every image of it; throws UserError with every mistake found. Frames whose own
/// image is missing, damaged or of no use are marked `unreadable`; at least one is not. `set`:
/// load_config.
ImageSeries load_series(const std::filesystem::path& path, const std::vector<std::string>& set = {});

/// The config of one frame, as if it were alone: it can be fitted. Throws FrameError where its image is of no use.
Config load_frame(const ImageSeries& series, std::size_t frame);
/// The same of a series that was checked; nothing, and the frame marked `unreadable`, where it cannot be fitted.
std::optional<Config> open_frame(ImageSeries& series, std::size_t frame);
/// The first frame that can be read: what all have in common shows in it.
std::size_t first_readable(const ImageSeries& series);

/// Starts a frame where its neighbour ended. What has a start of its own keeps it: the centre of a prior, what is found
/// in the image, and what the neighbour left at a bound, where derivatives may vanish.
void start_from(Config& frame, const FitResult& neighbour);

/// All that determines a frame's fit, in 16 hexadecimal digits: program, config, row, starts and the content of every
/// file read.
std::string fingerprint_of(const Config& frame);

/// A fit as its fit.json tells it: estimates, covariance, verdicts and warnings, no images.
struct RecordedFit {
  std::string fingerprint;
  FitResult result;
};
/// Nothing where there is no such file or it is no complete fit.json of a series.
std::optional<RecordedFit> load_recorded_fit(const std::filesystem::path& fit_json);

/// All frames with what they share settled.
struct SeriesResult {
  std::vector<std::optional<FitResult>> alone;  ///< each frame by itself; nothing for those not fitted yet
  /// The same, informed about the shared parameters by all other frames. Frames without an answer stay as they were:
  /// they inform none.
  std::vector<std::optional<FitResult>> frames;
  std::optional<SharedEstimate> shared;
  std::vector<std::string> warnings;

  bool has_answer() const;  ///< every frame has one and they agree on what they share
};
/// Combines what the frames' fits say of the shared parameters and informs each of it; `fits`: one a frame, in their
/// order, nothing for those not fitted yet.
SeriesResult settle_series(const ImageSeries& series, std::vector<std::optional<FitResult>> fits);

/// One row a frame: file, the table's columns, every parameter with its errors, reduced chi-square, verdict, and the
/// reason where that is no answer.
std::string series_csv(const ImageSeries& series, const SeriesResult& result);
/// One row for each shared parameter; empty without any.
std::string shared_csv(const SeriesResult& result);

}  // namespace birefit
