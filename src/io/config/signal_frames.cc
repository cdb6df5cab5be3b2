#include "io/config/signal_frames.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "io/config/frames.h"
#include "io/config/pictures.h"

namespace birefit {
namespace {

/// Mean of the pixels that are used.
double mean_of(const Picture& picture) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < picture.values.size(); ++i)
    if (picture.mask.values()[i]) sum += picture.values.values()[i], ++count;
  return sum / count;
}

/// The frame's picture; nothing, with a problem, where it cannot be used.
std::optional<Picture> picture_of(ConfigReader& reader, const MicrographSettings& settings,
                                  const Calibration* calibration, const LoadedMask* mask, const SeriesFrame& frame) {
  PageChoice page;
  page.number = frame.page;
  std::optional<LoadedImage> image = try_load(reader, settings, reader.resolve(frame.file), page, frame.where);
  if (!image) return std::nullopt;
  Picture named;
  named.name = frame.name;
  std::vector<Picture> pictures =
      pictures_of(reader, settings, calibration, mask, std::move(*image), frame.where, named);
  if (pictures.empty()) return std::nullopt;
  if (pictures.size() > 1) {
    reader.problems.add(frame.where, frame.name + " is a mosaic of several pictures, a row of a table has one number",
                        "choose a channel with one picture, or fit the frames as micrographs");
    return std::nullopt;
  }
  if (pictures[0].saturated > 0) {
    reader.problems.add(frame.where,
                        fmt::format("{}: {} pixels of the region are saturated", frame.name, pictures[0].saturated));
    return std::nullopt;
  }
  return std::move(pictures[0]);
}

/// Names of the columns beside `signal`.
void name_columns(const ImageSeries& series, TextTable& table) {
  for (const ImageSeries::Column& column : series.columns) {
    table.header.push_back({column.name, column.where.column});
    table.header_line = column.where.line;
  }
  for (const char* name : {"frame", "signal"}) table.header.push_back({name, 1});
}

}  // namespace

std::optional<TextTable> table_of_frames(ConfigReader& reader, const SignalItem& item,
                                         const MicrographSettings& settings) {
  MicrographSettings region = settings;
  if (item.roi) region.roi = item.roi, region.roi_where = item.roi_where;
  FramesAsked asked = *item.frames;
  asked.page = settings.page;
  const std::size_t before = reader.problems.all().size();
  ImageSeries series;
  find_frames(reader, asked, series);
  const std::optional<Calibration> calibration = load_calibration(reader, region);
  const std::optional<LoadedMask> mask = load_user_mask(reader, region);
  if (reader.problems.all().size() > before) return std::nullopt;

  TextTable table;
  table.notes = series.notes;
  name_columns(series, table);
  std::vector<std::string> left_out;
  std::optional<UserError> first;
  for (std::size_t i = 0; i < series.frames.size(); ++i) {
    const SeriesFrame& frame = series.frames[i];
    ConfigReader own(reader.file, reader.folder, reader.use);  // what is wrong with a frame is its own
    if (!frame.unreadable.empty()) own.problems.add(frame.where, frame.unreadable);
    std::optional<Picture> picture;
    if (own.problems.empty())
      picture = picture_of(own, region, calibration ? &*calibration : nullptr, mask ? &*mask : nullptr, frame);
    reader.inputs.insert(own.inputs.begin(), own.inputs.end());
    for (std::string& warning : own.warnings)
      if (std::find(table.notes.begin(), table.notes.end(), warning) == table.notes.end())
        table.notes.push_back(std::move(warning));
    if (!picture) {
      if (!first) first.emplace(own.problems.all());
      left_out.push_back(own.problems.all()[0].what);
      continue;
    }
    std::vector<TableCell> row;
    for (const SeriesFrame::Cell& cell : frame.cells) row.push_back({cell.text, cell.where.column});
    row.push_back({std::to_string(i), 1});
    row.push_back({fmt::format("{:.17g}", mean_of(*picture)), 1});
    table.rows.push_back(std::move(row));
    table.lines.push_back(asked.set_from ? frame.where.line : static_cast<int>(i) + 1);
  }
  if (table.rows.empty()) {
    if (first) reader.problems.add(*first);
    return std::nullopt;
  }
  constexpr std::size_t kShown = 3;
  for (std::size_t i = 0; i < std::min(left_out.size(), kShown); ++i)
    table.notes.push_back("A frame is left out: " + left_out[i] + ".");
  if (left_out.size() > kShown)
    table.notes.push_back(fmt::format("{} more frames are left out.", left_out.size() - kShown));
  return table;
}

}  // namespace birefit
