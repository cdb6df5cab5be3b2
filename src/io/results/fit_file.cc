#include "io/results/fit_file.h"

#include "io/files/whole_file.h"

namespace birefit {
namespace {

/// A table of ten thousand rows makes a fit.json of some 20 MB.
constexpr std::uintmax_t kLargestMb = 64;
/// The library's messages hold what was read last, however long that is.
constexpr std::size_t kLongestReason = 200;

}  // namespace

nlohmann::json read_fit_file(const std::filesystem::path& path, const Where& where) {
  const std::string file = path.string(), hint = "expected the fit.json of an earlier fit";
  std::error_code code;
  if (!std::filesystem::exists(path, code))
    throw UserError(where, file + " does not exist", "run the earlier fit first");
  if (!std::filesystem::is_regular_file(path, code)) throw UserError(where, file + " is not a file");
  const std::string text = read_whole(path, kLargestMb, where, file, hint);
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    throw UserError(where, file + " is not valid JSON: " + std::string(error.what()).substr(0, kLongestReason), hint);
  }
}

std::string checksum_of(nlohmann::json fit) {
  fit.erase("checksum");
  fit.erase("run");
  return sha256(fit.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace birefit
