#include "io/results/picture.h"

namespace birefit {

Demand demand_of_picture(const Config& config) {
  Demand demand = config.job.demand;
  demand.model_tolerance = config.model_tolerance;
  return demand;
}

std::vector<RenderPlan> plans_of(const Config& config, const Theta& theta) {
  std::vector<RenderPlan> plans;
  for (const Scene* scene : scenes_of(config))
    plans.push_back(plan(*scene, demand_of_picture(config), theta, config.observable));
  return plans;
}

std::vector<Rendering> render_config(const Config& config, const std::vector<RenderPlan>& plans, const Theta& theta,
                                     const std::vector<int>& active, int threads) {
  const std::vector<const Scene*> scenes = scenes_of(config);
  std::vector<Rendering> colours;
  for (std::size_t c = 0; c < scenes.size(); ++c)
    colours.push_back(render(*scenes[c], plans[c], theta, active, threads));
  return colours;
}

}  // namespace birefit
