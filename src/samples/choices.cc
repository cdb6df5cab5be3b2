#include "samples/choices.h"

#include <algorithm>
#include <functional>
#include <utility>

namespace birefit {

const SampleChoices& choices(const RenderPlan& plan) {
  static const SampleChoices none;
  return plan.own ? *plan.own : none;
}

SampleChoices& choices(RenderPlan& plan) {
  if (!plan.own || plan.own.use_count() > 1) plan.own = std::make_shared<SampleChoices>(choices(std::as_const(plan)));
  return const_cast<SampleChoices&>(*plan.own);  // this plan's alone, and made as one that may be written
}

bool has_finer_tables(const SampleChoices& now, const SampleChoices& before) {
  return now.radial_panels > before.radial_panels || now.centre_panels > before.centre_panels ||
         !std::equal(now.part_panels.begin(), now.part_panels.end(), before.part_panels.begin(),
                     before.part_panels.end(), std::less_equal<>());
}

}  // namespace birefit
