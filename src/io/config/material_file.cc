#include "io/config/material_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <system_error>

#include "io/config/reader.h"
#include "io/files/table.h"

namespace birefit {
namespace {

constexpr std::uintmax_t kMaxBytes = 4u << 20;

struct Rows {
  std::vector<double> wavelength_um;
  std::vector<std::vector<double>> columns;
};

class MaterialReader {
 public:
  explicit MaterialReader(Problems& problems) : problems_(problems) {}

  MaterialFile read(const YamlNode& tree) {
    const YamlNode* data = tree.find("DATA");
    if (!data || !data->is_sequence() || data->items.empty()) {
      problems_.add(tree.where, "has no DATA list", "expected a material file of refractiveindex.info");
      return {};
    }
    for (const YamlNode& item : data->items) read_item(item);
    if (problems_.empty() && !real_)
      problems_.add(data->where, "gives no real index", "`tabulated k` alone says nothing about retardance");
    if (const YamlNode* conditions = tree.find("CONDITIONS"))
      if (const YamlNode* t = conditions->find("temperature"); t && t->is_scalar())
        file_.temperature_k = parse_number(t->text);
    return file_;
  }

 private:
  void read_item(const YamlNode& item) {
    const YamlNode* type = item.find("type");
    if (!type || !type->is_scalar()) {
      problems_.add(item.where, "an item of DATA needs a type");
      return;
    }
    const std::string& name = type->text;
    if (name == "tabulated k") {
      absorption(rows(item, 1), 0);
      return;
    }
    if (real_) {
      problems_.add(type->where, "gives the real index twice");
      return;
    }
    real_ = true;
    if (name == "tabulated n" || name == "tabulated nk") {
      const Rows r = rows(item, name == "tabulated n" ? 1 : 2);
      if (r.wavelength_um.empty()) return;
      if (r.wavelength_um.size() < 2) problems_.add(item.where, "has one row only: nothing to interpolate");
      file_.law.form = Dispersion::Form::table;
      file_.law.wavelength_um = r.wavelength_um;
      file_.law.index = r.columns[0];
      file_.law.lower_um = r.wavelength_um.front();
      file_.law.upper_um = r.wavelength_um.back();
      if (name == "tabulated nk") absorption(r, 1);
      return;
    }
    for (int number = 1; number <= 9; ++number)
      if (name == "formula " + std::to_string(number)) {
        formula(item, number);
        return;
      }
    problems_.add(type->where, "unknown type " + type->describe(),
                  "known: formula 1 to 9, tabulated n, tabulated nk and tabulated k");
  }

  void absorption(const Rows& r, std::size_t column) {
    if (r.wavelength_um.empty()) return;
    file_.k_wavelength_um = r.wavelength_um;
    file_.k = r.columns[column];
  }

  void formula(const YamlNode& item, int number) {
    const YamlNode* range = item.find("wavelength_range");
    if (!range) range = item.find("range");  // files of older versions of the database
    const YamlNode* coefficients = item.find("coefficients");
    if (!range || !coefficients) {
      problems_.add(item.where, std::string("formula ") + std::to_string(number) + " needs " +
                                    (range ? "coefficients" : "wavelength_range"));
      return;
    }
    const std::vector<double> limits = numbers(*range);
    if (limits.size() != 2 || !(limits[0] > 0) || !(limits[1] > limits[0])) {
      problems_.add(range->where, "wavelength_range must be two growing wavelengths in um, found " + range->describe());
      return;
    }
    const std::vector<double> c = numbers(*coefficients);
    const std::size_t n = c.size();
    const bool fits = number == 4   ? n == 1 || n == 5 || (n >= 9 && n % 2 == 1)
                      : number == 7 ? n >= 3 && n <= 6
                      : number == 8 ? n == 4
                      : number == 9 ? n == 6
                                    : n % 2 == 1;
    if (!fits) {
      problems_.add(coefficients->where,
                    "formula " + std::to_string(number) + " cannot have " + std::to_string(n) + " coefficients");
      return;
    }
    file_.law.form = static_cast<Dispersion::Form>(number);
    file_.law.coefficients = c;
    file_.law.lower_um = limits[0];
    file_.law.upper_um = limits[1];
  }

  /// Numbers between blanks; anything else is a problem, and then there are none.
  std::vector<double> numbers(const YamlNode& node) {
    std::vector<double> values;
    std::istringstream words(node.is_scalar() ? node.text : "");
    for (std::string word; words >> word;) {
      const std::optional<double> value = parse_number(word);
      if (!value || !std::isfinite(*value)) {
        problems_.add(node.where, word.substr(0, 40) + " is no number");
        return {};
      }
      values.push_back(*value);
    }
    return values;
  }

  Rows rows(const YamlNode& item, std::size_t columns) {
    Rows r;
    const YamlNode* data = item.find("data");
    if (!data || !data->is_scalar()) {
      problems_.add(item.where, "a table needs data");
      return r;
    }
    std::vector<std::pair<double, std::vector<double>>> sorted;
    std::istringstream lines(data->text);
    int number = 0;
    for (std::string line; std::getline(lines, line);) {
      ++number;
      std::istringstream words(line);
      std::vector<double> values;
      std::string word;
      while (words >> word) {
        const std::optional<double> value = parse_number(word);
        if (!value || !std::isfinite(*value)) break;
        values.push_back(*value);
        word.clear();
      }
      if (values.empty() && word.empty()) continue;
      if (!word.empty() || values.size() != columns + 1 || !(values[0] > 0)) {
        // The place of a text block is that of its mark; its lines follow.
        problems_.add({data->where.file, data->where.line > 0 ? data->where.line + number : 0},
                      "must be a wavelength in um and " + std::to_string(columns) +
                          (columns == 1 ? " number" : " numbers") + ", found \"" + line.substr(0, 40) + "\"");
        return {};
      }
      sorted.emplace_back(values[0], std::vector<double>(values.begin() + 1, values.end()));
    }
    std::stable_sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    if (sorted.empty()) problems_.add(data->where, "the table is empty");
    r.columns.resize(columns);
    for (const auto& [wavelength, values] : sorted) {
      if (!r.wavelength_um.empty() && wavelength == r.wavelength_um.back()) {
        problems_.add(data->where, "the table has the wavelength " + show(wavelength) + " twice");
        return {};
      }
      r.wavelength_um.push_back(wavelength);
      for (std::size_t i = 0; i < columns; ++i) r.columns[i].push_back(values[i]);
    }
    return r;
  }

  Problems& problems_;
  MaterialFile file_;
  bool real_ = false;
};

}  // namespace

MaterialFile load_material_file(const std::filesystem::path& path, const Where& asked) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(path, code))
    throw UserError(asked, "no material file at " + path.string(), "expected a file of refractiveindex.info (YAML)");
  if (std::filesystem::file_size(path, code) > kMaxBytes)
    throw UserError(asked, path.string() + " is larger than 4 MB: no material file");
  std::ifstream stream(path, std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  if (!stream) throw UserError(asked, path.string() + " cannot be read");
  Problems problems;
  const YamlNode tree = parse_yaml(text, path.string(), problems);
  MaterialFile file = MaterialReader(problems).read(tree);
  problems.throw_if_any();
  return file;
}

}  // namespace birefit
