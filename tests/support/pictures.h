#pragma once
// The pictures and tables of a fit's job.

#include "birefit/fit.h"

namespace birefit {

inline Picture& picture(FitJob& job, std::size_t i) { return std::get<Picture>(job.measurements.at(i)); }
inline const Picture& picture(const FitJob& job, std::size_t i) { return std::get<Picture>(job.measurements.at(i)); }
inline const Readings& readings(const FitJob& job, std::size_t i) { return std::get<Readings>(job.measurements.at(i)); }

}  // namespace birefit
