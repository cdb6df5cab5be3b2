#pragma once
// What is in a picture beside its object, and a fit without it.

#include <vector>

#include "fit/search/optimum.h"

namespace birefit::estimation {

/// chi-square beyond what noise makes of a fit's pixels.
double excess_of(const Optimum& optimum);
/// A fit without some pixels is the better one where less is left over by at least a fifth.
bool is_worth_leaving_out(double excess_before, double excess_after);

/// Most of what is left over lies in specks that `outliers: leave_out` would leave out.
bool are_specks_most(const Task& task, const Optimum& optimum);

/// Jobs with fewer pixels, of one picture of a round sample: without specks, as `outliers: leave_out` does, and of a
/// sphere without all outside of it (a field stop, a neighbour, light that is reflected), where so much of what is left
/// over lies there that the fit may be worth it.
std::vector<FitJob> narrower_jobs(const Task& task, const Optimum& optimum);

}  // namespace birefit::estimation
