#include "io/files/whole_file.h"

#include <array>
#include <ctime>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <tuple>

#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>

namespace birefit {
namespace {

class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    if (!context_ || EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) != 1) throw std::bad_alloc();
  }
  void add(const char* bytes, std::size_t count) { EVP_DigestUpdate(context_.get(), bytes, count); }
  std::string text() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned size = 0;
    EVP_DigestFinal_ex(context_.get(), digest.data(), &size);
    std::string text;
    for (unsigned i = 0; i < size; ++i) text += fmt::format("{:02x}", digest[i]);
    return text;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

/// What a file is known by while nobody writes to it: device, inode, size, time of the last change (s, ns).
using Identity = std::tuple<std::uintmax_t, std::uintmax_t, std::intmax_t, std::intmax_t, std::intmax_t>;

/// Nothing of what is no regular file.
std::optional<Identity> identity_of(const std::filesystem::path& path) {
  struct stat status = {};
  if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  return Identity{status.st_dev, status.st_ino, status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
}

/// Was the last change long enough ago that another one would have another time?
bool is_settled(const Identity& identity) {
  constexpr std::intmax_t kCoarsest = 2;  // s: of FAT
  return std::time(nullptr) - std::get<3>(identity) > kCoarsest;
}

/// Calls piece(bytes, count) until the end; false where that was not reached.
template <class Piece>
bool read_pieces(const std::filesystem::path& path, const Piece& piece) {
  std::ifstream stream(path, std::ios::binary);
  std::array<char, 65536> buffer;
  while (stream.read(buffer.data(), buffer.size()) || stream.gcount() > 0)
    piece(buffer.data(), static_cast<std::size_t>(stream.gcount()));
  return stream.eof();
}

}  // namespace

std::string read_whole(const std::filesystem::path& path, std::uintmax_t most_mb, const Where& where,
                       const std::string& subject, const std::string& hint) {
  const std::string about = subject.empty() ? "" : subject + " ";
  const auto refuse_larger = [&](std::uintmax_t size) {
    if (size > most_mb << 20) throw UserError(where, about + fmt::format("is larger than {} MB", most_mb), hint);
  };
  std::error_code code;
  if (std::filesystem::is_regular_file(path, code)) refuse_larger(std::filesystem::file_size(path, code));
  std::string text;
  // A pipe has no size beforehand, so the limit is kept while reading too.
  const bool whole = read_pieces(path, [&](const char* bytes, std::size_t count) {
    text.append(bytes, count);
    refuse_larger(text.size());
  });
  if (!whole) throw UserError(where, about + "cannot be read");
  return text;
}

std::string sha256(const std::string& bytes) {
  Sha256 digest;
  digest.add(bytes.data(), bytes.size());
  return digest.text();
}

std::string sha256_of_file(const std::filesystem::path& path) {
  // A series asks for a stack, a mask and its calibration frames once a frame.
  static std::mutex mutex;
  static std::map<Identity, std::string> known;
  const std::optional<Identity> before = identity_of(path);
  if (before) {
    const std::lock_guard lock(mutex);
    if (const auto found = known.find(*before); found != known.end()) return found->second;
  }
  Sha256 digest;
  const bool whole = read_pieces(path, [&](const char* bytes, std::size_t count) { digest.add(bytes, count); });
  if (!whole) return {};
  const std::string text = digest.text();
  // Of a file that changed meanwhile nothing is remembered, nor of one so new that it may change within the clock's
  // step.
  if (before && before == identity_of(path) && is_settled(*before)) {
    const std::lock_guard lock(mutex);
    known.emplace(*before, text);
  }
  return text;
}

}  // namespace birefit
