#include "samples/pilots.h"

#include <algorithm>

namespace birefit {

double Pilots::error(const TransportMethod<double>& method, const Mesh& mesh, double enough) const {
  // The ray that was too much for the last effort mostly is for the next.
  double worst = rays.empty() ? 0 : rays[hardest_](method, mesh);
  for (std::size_t i = 0; i < rays.size() && !(worst > enough); ++i)
    if (i != hardest_) {
      worst = std::max(worst, rays[i](method, mesh));
      if (worst > enough) hardest_ = i;
    }
  return worst;
}

Effort cheapest_effort(const Pilots& pilots, double target, const std::string& only, bool even_steps,
                       const std::string& but) {
  std::vector<int> ladder;
  for (int n = even_steps ? 2 : 1; n <= 8192; n += std::max(even_steps ? 2 : 1, n / 16 * 2)) ladder.push_back(n);
  // Breaks make several numbers of steps the same mesh, which would confirm itself.
  if (even_steps)
    ladder.erase(std::unique(ladder.begin(), ladder.end(),
                             [&](int a, int b) { return pilots.mesh(a).size() == pilots.mesh(b).size(); }),
                 ladder.end());
  std::vector<Effort> efforts;
  for (const TransportMethod<double>* method : transport_methods<double>()) {
    if (method->info().reflections || but == method->info().name || (!only.empty() && only != method->info().name))
      continue;
    // Samples grow by the same number with every step.
    const int at_8 = pilots.samples(*method, uniform_mesh(8)), at_16 = pilots.samples(*method, uniform_mesh(16));
    for (int n : ladder) {
      const int steps = static_cast<int>(pilots.mesh(n).size()) - 1;
      efforts.push_back({method, n, at_8 + (at_16 - at_8) * (steps - 8) / 8, 1e300});
    }
  }
  std::stable_sort(efforts.begin(), efforts.end(),
                   [](const Effort& a, const Effort& b) { return a.samples < b.samples; });
  Effort best;
  for (Effort& effort : efforts) {
    effort.error = pilots.error(*effort.method, pilots.mesh(effort.steps), target);
    if (effort.error <= target) {
      const auto finer = std::find_if(ladder.begin(), ladder.end(), [&](int n) { return n > effort.steps; });
      if (finer == ladder.end() || pilots.error(*effort.method, pilots.mesh(*finer), target) <= target) return effort;
    }
    if (effort.error < best.error) best = effort;
  }
  if (!best.method) return efforts.empty() ? best : efforts.back();  // none of them has an answer
  // Errors were cut short at the first ray beyond the target.
  best.error = pilots.error(*best.method, pilots.mesh(best.steps));
  return best;
}

}  // namespace birefit
