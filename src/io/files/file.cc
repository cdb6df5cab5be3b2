#include "io/files/file.h"

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <string_view>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "birefit/io.h"

namespace birefit {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail_to_write(const fs::path& path, int error) {
  std::string hint;
  switch (error) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      hint = "free some space or choose another folder";
      break;
    case EACCES:
    case EPERM:
    case EROFS:
      hint = "choose a folder you may write to";
      break;
    case ENOENT:
    case ENOTDIR:
      hint = "create the folder first, or choose another one";
      break;
    case ENAMETOOLONG:
      hint = "choose a shorter name";
      break;
    default:
      break;
  }
  throw UserError({path.string()}, std::string("cannot be written: ") + std::strerror(error), hint);
}

/// Returns 0, or errno of the first call that failed. Short writes are continued, close() is checked: network file
/// systems report a full disk only there.
int write_all(int descriptor, std::string_view content) {
  int error = 0;
  while (!content.empty() && error == 0) {
    const ssize_t written = ::write(descriptor, content.data(), content.size());
    if (written > 0)
      content.remove_prefix(static_cast<std::size_t>(written));
    else if (written == 0)
      error = ENOSPC;
    else if (errno != EINTR)
      error = errno;
  }
  if (::close(descriptor) != 0 && error == 0) error = errno;
  return error;
}

std::atomic<int> g_writing{0};  ///< calls that have temporary files
std::atomic<int> g_ending{0};   ///< the signal that is to end the program; 0 = none
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may touch nothing else");

void die(int signal) {
  std::signal(signal, SIG_DFL);
  ::raise(signal);
}

/// While one lives there are temporary files, and a signal's end waits for it.
class Writing {
 public:
  Writing() {
    ++g_writing;
    if (g_ending == 0) return;
    leave();
    for (;;) ::pause();  // others write still: the last of them ends the program
  }
  ~Writing() { leave(); }
  Writing(const Writing&) = delete;
  Writing& operator=(const Writing&) = delete;

 private:
  static void leave() {
    if (--g_writing == 0 && g_ending != 0) die(g_ending);
  }
};

/// A file under its temporary name; removed unless renamed.
class PendingFile {
 public:
  explicit PendingFile(const fs::path& path) : path_(path) {
    std::error_code code;
    // A link keeps pointing at its target: the target is replaced.
    if (fs::is_symlink(fs::symlink_status(path, code)))
      if (fs::path target = fs::canonical(path, code); !code) path_ = target;
  }
  PendingFile(PendingFile&& other) noexcept
      : path_(std::move(other.path_)), temporary_(std::exchange(other.temporary_, {})) {}
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;
  ~PendingFile() {
    std::error_code code;
    if (!temporary_.empty()) fs::remove(temporary_, code);
  }

  void write(const std::string& content) {
    std::error_code code;
    const fs::file_status status = fs::status(path_, code);
    if (fs::is_directory(status)) fail_to_write(path_, EISDIR);
    if (fs::exists(status) && !fs::is_regular_file(status)) {
      // A pipe or a device (/dev/stdout) has nothing to rename over.
      const int descriptor = ::open(path_.c_str(), O_WRONLY | O_CLOEXEC);
      if (descriptor < 0) fail_to_write(path_, errno);
      if (const int error = write_all(descriptor, content)) fail_to_write(path_, error);
      return;
    }
    // Renaming would replace a file its owner has protected.
    if (fs::exists(status) && ::access(path_.c_str(), W_OK) != 0) fail_to_write(path_, errno);
    static std::atomic<unsigned> counter{0};
    const fs::path temporary =
        path_.parent_path() / ("." + path_.filename().string().substr(0, 200) + "." + std::to_string(::getpid()) + "." +
                               std::to_string(counter++) + ".part");
    const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor < 0) fail_to_write(path_, errno);
    temporary_ = temporary;
    if (const int error = write_all(descriptor, content)) fail_to_write(path_, error);
  }

  void rename() {
    if (temporary_.empty()) return;
    if (::rename(temporary_.c_str(), path_.c_str()) != 0) fail_to_write(path_, errno);
    temporary_.clear();
  }

 private:
  fs::path path_;
  fs::path temporary_;
};

}  // namespace

void write_files(const std::vector<FileContent>& files, const std::vector<fs::path>& outdated) {
  const Writing writing;
  std::vector<PendingFile> pending;
  pending.reserve(files.size());
  for (const FileContent& file : files) pending.emplace_back(file.path).write(file.content);
  std::error_code ignored;
  for (const fs::path& path : outdated) fs::remove(path, ignored);
  for (PendingFile& file : pending) file.rename();
}

void write_file(const std::filesystem::path& path, const std::string& content) { write_files({{path, content}}); }

std::string encode_image(const Image& image, const std::filesystem::path& path, double pixel_size_um) {
  return encode_channels({&image, 1}, path, pixel_size_um);
}

void save_image(const Image& image, const std::filesystem::path& path) { write_file(path, encode_image(image, path)); }

void end_by_signal(int signal) {
  g_ending = signal;
  if (g_writing == 0) die(signal);
}

}  // namespace birefit
