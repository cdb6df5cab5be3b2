#include "samples/planning.h"

#include <cmath>

#include <fmt/format.h>

#include "birefit/error.h"

namespace birefit {

std::string sci(double x) { return fmt::format("{:.1e}", x); }

std::string effort_text(const std::string& method, int steps) {
  return fmt::format("{} {}", steps, method == "diagonal" ? "Gauss nodes" : "steps");
}

void check_closed_form(const Demand& demand, const std::string& what) {
  if (demand.method != "auto" && demand.method != "diagonal")
    throw UserError(Where{}, fmt::format("transport method '{}' does not apply to {}", demand.method, what),
                    "leave transport.method at auto");
}

void sample_by_radius(RenderPlan& plan, double center_x, double center_y, double bins,
                      const std::function<int(double)>& points) {
  plan.means.center_x_px = center_x;
  plan.means.center_y_px = center_y;
  plan.means.bin_px = 1;
  plan.means.samples.clear();
  for (int i = 0; i < bins; ++i) plan.means.samples.push_back(points(i + 0.5));
}

double reflectance(double n1, double n2) { return square((n1 - n2) / (n1 + n2)); }

}  // namespace birefit
