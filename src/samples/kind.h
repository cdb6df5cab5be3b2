#pragma once
// Every kind of sample by what it can do. A new one is a folder here, its struct in birefit/sample.h and a line in
// kinds.def.

#include <optional>

#include "samples/jones_table.h"
#include "samples/pilots.h"
#include "samples/planning.h"

namespace birefit {

class Zone;          // samples/zone.h
struct SampleWaves;  // samples/waves/object.h

/// What a fit may know of a sample without knowing its kind.
struct Traits {
  /// Of a sphere, which is seen as a disc about the view's centre; empty: it is none.
  ParameterRef sphere_diameter_um = {};
  /// Of what is seen as a disc about the view's centre, spheres among it: its diameter, and from where its patterns
  /// count azimuths; not given: 90.
  struct Round {
    ParameterRef diameter_um, from_deg;
  };
  std::optional<Round> round = {};
  bool even = false;   ///< the picture is one number wherever the light is even
  bool quick = false;  ///< and costs microseconds: no field has to be found for it
  bool directions = false;  ///< the picture is one of directions, not of places: its fringes are those of a cone
  /// Parts of it next to each other tell the same, rows or columns of the picture.
  enum class Strips { none, rows, columns } strips = Strips::none;
  /// Axes turn from place to place: dark lines between linear polarizers hide what quarter-wave plates show.
  bool isoclinics = false;
};

/// How the light of a condenser makes a picture.
enum class ManyDirections {
  never,     ///< it is not modelled: SampleKind's planner says what that may change
  summed,    ///< as a sum of pictures, one a direction
  by_sample  ///< the picture of the axis' direction is that of all of them
};

struct SampleKind {
  const char* name;
  bool (*is)(const Scene&, const Observable&);
  /// By rays; waves are planned by samples/waves for all kinds that have them.
  RenderPlan (*plan)(const Planning&);
  /// The rays on which transport methods are judged; null: closed forms, nothing to choose.
  Pilots (*pilots)(const Scene&, const Demand&, const Values<double>&) = nullptr;
  /// Retardances at points fixed relative to the sample (rad): how fast fringes go by a parameter.
  std::vector<double> (*phases_rad)(const Scene&, const Values<double>&);
  /// Adds to a plan what holds of the sample by whatever physics; may be null.
  void (*note)(const Scene&, const Values<double>&, RenderPlan&) = nullptr;
  /// Null: one closed formula a pixel, no table of matrices.
  void (*jones)(const Scene&, const RenderPlan&, const Values<double>&, JonesTable&) = nullptr;
  /// Whether pictures may have a symmetry; null: none has.
  bool (*symmetric)(const Scene&) = nullptr;
  /// Whether the picture by this plan is a sum over wavelengths of itself, where that costs less than so many pictures:
  /// made by a BeamMaker with a rule; null: never.
  bool (*sums_wavelengths)(const Scene&, const RenderPlan&, const Theta&) = nullptr;
  /// Of a picture by this plan; null: never.
  ManyDirections (*directions)(const Scene&, const RenderPlan&) = nullptr;
  bool sums_line = false;    ///< knows Microscope::bandwidth_nm in closed form
  bool passes_axis = false;  ///< rays run along the optic axis somewhere: no transport in the modes' slow solutions
  /// Whether either mode can run on a ray of its own (Rays::eikonal); null: never.
  bool (*curved_rays)(const Scene&) = nullptr;
  const SampleWaves* waves = nullptr;        ///< null: no wave optics
  Traits (*traits)(const Scene&) = nullptr;  ///< null: nothing to say
  /// What a fit leaves out of a picture; null: nothing.
  std::unique_ptr<Zone> (*zone)(const Scene&, const Theta&) = nullptr;
  /// References to the temperatures that its indices are computed at, if they are its own; null: the material's.
  std::vector<ParameterRef> (*temperatures)(const Scene&) = nullptr;
};
/// The first kind of kinds.def that it is.
const SampleKind& kind_of(const Scene& scene, const Observable& observable = {});

Traits traits_of(const Scene& scene);
/// The references to temperatures that the indices of this scene are computed at.
std::vector<ParameterRef> temperatures(const Scene& scene);

/// What is seen of the scene in the light of one direction, `plan` of the same scene; by a scalar for tables only where
/// the plan has tables. The maker must outlive the image.
template <class S>
std::unique_ptr<SampleImage<S>> make_image(const Scene&, const RenderPlan&, const Values<S>&, const BeamMaker&);

/// The kind is that of a scene whose sample is of this type.
template <class Sample>
bool is_sample(const Scene& scene, const Observable&) {
  return std::holds_alternative<Sample>(scene.sample);
}
inline bool always(const Scene&) { return true; }

}  // namespace birefit
