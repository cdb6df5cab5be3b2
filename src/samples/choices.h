#pragma once
// What a kind of sample chooses for itself in a plan: where its light is smooth enough to be tabulated, and how finely.
// Its planner writes it and its picture reads it; others may only ask whether one plan
// resolves more than another.

#include <cstdint>
#include <vector>

#include "birefit/plan.h"

namespace birefit {

/// A part of a droplet's disc (samples/tables/polar_table.h), of 4 x 2^level panels from the rim inwards and 8 x
/// 2^level sectors around.
struct DiscSquare {
  /// of the disc as which a shell's core is seen: the light that passes through it; the others' passes beside it
  bool of_core = false;
  int level = 0, panel = 0, sector = 0;
  int steps = 1;        ///< mesh steps of its rays
  bool smooth = false;  ///< its light is interpolated from a few rays
  double points = 0;    ///< of the picture in it
};

struct SampleChoices {
  // Round samples whose light depends on the radius and a turn:
  int radial_panels = 0;  ///< of the table over the radius; 0 = one ray a point
  int centre_panels = 0;  ///< of its innermost part
  /// curved rays: of each part between places where light begins or ends; radial_panels is the most
  std::vector<int> part_panels;
  double series_reach_um = 0;  ///< > 0: the exact series, tabulated out to this image radius
  /// Droplets that look different from all sides: all of the disc, in squares that have their own steps. Empty: the
  /// plan's everywhere.
  std::vector<DiscSquare> disc;
  /// Layers: which squares of so many pixels (a multiple of 8) have their fringes interpolated from a few rays
  /// (samples/tables/fringe_table.h); 0 = none.
  int fringe_block_px = 0;
  std::vector<std::uint8_t> fringe_blocks;
};

/// Of a plan, its own to read, and to write: a copy that shares with others gets one for itself.
const SampleChoices& choices(const RenderPlan& plan);
SampleChoices& choices(RenderPlan& plan);

/// A table of `now` is finer than that of `before`; squares of a disc are compared by outgrown_disc().
bool has_finer_tables(const SampleChoices& now, const SampleChoices& before);

}  // namespace birefit
