#pragma once
// Files as they appear in a folder, each when it is whole. Private to io and app.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace birefit {

/// Tells one state of a file from another and from other files, whatever they are called.
struct FileState {
  std::uint64_t device = 0, inode = 0, size = 0;
  std::int64_t changed_ns = 0;  ///< since the epoch
  friend auto operator<=>(const FileState&, const FileState&) = default;
};

/// A file that has stood still.
struct Arrival {
  std::string name;  ///< in the folder
  FileState state;
  std::string renamed_from;  ///< it was taken under this name, which is gone; else empty
  bool last_call = false;    ///< it could not be read and has not changed for a long time since
};

/// Offers the images of a folder, in the order of their last change, until each is taken. What is hidden, has another
/// ending than images, or is still being written is left alone. A file that changes after it was taken is offered
/// again.
class Arrivals {
 public:
  /// `patience`: seconds for which a file that cannot be read may stand still before its last call. Throws UserError
  /// where there is no such folder.
  Arrivals(std::filesystem::path folder, double patience);
  ~Arrivals();
  Arrivals(const Arrivals&) = delete;
  Arrivals& operator=(const Arrivals&) = delete;

  /// What is there to take; waits up to so many seconds for something to happen.
  std::vector<Arrival> next(double seconds);
  /// Not to be offered again as it is.
  void take(const std::string& name, const FileState& state);
  /// It could not be read: to be offered again when it has changed, or for a last call.
  void put_off(const Arrival& arrival);
  /// Whether the file is as it was when it was offered.
  bool is_still(const Arrival& arrival) const;

 private:
  struct Seen {
    FileState state;
    double since = 0;     ///< when it was first seen like that
    bool closed = false;  ///< its writer has closed it, or it came by a new name
    bool put_off = false;
    bool open = false;  ///< somebody has written to it and not closed it yet
  };
  void hear();
  void look(double now);

  const std::filesystem::path folder_;
  const double patience_;
  int listener_ = -1;  ///< inotify's; < 0: none, the folder is looked at again and again
  std::map<std::string, Seen> seen_;
  std::map<std::string, FileState> taken_;
};

}  // namespace birefit
