#pragma once
// Everything that touches files. Nobody outside io knows that files exist.

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "birefit/fit.h"

namespace birefit {

/// A table of signal against something (`signal:`), which is the job's measurement of the same number.
struct SignalTable {
  std::string name;                 ///< file name
  std::size_t first = 0;            ///< of its rows among FitResult::micrographs
  std::string path;                 ///< parameter that its first column sets
  std::vector<double> x;            ///< that column, growing
  std::vector<int> line;            ///< of each row in the file
  std::string quantity = "signal";  ///< what was measured, for its axis
};

struct InMemory;  // birefit/in_memory.h

struct Config;
/// What the rows of a config's tables say about themselves, in sentences: which stand out of their neighbours, whether
/// what is measured depends on when it was measured.
std::vector<std::string> describe_rows(const Config& config);

/// What a config describes, read and checked completely; every mistake in it was reported at once (UserError).
struct Config {
  std::filesystem::path path;
  std::string text;                           ///< the file as read, for the echo
  FitJob job;                                 ///< measurements empty for render-only configs
  std::vector<SignalTable> signals;           ///< empty when the job is of images
  Scene scene;                                ///< of the first measurement, or of `image_size_px`
  std::vector<Scene> colours;                 ///< of a picture of red, green and blue: the same scene in each
  Observable observable;                      ///< what is measured in it
  double model_tolerance = 0.01;              ///< of a picture that is shown, Demand::model_tolerance; a fit has 0
  std::vector<std::filesystem::path> inputs;  ///< every file that was read beside the config
  /// Of a fit: those of `inputs` that are no files but arrays (InMemory), with the SHA-256 of their samples, row after
  /// row, or of their bytes.
  std::map<std::filesystem::path, std::string> arrays;
  /// of a frame of a series: all that determines its fit (birefit/series.h); goes into fit.json
  std::string fingerprint;
};

/// What a config is read for, which decides what it has to have.
enum class ConfigUse {
  fit,     ///< images are required and loaded, `fit: auto` starts come from them
  render,  ///< images are not loaded; the view comes from image_size_px or from the image's header
  /// as for a fit; where no image is named, the view comes from image_size_px and the micrograph has no values
  plan,
};

/// Reads a config (docs/configuration.md). `image` replaces the single micrograph's file. Each item of `set`,
/// "path=value", sets or replaces a value (the same, "Command line and files"); Config::text is then the config that
/// this makes, less the file's comments.
Config load_config(const std::filesystem::path& path, ConfigUse use,
                   const std::optional<std::filesystem::path>& image = std::nullopt,
                   const std::vector<std::string>& set = {});
/// The same of a config that is no file: `name` is what errors call it, and its folder where files that it names are
/// looked for. What the config, or `image`, names and `in_memory` has is taken from there; it is read during this call
/// alone.
Config load_config_text(std::string text, const std::filesystem::path& name, ConfigUse use,
                        const std::optional<std::filesystem::path>& image = std::nullopt,
                        const std::vector<std::string>& set = {}, const InMemory* in_memory = nullptr);

// ---- images ---------------------------------------------------------------------------------------------------------

/// Which samples of which file load_image() reads.
struct ImageRequest {
  std::filesystem::path path;
  std::optional<int> page;  ///< of a multi-page file; required when there are several
  std::string channel;      ///< "r" | "g" | "b" | "mean" | a number from 0; "" = not chosen
  Where where;              ///< of the config entry, for errors
  bool mask = false;        ///< black and white are all that is asked for: 1 bit will do
  bool cells = false;       ///< pixels may see different things in cells of 2 x 2 (a mosaic of filters)
  /// What is wanted of the image: work and memory are of these pixels, as far as the format allows; none: all.
  std::optional<PixelRect> region = {};
};

/// What load_image() read, and what the file says of it.
struct LoadedImage {
  Image values;                ///< as stored: counts for integers, values for floats; linear light not yet applied
  int width = 0, height = 0;   ///< of the file's image
  int x0 = 0, y0 = 0;          ///< where in it the first of `values` is; these are empty where the region is outside
  int bits = 0;                ///< 8 or 16 for integers, 32 for float
  double top_code = 0;         ///< 255, 65535, or 0 for floats
  double pixel_size_um = 0;    ///< 0 = the file does not state it
  /// By the file's OME metadata; 0 = not stated, or several.
  double objective_na = 0, emission_nm = 0;
  std::string filter_pattern;  ///< "rggb", ..: of a raw photograph's first cell; "" = not stated
  std::array<double, 2> uneven_pixel_um{};  ///< stated along x and y where they differ; else 0
  bool colour = false;                      ///< `values` are one of several channels, or their mean
  double stored_zero = 0;                   ///< what a stored 0 is in `values`: their top where white is stored as zero
  std::vector<std::string> notes;           ///< "alpha channel ignored", ...
};

/// Throws UserError: missing, truncated, empty, 1-bit (but for masks), animated, over 16384 x 16384 images; several
/// pages or colour channels and none chosen (the message lists them). Palette images are expanded to colours, with a
/// note.
LoadedImage load_image(const ImageRequest& request);

/// .tif, .exr: float; .png: 16-bit, value 1.0 = 65535 * scale. Written to a temporary name and renamed.
void save_image(const Image& image, const std::filesystem::path& path);

/// 8-bit grey or RGB PNG in memory (for reports). rgb: 3 bytes a pixel, row 0 on top.
std::vector<unsigned char> encode_png(const std::vector<unsigned char>& samples, int width, int height, int channels);

// ---- tables and text ------------------------------------------------------------------------------------------------

/// Writes a whole file under a temporary name in the same folder, then renames: never half a file under the final
/// name. Throws UserError (unwritable, disk full).
void write_file(const std::filesystem::path& path, const std::string& content);

/// Numbers under names: every row has one for each column.
struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<double>> rows;
};
/// Comma-separated numbers with one header line. Throws UserError naming line and column.
Table load_table(const std::filesystem::path& path, Where where);

// ---- start values from the image ------------------------------------------------------------------------------------

/// Where a round object is: places as docs/conventions.md counts them, pixel centres integers.
struct DiscGuess {
  double center_x_px = 0, center_y_px = 0, radius_px = 0;
  double contrast = 0;  ///< signal of the disc over the background's noise; below about 3 there is no disc to see
};
/// Centre and radius of the one round object in a crossed-polarizer image (moments and symmetry, OpenCV).
DiscGuess find_disc(const Image& values, const Mask& mask);

// ---- results --------------------------------------------------------------------------------------------------------

/// fit.json, report.html, config.yaml, log.txt and, in each of these formats (".tif", ".npy"), fitted and residual
/// pictures in `folder` (docs/configuration.md). Pictures of an earlier fit there that this one does not replace go
/// away.
void write_results(const std::filesystem::path& folder, const Config& config, const FitResult& result,
                   const std::vector<std::string>& picture_formats = {".tif"});
/// The content of fit.json (docs/fit_json.md).
std::string fit_json(const Config& config, const FitResult& result);
/// The content of report.html: one page that asks for nothing from elsewhere.
std::string report_html(const Config& config, const FitResult& result);
/// The short human summary for stdout.
std::string summary(const FitResult& result);

}  // namespace birefit
