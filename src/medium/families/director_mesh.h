#pragma once
// Where the profile of a cell's director is known: nodes over its depth, and what sums and slopes over them take.

#include <optional>
#include <vector>

namespace birefit {

/// Piecewise polynomials in depth: tilt and azimuth (from the entry's) at any u in [0, 1].
/// Elements crowd towards the faces, where a strong field leaves a layer of thickness d / (pi V/V_threshold).
class DirectorMesh {
 public:
  /// elements >= 1 of polynomials of this degree, 2 to 20.
  DirectorMesh(int elements, int degree);
  int elements() const { return static_cast<int>(edges_.size()) - 1; }
  int degree() const { return degree_; }
  int nodes() const { return elements() * degree_ + 1; }
  /// The first half of a mesh of an even number of elements: of profiles that are their own mirror image.
  std::optional<DirectorMesh> half() const;
  bool is_half() const { return is_half_; }
  /// Nodes between faces; the middle of a half is one of them.
  int free_nodes() const { return nodes() - (is_half_ ? 1 : 2); }
  double place(int node) const;  ///< of a node, in [0, 1]
  double width(int element) const {
    return edges_[static_cast<std::size_t>(element) + 1] - edges_[static_cast<std::size_t>(element)];
  }
  /// Gauss-Lobatto; their sum is 2, of a half 4: what is summed over it is that of the whole.
  double weight(int k) const { return weight_[static_cast<std::size_t>(k)]; }
  /// at point k of cardinal polynomial j
  double slope(int k, int j) const { return slope_[static_cast<std::size_t>(k * (degree_ + 1) + j)]; }
  /// of cardinal polynomial j
  double monomial(int power, int j) const { return monomial_[static_cast<std::size_t>(power * (degree_ + 1) + j)]; }
  int element_at(double u) const;
  double middle(int element) const {
    return 0.5 * (edges_[static_cast<std::size_t>(element)] + edges_[static_cast<std::size_t>(element) + 1]);
  }

 private:
  int degree_;
  bool is_half_ = false;
  std::vector<double> edges_, point_, weight_, slope_, monomial_;
};

}  // namespace birefit
