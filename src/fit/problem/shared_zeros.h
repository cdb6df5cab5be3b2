#pragma once
// What several frames state each for itself on one dial.

#include "birefit/fit.h"

namespace birefit::estimation {

/// The expression by which what others are tied to follows such a zero: no tie of the user's.
inline constexpr const char* kByZero = "its.zero + as.stated";
/// And of what is known to a share of it.
inline constexpr const char* kByScale = "its.scale * as.stated";

/// Whether a row of a table states the number for itself ("signal[1].row[3].sample.temperature_k").
bool is_of_row(const Parameter& stated);

/// Pictures at several angles, or rows at several temperatures, are read off one dial, whose zero is known no better
/// than one of its readings: where frames state numbers of their own that are known within a standard deviation
/// (Parameter::known_to.sd), what all of them are off by is a number of its own, stated as 0. Frames of their own
/// thickness, or whatever is known to a share of it (Parameter::known_to.share), and the wavelengths of a table's rows,
/// are read off one scale, a number of its own, stated as 1. Pictures at several wavelengths have a filter each, which
/// is one number where its value is. What is free or exact in some frames is left as it is there. A job without such
/// is as it was.
FitJob with_shared_zeros(FitJob job);
/// Whether that would change it.
bool has_own_dials(const FitJob& job);

}  // namespace birefit::estimation
