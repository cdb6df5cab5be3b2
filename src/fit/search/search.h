#pragma once
// The global part of a fit, from a start to the minima that the solver may begin with.

#include "fit/problem/frame.h"
#include "fit/search/scan.h"

namespace birefit::estimation {

/// Minima of the objective on the pixels that the search looked at.
struct Minima {
  Frames frames;  ///< planned where the search began: at the start, at the picture's own middle, or by waves at the
                  ///< best minimum
  Theta theta;    ///< there
  ScanResult scan;
  double rows = 0;      ///< pixels that were looked at
  int evaluations = 0;  ///< of pictures, all problems together
  bool stopped = false;
  /// No place that was looked at describes what there is to see, or is better than a constant image.
  bool hopeless = false;

  double lowest_per_pixel() const { return scan.candidates.front().objective / std::max(1.0, rows); }
};

/// Looks for minima on a grid, of wave pictures around those of rays. Ends early above `hopeless_above` per pixel:
/// another branch has beaten that.
Minima search(const Task& task, const Start& start, double hopeless_above);

/// The search for wave pictures, which are too dear for a grid. Rays know the fringe orders to within a few: from their
/// minima, and from the neighbouring orders of every parameter that forms fringes, with the wave model.
Minima search_near_rays(const Task& task, const Start& start);

}  // namespace birefit::estimation
