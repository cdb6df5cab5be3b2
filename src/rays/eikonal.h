#pragma once
// Curved rays through droplets whose director lies in the meridional plane: the hedgehog, the shell around a core in
// its middle, and the droplet in a field along the view (docs/methods.md, "Curved rays").

#include <memory>
#include <optional>
#include <vector>

#include "medium/families/axial.h"
#include "rays/sphere_ray.h"
#include "transport/by_lane.h"

namespace birefit {

/// Radial droplets without twist, shells whose core is in the middle, droplets in a field along the view.
bool rays_stay_meridional(const Droplet& droplet);

/// A droplet in units of its radius and of its ordinary index. Radial (a shell where core > 0) unless there is a field.
template <class T>
struct MeridionalDroplet {
  T host, extraordinary;                 ///< indices over n_o
  T core = T(0.0), core_index = T(1.0);  ///< radius and index of an isotropic core
  /// Derivatives of T: by host, extraordinary, and core and core_index or e and ring. The field's own: by the latter
  /// two.
  std::shared_ptr<const AxialField<std::conditional_t<std::is_same_v<T, double>, double, Dual<double, 2>>>> field =
      nullptr;
};

/// A ray that came in along the view, where it leaves the droplet; lengths in radii, optical paths in radii times n_o.
template <class T>
struct MeridionalRay {
  T exit_rho, exit_z;  ///< from the centre, z along the view
  T turn_rad;          ///< from the view, > 0 away from the axis
  /// distance of the outgoing line from the centre, > 0 where it seems to come from the side on which the ray came in
  T impact;
  T path;               ///< optical path inside
  T flux;               ///< share that all surfaces pass: 4 Y1 Y2 / (Y1 + Y2)^2 each, Y the wave admittances
  bool arrives = true;  ///< false: totally reflected, turned by 80 degrees and more, or caught
};

/// The ray that meets the sphere under the angle of incidence psi (rad, < pi/2). T = double or Dual<double, 4>.
///
/// Where the axis is radial this is closed: L = r times the tangential wavevector is conserved, to an extraordinary ray
/// the hedgehog is a cone (Satiro & Moraes, Eur. Phys. J. E 20, 173 (2006)) on which the polar angle turns n_o/n_e
/// times as fast: from the sphere to a distance r it turns by (n_o/n_e) [acos(L / n_e) - acos(L / (n_e r))] on an
/// optical path n_o [sqrt(1 - (L/n_e)^2) - sqrt(r^2 - (L/n_e)^2)]; the ordinary ray likewise with n_o for n_e. A ray
/// that meets the core goes straight through it, refracted with the same L; where it is totally reflected there it
/// counts as lost.
///
/// In a field the extraordinary ray obeys Hamilton's equations of H = w^2 + (n_e^2 - 1) (n.w)^2 - n_e^2, w the
/// wavevector: the geodesics of n_e^2 I - (n_e^2 - 1) n n. Boost.Odeint, Dormand-Prince, each step to 1e-8. `equator`,
/// where given, becomes the distance from the axis at which such a ray crosses the plane z = 0, if it does.
template <class T>
MeridionalRay<T> meridional_ray(const MeridionalDroplet<T>& droplet, bool extraordinary, const T& psi,
                                T* equator = nullptr);

/// Field of one mode at an image radius when it runs on its own rays.
template <class S>
struct EikonalRay {
  S amplitude;           ///< surface transmissions and ray tube included, 0 where no ray arrives
  S phase_rad;           ///< common part left out
  S sin_turn, cos_turn;  ///< of the angle between ray and view behind the droplet
};

/// All rays of one mode: a fan over the angle of incidence, traced once and read at any image radius.
///
/// Of several rays that are seen in one place the one that entered farthest from the axis counts: beside a shell's
/// core, not through it; never one that has crossed the axis. Towards the axis, where a defect in a field sends light
/// from all around, tubes of rays narrow without bound; at a radius rho they are taken as wide as at (rho^4 +
/// b^4)^(1/4), b where the ray entered that is seen on the axis.
template <class S>
class EikonalFan {
 public:
  /// objective_na 0: all rays that leave.
  EikonalFan(const DropletOptics<S>&, bool extraordinary, const S& objective_na);
  /// rho_um in the mid plane, where the ray's backward extension meets it.
  EikonalRay<S> at(const S& rho_um) const;
  int rays() const { return rays_; }  ///< that were traced
  /// of the polynomials, by their two highest coefficients; in radii times n_o
  double path_error() const { return path_error_; }
  /// Image radii where light of this mode begins, ends or jumps: rims, the core's edge, the objective's aperture, the
  /// shadow of a ring; where rays turn too far or fold, the last panel that polynomials follow. Same in all lanes; in
  /// no order.
  const std::vector<S>& ends_um() const { return ends_um_; }

 private:
  static constexpr int kShape = 4;  ///< numbers that shape rays: both indices, and core and its index or field and ring
  using One = decltype(lane_of(std::declval<S>(), 0));
  using T = std::conditional_t<ScalarTraits<S>::derivatives == 0, double, Dual<double, kShape>>;
  static constexpr std::size_t kPlanes = 1 + static_cast<std::size_t>(ScalarTraits<T>::derivatives);
  static constexpr int kPoints = 12;
  enum Function : std::size_t { kRatio, kPath, kTurn, kFlux, kFunctions };  ///< kRatio: image radius over sin psi
  /// Between two rays, u from 0 at `high` to 1 at `low`. The ends move with the parameters.
  struct Piece {
    T low, high;
    /// rim: psi = high - (high - low) u^2, in which what ends like a root at `high` is smooth. axis: psi = high (low /
    /// high)^u, steps as long as psi is large, where psi = 0 is a singular point beyond `low`.
    enum class Map { rim, axis } map = Map::rim;
    bool jumps = false;  ///< at `high`: rays do not go on from those of the piece before, though it ends there
    T psi(double u) const;
    T by_u(double u) const;
    double bend(double u) const;  ///< second derivative
  };
  struct Panel {
    Piece piece;
    double middle, half;               ///< of u; x in [-1, 1] runs over the panel, inwards
    double outer, inner;               ///< image radii of its ends
    std::vector<double> coefficients;  ///< [plane][function][power of x]
    struct Place {
      double rho, by_x;
    };
    Place place(double x) const;
  };
  void find_ends();
  struct Slope {
    One value, slope;
  };
  Slope function_at(const Panel&, Function, double x) const;  ///< and its slope by x, both with derivatives at fixed x
  MeridionalRay<T> traced(const T& psi);
  /// How large the two highest Chebyshev coefficients may be, relative where a function is above one, and how often a
  /// piece is halved for it. What then is left (rays that pass a defect closely, kinks between elements) may be kLast
  /// times as much.
  struct Accuracy {
    double tail;
    int splits;
  };
  static constexpr double kLast = 100;
  void add(const Piece& piece, double from, double to, const Accuracy& accuracy);
  /// None where a ray does not arrive, polynomials do not follow, or image radii do not fall from ray to ray.
  std::optional<Panel> panel_of(const Piece& piece, double from, double to, const Accuracy& accuracy);
  void add_rays_in_field(const T& rim, const T& ring);
  /// With the derivatives of S from those by the shape.
  One lifted(double value, const double* by_shape, std::size_t stride) const;
  One lifted(const T& x) const;
  EikonalRay<One> read(const One& rho) const;

  bool extraordinary_;
  One objective_na_, host_;
  MeridionalDroplet<T> droplet_;
  One shape_[kShape];
  S radius_um_, path_phase_;   ///< the latter of one unit of path, rad
  One axis_ray_ = One(0.0);    ///< sine of the angle of incidence of the ray that is seen on the axis
  std::vector<Panel> panels_;  ///< from the rim inwards
  std::vector<S> ends_um_;
  double path_error_ = 0;
  int rays_ = 0;
};

}  // namespace birefit
