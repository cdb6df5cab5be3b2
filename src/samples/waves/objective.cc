#include "samples/waves/objective.h"

#include <fmt/format.h>

#include "birefit/error.h"

namespace birefit {

void check_objective(const Scene& scene, const Values<double>& value, double n_host) {
  const double na = value.get(scene.microscope.objective_na, 0.0);
  if (!(na > 0))
    throw UserError(Where{}, "ceiling: wave needs microscope.objective_na",
                    "the number engraved on the objective; without it use ceiling: one_way");
  if (na > n_host)
    throw UserError(
        Where{},
        fmt::format("microscope.objective_na {:g} is above the surround's index {:g}: no light leaves it so steeply",
                    na, n_host),
        "check objective_na and sample.surround");
}

}  // namespace birefit
