#pragma once
// The picture that a config describes, in all of its colours.

#include <vector>

#include "birefit/io.h"

namespace birefit {

/// The scenes whose pictures make a config's: one, or one a colour.
inline std::vector<const Scene*> scenes_of(const Config& config) {
  std::vector<const Scene*> scenes;
  for (const Scene& scene : config.colours) scenes.push_back(&scene);
  if (scenes.empty()) scenes.push_back(&config.scene);
  return scenes;
}

/// What a fit demands of its pictures, and what they may leave out that is no fit's.
Demand demand_of_picture(const Config& config);

/// A plan for each of them at theta; throws UserError like plan().
std::vector<RenderPlan> plans_of(const Config& config, const Theta& theta);

/// The picture by these plans, a rendering a colour. `active`, `threads`: as of render().
std::vector<Rendering> render_config(const Config& config, const std::vector<RenderPlan>& plans, const Theta& theta,
                                     const std::vector<int>& active = {}, int threads = 0);

}  // namespace birefit
