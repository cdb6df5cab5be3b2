#pragma once
// How far two answers of transport may lie apart in a picture, whatever the polarizers.

#include "core/jones.h"

namespace birefit {

/// Largest change of any polarizer-analyser intensity between two Jones matrices, whose common phase does not matter.
double intensity_distance(const Mat2<double>& a, const Mat2<double>& b);
/// The same of two retarders, as which one and its negative are the same: 2 |difference|.
double intensity_distance(const Su2<double>& a, const Su2<double>& b);

}  // namespace birefit
