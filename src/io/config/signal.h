#pragma once
// `signal:` of docs/configuration.md: a cell fitted to tables of signal against voltage.

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "io/config/frames.h"
#include "io/config/reader.h"
#include "io/files/table.h"

namespace birefit {

/// One table as the config describes it.
struct SignalItem {
  std::string file;                   ///< of the table, or the pattern of its frames
  std::optional<FramesAsked> frames;  ///< whose means are the table
  std::optional<PixelRect> roi;       ///< of the frames
  Where roi_where;
  Where where, file_where;
  std::string value_column;
  Quantity quantity = Quantity::intensity;
  /// What sets a parameter: scale times a column, plus a constant (273.15 for degrees Celsius).
  struct Column {
    std::string path, name;
    double scale = 1, plus = 0;
    Where where;
  };
  std::vector<Column> columns;
  /// Rows are taken where a column has this text, or a number from low to high.
  struct Only {
    std::string column, text;
    std::optional<std::array<double, 2>> range;
    Where where;
  };
  std::vector<Only> only;
  std::vector<std::pair<std::string, const YamlNode*>> set;
  std::vector<Where> set_where;
  int every = 1;
  std::optional<double> noise;
};

/// `signal:` as one table or a list of them; empty without the key.
std::vector<SignalItem> read_signals(ConfigReader& reader, const Block& root);

/// The table that an item names; nothing with a problem.
std::optional<TextTable> load_signal(ConfigReader& reader, const SignalItem& item);

/// A table's rows, each in `base` (the shared scene with what the table sets) but for what its columns set; `first`:
/// sights of the tables before it. `replace` gives a scene another reference for a parameter.
void append_signal(ConfigReader& reader, const SignalItem& item, const TextTable& text, std::size_t number,
                   const Picture& base, std::size_t first,
                   const std::function<void(Scene&, ParameterRef, ParameterRef)>& replace, Config& config,
                   std::vector<Readings>& tables);

}  // namespace birefit
