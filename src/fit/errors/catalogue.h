#pragma once
// What pictures are known to depart from models by, fitted all at once where something is left over.

#include <string_view>

#include "fit/errors/stated.h"
#include "fit/search/optimum.h"

namespace birefit::estimation {

/// Whether a departure of that name is asked for (FitOptions::not_asked).
bool is_asked(const FitOptions& options, std::string_view departure);

/// Whether noise does not explain what a fit of one picture of a sphere or disc leaves over, or of several of a sphere
/// in one gain, while the model misses less than a tenth of their contrast: then the catalogue is asked. Where noise
/// does explain it, the optimum says so from then on. Of several exposures of a bar it is asked by chi-square alone,
/// whatever they miss: there it has to explain nearly all.
bool asks_catalogue(const Task& task, Optimum& optimum);
/// By what is missed of the contrast (missed_of_contrast) without and with the catalogue: what missed more than a
/// fiftieth is not nearly the picture's model, but other physics or another director, unless nearly all of it is
/// explained.
bool believes_catalogue(double missed_before, double missed_after);

/// The job with a nuisance for each: light and background that are uneven, the blur of lenses and resampling, a camera
/// that is not linear, pixels out of square (of a bar light and camera alone, and charge that the job does not have),
/// each with a prior of the size that such departures have (docs/methods.md, "Nearly the model"); and what is stated
/// and not known exactly, as far as the pictures tell it. No single one is selected: an explanation that fits makes an
/// interval narrow, right or wrong.
FitJob with_catalogue(const Task& task, const Optimum& optimum);

/// What of the catalogue's terms leaves no trace: where pixels are out of square, which of their sides is the one that
/// is stated, so that the size is uncertain by as much. A standard deviation of every unknown, with its sign; empty
/// where there is none. `covariance` by the problem's weights.
Eigen::VectorXd shift_by_aspect(const Task& task, const Optimum& optimum, const Eigen::MatrixXd& covariance);

/// What the catalogue's terms came out as; `task` is of a job with_catalogue.
std::vector<Departure> departures_of(const Task& task, const FitResult& result);

}  // namespace birefit::estimation
