#include "io/fields/volume_file.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include <fmt/format.h>
#include <Eigen/Dense>

#include "core/robust.h"
#include "io/fields/npy.h"
#include "io/fields/open_qmin.h"
#include "io/fields/raw_volume.h"
#include "io/fields/vtk.h"

namespace birefit {
namespace {

using fields::RawVolume;
using fields::refuse;

// ---- from arrays to the grid ---------------------------------------------------------------------------------------

class GridMaker {
 public:
  GridMaker(const RawVolume& raw, const VolumeRequest& request)
      : raw_(raw), request_(request), norm_(request.q_norm > 0 ? request.q_norm : raw.usual_norm) {
    result_.bulk_order = request.bulk_order;
  }

  LoadedVolume make() {
    auto grid = std::make_shared<VolumeGrid>();
    grid->nx = raw_.nx, grid->ny = raw_.ny, grid->nz = raw_.nz;
    grid->spacing_um = raw_.spacing_um;
    const std::size_t count =
        static_cast<std::size_t>(raw_.nx) * static_cast<std::size_t>(raw_.ny) * static_cast<std::size_t>(raw_.nz);
    grid->nodes.assign(count, {});
    double largest = 0;
    std::vector<double> orders, beside;  // of nodes: by the tensor, and over what stands beside it
    for (std::size_t i = 0; i < count; ++i) {
      if (raw_.mask) {
        const double inside = raw_.mask->values[i];
        if (std::isnan(inside)) refuse_node("domain_mask", i, "is NaN", "1 inside, 0 outside");
        if (!(inside > 0.5)) continue;  // what stands there does not matter
      }
      ++inside_;
      const double order = raw_.tensor ? by_tensor(i, grid->nodes[i]) : by_director(i, grid->nodes[i]);
      largest = std::max(largest, std::abs(order));
      if (order > 0) orders.push_back(order);
      if (raw_.tensor && raw_.order && order > 0 && raw_.order->values[i] > 0)
        beside.push_back(order / raw_.order->values[i]);
    }
    if (inside_ == 0) refuse(raw_.file, "domain_mask leaves no node", "it is 1 (above 0.5) inside the liquid crystal");
    if (!(largest > 0))
      refuse(raw_.file, raw_.tensor ? "Q is zero at every node" : "S is zero at every node",
             "nothing here turns light");
    if (raw_.tensor && request_.bulk_order > 0)
      check_norm(median(orders) / request_.bulk_order, median(orders), "bulk_order", request_.bulk_order);
    if (!beside.empty()) check_norm(median(beside), median(orders), "S", median(orders) / median(beside));
    if (!(result_.bulk_order > 0)) result_.bulk_order = raw_.tensor || raw_.order ? largest : 1;
    if (largest > 1.05 * result_.bulk_order)
      result_.warnings.push_back(
          fmt::format("The order in {} reaches {:.4g}, above bulk_order = {:.4g}: the birefringence there is larger "
                      "than the material's.",
                      raw_.file, largest, result_.bulk_order));
    for (auto& node : grid->nodes)
      for (double& component : node) component /= result_.bulk_order;
    if (worst_length_ > 1e-3)
      result_.warnings.push_back(
          fmt::format("Directors in {} are not of unit length (off by up to {:.2g}, at {}); they were normalised.",
                      raw_.file, worst_length_, place(worst_node_)));
    result_.grid = std::move(grid);
    return std::move(result_);
  }

 private:
  /// Two norms of Q are common, 3/2 apart: an order so far from what is stated is of the other one. Half of the nodes
  /// are nearer to the bulk's order than to anything else.
  void check_norm(double ratio, double found, const std::string& name, double stated) const {
    if (request_.q_norm > 0) return;  // asked for
    constexpr double kNear = 1.07;    // defects and walls pull the median that far from the bulk at most
    const double other = norm_ > 1.2 ? 1 : 1.5, expected = other / norm_;
    if (ratio > expected * kNear || ratio < expected / kNear) return;
    throw UserError(request_.where,
                    fmt::format("Q in {} tells an order of {:.4g} where {} says {:.4g}, {} of it: its norm is not "
                                "Q = {}S (n n - 1/3) but Q = {}S (n n - 1/3)",
                                raw_.file, found, name, stated, other > norm_ ? "3/2" : "2/3",
                                norm_ > 1.2 ? "3/2 " : "", other > 1.2 ? "3/2 " : ""),
                    fmt::format("add q_norm: {:g} to sample.volume (q_norm: {:g} keeps it as it is)", other, norm_));
  }
  std::string place(std::size_t node) const {
    const std::size_t nx = static_cast<std::size_t>(raw_.nx), ny = static_cast<std::size_t>(raw_.ny);
    return fmt::format("[x, y, z] = [{}, {}, {}]", node % nx, node / nx % ny, node / nx / ny);
  }
  [[noreturn]] void refuse_node(const std::string& array, std::size_t node, const std::string& what,
                                const std::string& hint) const {
    refuse(raw_.file, fmt::format("{} {} at node {}", array, what, place(node)), hint);
  }
  double by_director(std::size_t i, std::array<double, 6>& node) {
    const double* n = raw_.field.values.data() + 3 * i;
    const double s = raw_.order ? raw_.order->values[i] : 1, length = std::hypot(n[0], n[1], n[2]);
    if (!std::isfinite(s))
      refuse_node("S", i, "is not a finite number", "give domain_mask = 0 where there is no liquid crystal");
    if (s == 0) return 0;  // isotropic: no direction needed
    if (!std::isfinite(length)) refuse_node(raw_.name, i, "is not a finite number", outside());
    if (!(length > 0)) refuse_node(raw_.name, i, "is zero", outside());
    if (std::abs(length - 1) > worst_length_) {
      worst_length_ = std::abs(length - 1);
      worst_node_ = i;
    }
    node = director_tensor(n[0] / length, n[1] / length, n[2] / length, s);
    return s;
  }
  /// The axis of the largest eigenvalue; Q = norm S (n n - 1/3) has it at 2/3 norm S. What is biaxial is left out.
  double by_tensor(std::size_t i, std::array<double, 6>& node) {
    const double* q = raw_.field.values.data() + 6 * i;
    double size = 0;
    for (int c = 0; c < 6; ++c) {
      if (!std::isfinite(q[c]))
        refuse_node(raw_.name, i, "is not a finite number",
                    "Q = 0 is isotropic: write that where there is no liquid crystal");
      size = std::max(size, std::abs(q[c]));
    }
    if (size == 0) return 0;
    if (std::abs(q[0] + q[1] + q[2]) > 1e-3 * size)
      refuse_node(
          raw_.name, i, fmt::format("has the trace {:.3g}", q[0] + q[1] + q[2]),
          "Q = S (n n - 1/3) has none; six components come as xx, yy, zz, then xy, xz, yz (.npy) or xy, yz, xz (.vti)");
    Eigen::Matrix3d m;
    m << q[0], q[3], q[4], q[3], q[1], q[5], q[4], q[5], q[2];
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(m);
    const Eigen::Vector3d n = solver.eigenvectors().col(2);
    const double s = 1.5 / norm_ * solver.eigenvalues()[2];
    node = director_tensor(n[0], n[1], n[2], s);
    return s;
  }
  std::string outside() const {
    return raw_.mask ? "the domain mask says that liquid crystal is there"
                     : "where there is no liquid crystal give domain_mask = 0 (.vti), or write the tensor Q, which may "
                       "be 0, in place of n";
  }

  const RawVolume& raw_;
  const VolumeRequest& request_;
  const double norm_;
  LoadedVolume result_;
  std::size_t inside_ = 0, worst_node_ = 0;
  double worst_length_ = 0;
};

/// By what the file begins with: a wrong extension does not confuse.
RawVolume read_raw(std::string content, const VolumeRequest& request) {
  const auto starts = [&](std::string_view with) { return content.compare(0, with.size(), with) == 0; };
  const std::size_t text = content.find_first_not_of(" \t\r\n\xef\xbb\xbf");
  const bool xml = text != std::string::npos && content[text] == '<';
  if (request.x_first && (xml || starts("# vtk")))
    throw UserError(request.where, "axes belongs to .npy and .npz files: in VTK's x runs fastest", "leave it out");
  if (starts("\x93NUMPY")) return fields::read_npy(content, request);
  if (starts("PK\3\4")) return fields::read_npz(content, request);
  if (starts("# vtk DataFile") || starts("# vtk datafile")) return fields::read_legacy_vtk(content, request);
  if (xml) return fields::read_vti(std::move(content), request);
  const std::string extension = request.path.extension().string();
  if (extension == ".npy") return fields::read_npy(content, request);  // says what is wrong
  if (extension == ".vti") return fields::read_vti(std::move(content), request);
  if (extension != ".txt" && extension != ".dat" && extension != ".csv" && extension != ".tsv" && extension != "")
    throw UserError(request.where, request.path.string() + " is neither .npy, .npz, .vti, .vtk nor text of open-Qmin",
                    "numpy.save writes .npy; ParaView and VTK write .vti");
  return fields::read_open_qmin(content, request);
}

}  // namespace

LoadedVolume load_volume(const VolumeRequest& request) {
  if (request.content) return GridMaker(read_raw(*request.content, request), request).make();
  std::error_code code;
  if (!std::filesystem::is_regular_file(request.path, code))
    throw UserError(
        request.where,
        request.path.string() + (std::filesystem::exists(request.path, code) ? " is no file" : " does not exist"));
  if (std::filesystem::file_size(request.path, code) > (std::uintmax_t{1} << 33))
    throw UserError(request.where, request.path.string() + " is larger than 8 GB",
                    "keep every second node along each side");
  std::ifstream in(request.path, std::ios::binary);
  std::string content{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  if (!in) throw UserError(request.where, request.path.string() + " cannot be read");
  return GridMaker(read_raw(std::move(content), request), request).make();
}

}  // namespace birefit
