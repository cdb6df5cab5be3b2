#pragma once
// A config as it is read, in stages. Private to load.cc and load_images.cc.

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "birefit/io.h"
#include "io/config/items.h"
#include "io/config/micrograph.h"
#include "io/config/pictures.h"
#include "io/config/reader.h"
#include "io/config/series.h"
#include "io/config/signal.h"
#include "io/config/ties.h"

namespace birefit {

/// What is asked for.
struct Asked {
  const std::filesystem::path& path;
  const std::string& text;
  const std::vector<std::string>& set;
  ConfigUse use;
  const std::optional<std::filesystem::path>& image;  ///< in place of the single micrograph's file
  const ImageSeries* series = nullptr;                ///< the micrograph is one of its frames
  std::size_t frame = 0;
  bool starts = true;  ///< else nothing is looked for in the image: enough to know that a config is sound
  const InMemory* in_memory = nullptr;
};

/// A config as it is read: first what it says, then what its images tell. Mistakes are collected on the way.
class Loading {
 public:
  /// `tied`: what tied numbers begin with, which is known once the config was read; null: it has to be read for that.
  Loading(const Asked& asked, const TieStarts* tied);

  /// All but images. What tied numbers begin with.
  TieStarts read();
  bool has_ties() const { return !reader_.ties.empty(); }

  /// With what the images tell. Throws UserError where anything was wrong.
  Config finish();

 private:
  // What the config says (load.cc).
  /// What every picture or row sets for itself need not be given for all.
  void note_set_everywhere();
  /// What all pictures and rows have in common.
  void read_shared();
  void refuse_second_analyzer();
  void read_size();
  /// The one image of `micrograph`, or the list's with the page that `micrograph` names.
  void place_items();
  void check_tables();
  void read_tables();
  /// A picture a colour, each with what its image sets for itself.
  void make_pictures();
  /// An image may have a focus of its own, which only waves know.
  void settle_own_focus();
  /// Without an image to look at there is only the view.
  bool is_view_only();
  /// A shared parameter that every image replaces by its own is no unknown of the fit.
  void drop_unused();

  // What images tell (load_images.cc).
  /// What belongs to all images of a fit: frames of calibration, one a colour, and the user's mask.
  struct Beside {
    std::vector<std::optional<Calibration>> calibrations;
    std::optional<LoadedMask> mask;
    bool missing = false;  ///< something of it cannot be read
  };
  /// What is made of the images.
  struct Taken {
    std::vector<Observable> observables;
    std::vector<std::vector<Picture>> filled;
    std::string of_colours;  ///< the first picture that is one colour of several
    std::string of_codes;    ///< the first photograph of which nothing says how codes follow light
  };
  void demand_pixel_size(const Scene& scene, const std::array<double, 2>& uneven_um = {});
  /// What is to be seen, without a fit: of a size that is stated, or of the image's.
  void take_view();
  void take_view_of_image(const Item& item, const std::string& name, Scene& scene);
  Beside load_beside();
  std::string name_of(const Item& item, const MicrographSettings& own, const std::filesystem::path& file) const;
  void take_image(std::size_t i, const Beside& beside, Taken& taken);
  void take_images();
  /// What is asked of the picture: where the sample is, how large.
  void find_starts(Picture& picture);
  void warn_of_colours(const Taken& taken);
  void make_measurements(Taken& taken);

  // What becomes of it (load.cc).
  void note_taken_as_exact();
  void hand_over();

  const Asked& asked_;
  Config config_;
  ConfigReader reader_;
  YamlNode tree_;
  Block root_;
  const YamlNode* list_ = nullptr;  ///< of micrographs
  TableNodes nodes_;
  std::vector<Item> items_;
  std::vector<SignalItem> signals_;
  Quantity quantity_ = Quantity::intensity;
  bool own_analyzers_ = false;  ///< the pixels of a polarization mosaic have one each
  Picture shared_;
  MicrographSettings settings_;
  std::vector<MicrographSettings> channels_;
  std::optional<std::array<int, 2>> size_;
  std::vector<Picture> micrographs_;
  std::vector<Readings> tables_;
  bool sound_ = true;  ///< nothing was wrong before images were looked at
};

}  // namespace birefit
