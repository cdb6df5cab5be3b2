#include "io/config/pages.h"

#include <algorithm>
#include <iterator>
#include <vector>

#include <fmt/format.h>

namespace birefit {
namespace {

using Place = std::optional<int>;

/// What a choice and a page have in common: the name of an axis, and where along it.
template <class What>
void for_each_axis(What&& what) {
  what("t", &PageChoice::t, &StackPage::t);
  what("z", &PageChoice::z, &StackPage::z);
  what("c", &PageChoice::c, &StackPage::c);
}

/// "4 pages, t 0 to 3".
std::string describe(const std::vector<StackPage>& pages) {
  std::string text = pages.size() == 1 ? "1 page" : std::to_string(pages.size()) + " pages";
  for_each_axis([&](const char* name, Place PageChoice::*, Place StackPage::*is) {
    int first = (pages[0].*is).value_or(0), last = first;
    for (const StackPage& page : pages) {
      first = std::min(first, (page.*is).value_or(0));
      last = std::max(last, (page.*is).value_or(0));
    }
    if (last > first) text += fmt::format(", {} {} to {}", name, first, last);
  });
  return text;
}

}  // namespace

bool PageChoice::lets_through(const StackPage& page) const {
  bool all = !number || *number == page.number.value_or(0);
  for_each_axis([&](const char*, Place PageChoice::*wanted, Place StackPage::*is) {
    if (this->*wanted && *(this->*wanted) != (page.*is).value_or(0)) all = false;
  });
  return all;
}

std::string PageChoice::words() const {
  std::string text = number ? "page " + std::to_string(*number) : "";
  for_each_axis([&](const char* name, Place PageChoice::*wanted, Place StackPage::*) {
    if (this->*wanted) text += (text.empty() ? "" : ", ") + std::string(name) + " " + std::to_string(*(this->*wanted));
  });
  return text;
}

PageChoice read_page(ConfigReader& reader, const Block& block) {
  constexpr int kMost = 100000;
  PageChoice choice;
  const YamlNode* node = block.find("page");
  choice.where = node ? node->where : block.where;
  if (!node || !node->is_map()) {
    choice.number = reader.integer(block, "page", 0, kMost);
    return choice;
  }
  const Block places = reader.block(block, "page", {"t", "z", "c"}, true);
  for_each_axis([&](const char* name, Place PageChoice::*wanted, Place StackPage::*) {
    choice.*wanted = reader.integer(places, name, 0, kMost);
  });
  if (places.node && node->entries.empty()) reader.missing(places, "t, z or c", "or give the page's number");
  return choice;
}

bool settle_page(ConfigReader& reader, const std::filesystem::path& file, PageChoice& choice) {
  std::error_code code;
  if (!choice.places() || !std::filesystem::is_regular_file(file, code))
    return true;  // the reader says what is missing
  const std::vector<StackPage> pages = stack_pages(file);
  std::vector<StackPage> chosen;
  std::copy_if(pages.begin(), pages.end(), std::back_inserter(chosen),
               [&](const StackPage& page) { return choice.lets_through(page); });
  const std::string name = file.filename().string();
  if (chosen.empty())
    reader.problems.add(choice.where, name + " has no page at " + choice.words() + ": it has " + describe(pages),
                        "t, z and c count from 0, and are known from ImageJ's or OME's metadata");
  if (chosen.size() > 1)
    reader.problems.add(choice.where,
                        name + " has several pages at " + choice.words() + ": of these, " + describe(chosen),
                        "state the others of t, z and c; micrographs: {files: ..} takes all");
  if (chosen.size() != 1) return false;
  choice = {chosen[0].number, {}, {}, {}, choice.where};
  return true;
}

}  // namespace birefit
