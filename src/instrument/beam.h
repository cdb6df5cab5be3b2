#pragma once
// What stands on both sides of a sample, for one wavelength: the states of polarization that go in, and those that are
// let through. A sample's image asks for what its Jones matrix lets pass and knows no polarizer of its own.

#include <array>
#include <vector>

#include "core/jones.h"
#include "scene/values.h"

namespace birefit {

/// A transverse field by its complex amplitudes along the image's x and y (docs/conventions.md: time goes as
/// e^{-i w t}).
template <class S>
struct Field {
  Complex<S> x, y;
};

/// One side of the sample. Before it: the fields that come in, which do not interfere, their weights summing to 1.
/// Behind: the fields that are let through; of E passes the sum of weight |<field|E>|^2. Fields are of unit length.
template <class S>
struct Side {
  std::array<Field<S>, 2> field;
  std::array<S, 2> weight;
  int count = 1;
};

/// What passes of a retarder w + i (x sx + y sy + z sz): this quadratic form of (w, x, y, z), products of two different
/// ones counted twice. Between linear states wx, wz, xy and yz vanish.
template <class S>
struct RetarderForm {
  S ww, wx, wy, wz, xx, xy, xz, yy, yz, zz;
  /// Of retarders given in a frame that is turned in the image, by the cosine and sine of twice the angle.
  RetarderForm in_frame(const S& c, const S& s) const {
    const S cs = c * s, cc = c * c, ss = s * s;
    return {.ww = ww,
            .wx = c * wx - s * wz,
            .wy = wy,
            .wz = c * wz + s * wx,
            .xx = cc * xx - 2.0 * (cs * xz) + ss * zz,
            .xy = c * xy - s * yz,
            .xz = cs * (xx - zz) + (cc - ss) * xz,
            .yy = yy,
            .yz = c * yz + s * xy,
            .zz = cc * zz + 2.0 * (cs * xz) + ss * xx};
  }
};

/// One line of the spectrum: what passes of a sample's Jones matrix, as a fraction of the light that comes in.
template <class S>
class Line {
 public:
  Line(const Microscope&, const Values<S>&);

  const Side<S>& in() const { return in_; }
  const Side<S>& out() const { return out_; }
  /// One real field on each side, in() and out() without imaginary part; by which parts there are, never by their
  /// values: what a retarder does is to have its derivative at 0, too.
  bool linear() const { return linear_; }
  /// Where linear: cosine and sine of the angle from the polarizer to the analyser, and of the sum of their azimuths.
  S cos_between() const { return between_[0]; }
  S sin_between() const { return between_[1]; }
  S cos_sum() const { return sum_[0]; }
  S sin_sum() const { return sum_[1]; }
  /// A mirror y -> -y of the sample leaves what passes as it is.
  bool mirrored() const;

  /// Light without a sample.
  const S& open() const { return open_; }
  /// Light through a sample: E behind it = J E before it.
  S of(const Mat2<S>& j) const {
    if (linear_) {
      const S &px = in_.field[0].x.re, &py = in_.field[0].y.re, &ax = out_.field[0].x.re, &ay = out_.field[0].y.re;
      return norm(ax * (px * j.a + py * j.b) + ay * (px * j.c + py * j.d));
    }
    S sum(0.0);
    for (int k = 0; k < pairs_; ++k) {
      const Pair& p = pair_[static_cast<std::size_t>(k)];
      sum = sum + p.weight * norm(p.xx * j.a + p.xy * j.b + p.yx * j.c + p.yy * j.d);
    }
    return sum;
  }
  /// Through a retarder.
  S of(const Su2<S>& u) const {
    if (linear_) return of(matrix(u));
    const RetarderForm<S>& f = form_;
    return u.w * (f.ww * u.w + 2.0 * (f.wx * u.x + f.wy * u.y + f.wz * u.z)) +
           u.x * (f.xx * u.x + 2.0 * (f.xy * u.y + f.xz * u.z)) + u.y * (f.yy * u.y + 2.0 * (f.yz * u.z)) +
           u.z * (f.zz * u.z);
  }
  const RetarderForm<S>& form() const { return form_; }

  /// A field that comes in and one that is let through: the amplitude of a matrix is xx j.a + xy j.b + yx j.c + yy j.d,
  /// its intensity times `weight` a part of the light.
  struct Pair {
    S weight;
    Complex<S> xx, xy, yx, yy;
    /// Of 1, sigma_x, i sigma_y and sigma_z.
    Complex<S> one() const { return xx + yy; }
    Complex<S> x() const { return xy + yx; }
    Complex<S> iy() const { return xy - yx; }
    Complex<S> z() const { return xx - yy; }
  };
  int pairs() const { return pairs_; }
  const Pair& pair(int k) const { return pair_[static_cast<std::size_t>(k)]; }

 private:
  Side<S> in_, out_;
  bool linear_;
  std::array<Pair, 4> pair_;
  int pairs_ = 0;
  RetarderForm<S> form_;
  std::array<S, 2> between_, sum_;
  S open_;
};

/// What the parts beside the sample do to a field's phase (rad): how fast fringes go by a parameter of theirs.
std::vector<double> part_phases(const Microscope&, const Values<double>&);

}  // namespace birefit
