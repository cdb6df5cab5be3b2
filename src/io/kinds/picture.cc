// What a kind of sample looks like.

#include <fmt/format.h>

#include "birefit/io.h"
#include "birefit/render.h"
#include "io/kinds/kinds.h"

namespace birefit {

Image picture_of(const Kind& kind, const std::filesystem::path& config, int width, int height,
                 const std::vector<std::string>& more) {
  std::vector<std::string> set = {fmt::format("image_size_px=[{}, {}]", width, height),
                                  "micrograph.image=", "micrographs=", "calibration=", "signal="};
  for (const auto& [path, value] : kind.truth) set.push_back(fmt::format("{}={}", path, value));
  set.insert(set.end(), more.begin(), more.end());
  const Config loaded = load_config_text(kind.config, config, ConfigUse::render, std::nullopt, set);
  const Theta theta = loaded.job.parameters.values();
  return render(loaded.scene, plan(loaded.scene, loaded.job.demand, theta), theta).intensity;
}

}  // namespace birefit
