#pragma once
// The kinds of samples that `birefit new` knows: the words people use for them, a commented config, and what the
// picture of its demonstration is made of.

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "birefit/image.h"

namespace birefit {

/// A picture of a demonstration: the config with `set`, as `--set` has it.
struct DemoPicture {
  std::string file;
  std::vector<std::string> set;
  bool dark = false;  ///< light blocked: a calibration frame
};

struct Kind {
  std::string name;
  std::string words;            ///< what people call it, separated by commas
  std::string config;           ///< runs as it is beside its pictures
  std::string command;          ///< "fit", ..: what to run it with
  int width = 0, height = 0;    ///< of the pictures, px
  double gain = 0, offset = 0;  ///< counts, of an intensity of 1 and of none
  std::vector<std::pair<std::string, double>>
      truth;  ///< what the pictures are made with, by path, where the config has other starts
  std::vector<DemoPicture> pictures;
  std::vector<std::pair<std::string, std::string>> files;  ///< others that the config names: name, content
};

const std::vector<Kind>& kinds();

/// Intensities that the kind's config makes with its truth in place of its starts and `set` of `--set`. `config`: where
/// it is, or would be: files that it names are looked for beside it. Throws UserError where one is not there.
Image picture_of(const Kind& kind, const std::filesystem::path& config, int width, int height,
                 const std::vector<std::string>& set);

}  // namespace birefit
