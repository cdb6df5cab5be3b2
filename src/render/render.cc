#include "birefit/render.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include <fmt/format.h>

#include "core/threads.h"
#include "render/band.h"
#include "render/exposed.h"
#include "render/sums.h"
#include "samples/choices.h"
#include "samples/kind.h"
#include "samples/pixels/edge_pixels.h"
#include "samples/pixels/sampling.h"
#include "samples/tables/fringe_table.h"
#include "samples/tables/polar_table.h"
#include "samples/waves/wave.h"
#include "transport/method.h"

namespace birefit {

int rays_side_by_side() { return kLanes; }

namespace {

int samples_at(const RenderPlan& plan, double column, double row) {
  if (plan.means.samples.empty()) return 1;
  const double dx = column - plan.means.center_x_px, dy = row - plan.means.center_y_px;
  const std::size_t bin = static_cast<std::size_t>(std::sqrt(dx * dx + dy * dy) / plan.means.bin_px);
  return plan.means.samples[std::min(bin, plan.means.samples.size() - 1)];
}

/// load_lanes(x + shift), shift = 0 to 4 and x at a register's boundary: two loads for all of them, none across a cache
/// line's end.
template <class P>
BIREFIT_INLINE P load_shifted(const double* x, int shift) {
#ifdef __AVX512F__
  if constexpr (std::is_same_v<P, Pack>) {
    const __m512i here = _mm512_load_si512(x);
    if (shift == 0) return _mm512_castsi512_pd(here);
    const __m512i next = _mm512_load_si512(x + kLanes);
    switch (shift) {
      case 1:
        return _mm512_castsi512_pd(_mm512_alignr_epi64(next, here, 1));
      case 2:
        return _mm512_castsi512_pd(_mm512_alignr_epi64(next, here, 2));
      case 3:
        return _mm512_castsi512_pd(_mm512_alignr_epi64(next, here, 3));
      default:
        return _mm512_castsi512_pd(_mm512_alignr_epi64(next, here, 4));
    }
  }
#endif
  return load_lanes<P>(x + shift);
}

constexpr std::array<double, kLanes> kCount = [] {
  std::array<double, kLanes> a{};
  for (int k = 0; k < kLanes; ++k) a[static_cast<std::size_t>(k)] = k;
  return a;
}();

/// Writes lanes [first, first + count) to `to`.
template <class P>
BIREFIT_INLINE void store_lanes(const P& x, double* to, int first, int count) {
  if constexpr (std::is_same_v<P, Pack>) {
    if (first == 0 && count == kLanes) {
      x.store_unaligned(to);
      return;
    }
  }
  for (int k = 0; k < count; ++k) to[k] = lane(x, first + k);
}
/// The same of value and derivatives, to out[0], out[1..N].
template <class S, std::size_t N>
BIREFIT_INLINE void store(const S& value, const std::array<double*, N>& out, int planes, int first, int count) {
  store_lanes(plain(value), out[0], first, count);
  if constexpr (ScalarTraits<S>::derivatives > 0)
    for (int j = 1; j < planes; ++j)
      store_lanes(value.d[static_cast<std::size_t>(j - 1)], out[static_cast<std::size_t>(j)], first, count);
}

/// The value, or its derivative of number plane - 1.
template <class S>
const PlainOf<S>& plain_of_plane(const S& x, [[maybe_unused]] int plane) {
  if constexpr (ScalarTraits<S>::derivatives > 0)
    return plane == 0 ? x.value : x.d[static_cast<std::size_t>(plane - 1)];
  else
    return x;
}

/// Paints bands of a picture, and of its derivatives, into images that are there. Rows of a band are computed as point
/// values, `reach` beyond its ends, and made means over pixels as soon as their neighbours are known.
template <class S>
class BandPainter {
 public:
  /// `model`: after tabulate(). `images`: the intensity's and its derivatives', as many as are wanted.
  BandPainter(const SampleImage<S>& model, const RenderPlan& plan, int width, int height,
              const std::vector<Image*>& images)
      : model_(model),
        plan_(plan),
        rings_(plan),
        images_(images),
        planes_(static_cast<int>(images.size())),
        w_(width),
        h_(height),
        in_phase_(model.in_phase()),
        traits_(model.fringe_traits()),
        symmetry_(model.symmetry()),
        computed_(symmetry_ != Symmetry::none ? (height + 1) / 2 : height) {
    for (int p = 0; p < kPlanes; ++p) fields_of_[static_cast<std::size_t>(p)] = model.fringe_fields(p);
    // Flows read two pixels beyond (fringe.h).
    if (std::any_of(fields_of_.begin(), fields_of_.end(), [](const FringeFields& f) { return f.flow.has_value(); }))
      reach_ = kRim;
  }
  /// Those with most of the object first: what is left at the end, when one thread waits for the other, is background.
  std::vector<int> bands() const {
    std::vector<int> all(static_cast<std::size_t>((computed_ + Band::kRows - 1) / Band::kRows));
    std::iota(all.begin(), all.end(), 0);
    const auto off_centre = [&](int b) { return std::abs((b + 0.5) * Band::kRows - plan_.means.center_y_px); };
    std::sort(all.begin(), all.end(), [&](int a, int b) { return off_centre(a) < off_centre(b); });
    return all;
  }
  /// The band, and what a symmetry makes of it. Any thread may call it for a band of its own.
  void paint(int number) const {
    thread_local Band band;  // fresh memory costs as much as the image itself: it stays with the thread
    thread_local NeededPoints needed;
    const int top = number * Band::kRows, rows = std::min(Band::kRows, computed_ - top);
    band.resize(w_, plan_.means.fringes ? 4 * kPlanes : kPlanes, reach_);
    find_samples(band, top, rows);
    FringeScratch scratch;
    for (int r = -reach_; r < rows + reach_; ++r) {
      compute(band, needed, scratch, top, r);
      if (r < reach_) continue;
      const int done = r - reach_;
      if (plan_.means.fringes)
        average_fringes(band, top, done);
      else
        average_points(band, top, done);
      sample_pixels(band, top, done);
      if (model_.has_passing_light()) add_passing(top + done);
    }
    if (symmetry_ != Symmetry::none)
      for (int row = top; row < top + rows; ++row) mirror(row);
  }

 private:
  using P = PlainOf<S>;
  static constexpr int kStep = kLanesOf<S>, kPlanes = 1 + ScalarTraits<S>::derivatives, kRim = Band::kRim;
  using Targets = std::array<double*, static_cast<std::size_t>(kPlanes)>;

  int wide() const { return w_ + 2 * kRim; }
  static P columns_from(double first) { return load_lanes<P>(kCount.data()) + P(first); }
  Targets targets(int row, int column) const {
    Targets out{};
    for (std::size_t p = 0; p < images_.size(); ++p) out[p] = images_[p]->row(row) + column;
    return out;
  }

  /// How many points each pixel takes.
  void find_samples(Band& band, int top, int rows) const {
    for (int r = -2 * reach_; r < rows + 2 * reach_; ++r)
      rings_.fill(std::clamp(top + r, -reach_, h_ - 1 + reach_), -kRim, band.samples(r), wide());
    if (model_.edges() == 0) return;
    thread_local EdgeMarks marks;
    marks.look(model_, top - 2 * reach_, rows + 4 * reach_, -kRim, wide());
    for (int r = -2 * reach_; r < rows + 2 * reach_; ++r) marks.mark(r + 2 * reach_, band.samples(r));
  }
  /// Point values of row r of the band that begins with the picture's row `top`.
  void compute(Band& band, NeededPoints& needed, FringeScratch& scratch, int top, int r) const {
    needed.find(
        reach_, [&](int k) { return band.samples(r + k); }, wide());
    std::array<double*, static_cast<std::size_t>(4 * kPlanes)> fields;
    if (plan_.means.fringes)
      for (int f = 0; f < 4; ++f) band.clear(f * kPlanes, r, !needed.all());
    for (int c0 = 0; c0 < wide(); c0 += kStep) {
      if (plan_.means.fringes) {
        for (int p = 0; p < 4 * kPlanes; ++p) fields[static_cast<std::size_t>(p)] = band.row(p, r) + c0;
        if (const int run = model_.fringe_run(c0 - kRim, top + r, wide() - c0, scratch, fields.data()); run > 0) {
          c0 += run - kStep;
          continue;
        }
      }
      if (!needed.any(c0, std::min(kStep, wide() - c0))) continue;
      const P column = columns_from(c0 - 1.0 * kRim), row(static_cast<double>(top + r));
      const auto put = [&](const S& v, int field) {
        Targets out;
        for (int p = 0; p < kPlanes; ++p) out[static_cast<std::size_t>(p)] = band.row(field * kPlanes + p, r) + c0;
        store(v, out, kPlanes, 0, kStep);
      };
      if (plan_.means.fringes) {
        FringePoint<S> v;
        model_.fringe(column, row, &v);
        put(v.amplitude, 0), put(v.phase, 1), put(v.mean, 2);
        if (!in_phase_) put(v.quadrature, 3);
      } else {
        S v;
        model_.light(column, row, &v);
        put(v, 0);
      }
    }
  }
  /// Means of pixels of one sample, by fringe_means().
  void average_fringes(Band& band, int top, int r) const {
    // Where rows begin is asked for once: a pack reads dozens of them.
    std::array<std::array<const double*, 2 * kRim + 1>, static_cast<std::size_t>(4 * kPlanes)> from;
    for (std::size_t p = 0; p < from.size(); ++p)
      for (int j = -kRim; j <= kRim; ++j)
        from[p][static_cast<std::size_t>(j + kRim)] = band.row(static_cast<int>(p), r + j);
    const P row(static_cast<double>(top + r));
    const Targets to = targets(top + r, 0);
    for (int c0 = 0; c0 < w_; c0 += kStep) {
      const auto load = [&](int plane, int field, int j, int i) BIREFIT_INLINE_LAMBDA {
        return load_shifted<P>(
            from[static_cast<std::size_t>(field * kPlanes + plane)][static_cast<std::size_t>(j + kRim)] + c0, i + kRim);
      };
      const auto put = [&](int plane, const P& mean) BIREFIT_INLINE_LAMBDA {
        store_lanes(mean, to[static_cast<std::size_t>(plane)] + c0, 0, std::min(kStep, w_ - c0));
      };
      const P column = columns_from(c0);
      const auto means = [&]<bool kQuadrature, bool kFlows>() BIREFIT_INLINE_LAMBDA {
        fringe_means<kQuadrature, kFlows, kPlanes, P>(planes_, traits_, column, row, fields_of_.data(), load, put);
      };
      if constexpr (kPlanes > 1)
        if (reach_ > 1) {
          if (in_phase_)
            means.template operator()<false, true>();
          else
            means.template operator()<true, true>();
          continue;
        }
      if (in_phase_)
        means.template operator()<false, false>();
      else
        means.template operator()<true, false>();
    }
  }
  /// Means of pixels of one sample from point values: over a unit square of a smooth function f + laplacian f / 24,
  /// here by the five-point formula.
  void average_points(Band& band, int top, int r) const {
    for (int p = 0; p < planes_; ++p) {
      const double *up = band.row(p, r - 1) + kRim, *here = band.row(p, r) + kRim, *down = band.row(p, r + 1) + kRim;
      double* out = images_[static_cast<std::size_t>(p)]->row(top + r);
      for (int c = 0; c < w_; ++c)
        out[c] = here[c] + (here[c - 1] + here[c + 1] + up[c] + down[c] - 4 * here[c]) * (1.0 / 24);
    }
  }
  /// Pixels of several samples, packed into lanes by their number.
  void sample_pixels(Band& band, int top, int r) const {
    const std::uint8_t* n = band.samples(r) + kRim;
    if (std::all_of(n, n + w_, [](std::uint8_t k) { return k == 1; })) return;
    std::array<std::array<int, kLanes>, 9> waiting;
    std::array<int, 9> count{};
    const auto flush = [&](std::size_t most) {
      double columns[kLanes];
      for (int k = 0; k < kStep; ++k)
        columns[k] = waiting[most][static_cast<std::size_t>(std::min(k, count[most] - 1))];
      const S v =
          mean_over_pixels(model_, load_lanes<P>(columns), P(static_cast<double>(top + r)), static_cast<int>(most));
      for (int k = 0; k < count[most]; ++k)
        store(v, targets(top + r, waiting[most][static_cast<std::size_t>(k)]), planes_, k, 1);
      count[most] = 0;
    };
    for (int c = 0; c < w_; ++c) {
      if (n[c] == 1) continue;
      if (n[c] & kEdgePixel) {
        store(mean_over_cut_pixel(model_, plan_, c, top + r), targets(top + r, c), planes_, 0, 1);
        continue;
      }
      const std::size_t most = n[c];
      if (n[c] > 8 || (n[c] * n[c]) % kStep == 0) {
        store(mean_over_one_pixel(model_, c, top + r, n[c]), targets(top + r, c), planes_, 0, 1);
        continue;
      }
      waiting[most][static_cast<std::size_t>(count[most]++)] = c;
      if (count[most] == kStep) flush(most);
    }
    for (std::size_t most = 2; most < 9; ++most)
      if (count[most] > 0) flush(most);
  }
  void add_passing(int row) const {
    for (int c0 = 0; c0 < w_; c0 += kStep) {
      S v;
      model_.passing(columns_from(c0), P(static_cast<double>(row)), &v);
      for (int p = 0; p < planes_; ++p) {
        const P* light = &plain_of_plane(v, p);
        double* out = images_[static_cast<std::size_t>(p)]->row(row) + c0;
        for (int k = 0; k < std::min(kStep, w_ - c0); ++k) out[k] += lane(*light, k);
      }
    }
  }
  void mirror(int row) const {
    const int other = h_ - 1 - row;
    if (other == row) return;
    for (Image* image : images_) {
      if (symmetry_ == Symmetry::half_turn)
        std::reverse_copy(image->row(row), image->row(row) + w_, image->row(other));
      else
        std::copy(image->row(row), image->row(row) + w_, image->row(other));
    }
  }

  const SampleImage<S>& model_;
  const RenderPlan& plan_;
  SampleRings rings_;
  const std::vector<Image*>& images_;
  int planes_, w_, h_;
  bool in_phase_;
  FringeTraits traits_;
  std::array<FringeFields, static_cast<std::size_t>(kPlanes)> fields_of_{};
  Symmetry symmetry_;
  int computed_;  ///< rows; the others are copied
  int reach_ = 1;
};

/// The intensity and its derivatives by `active`, at most as many as S carries, into `images`; they are made where
/// missing or of another size.
template <class S>
void render_planes(const Scene& scene, const RenderPlan& plan, const BeamMaker& light, const Theta& theta,
                   const std::vector<int>& active, int threads, const std::vector<Image*>& images) {
  const Values<S> value(theta, active, plan.demand.memo.get());
  const std::unique_ptr<SampleImage<S>> model = make_image<S>(scene, plan, value, light);
  model->tabulate(SampleImage<S>::Wanted::picture, threads);
  const int w = scene.view.width, h = scene.view.height;
  parallel_for(static_cast<int>(images.size()), threads, [&](int p) {
    Image& image = *images[static_cast<std::size_t>(p)];
    if (image.width() != w || image.height() != h) image = Image(w, h);
  });
  const BandPainter<S> painter(*model, plan, w, h, images);
  const std::vector<int> bands = painter.bands();
  parallel_for(static_cast<int>(bands.size()), threads,
               [&](int i) { painter.paint(bands[static_cast<std::size_t>(i)]); });
}

template <class S>
void render_list(const Scene& scene, const RenderPlan& plan, const BeamMaker& light, const Theta& theta,
                 const std::vector<std::array<int, 2>>& pixels, const std::vector<int>& active, int threads,
                 PixelRendering& out, int first_column) {
  const Values<S> value(theta, active, plan.demand.memo.get());
  const std::unique_ptr<SampleImage<S>> model = make_image<S>(scene, plan, value, light);
  model->tabulate(SampleImage<S>::Wanted::points, threads);
  const int n = static_cast<int>(pixels.size());
  constexpr int kStep = kLanesOf<S>;
  // All lanes take as many samples as the one that needs most: pixels that need as many go together, the dearest first.
  std::vector<std::uint8_t> samples(pixels.size());
  constexpr int kTogether = 1024;
  parallel_for((n + kTogether - 1) / kTogether, threads, [&](int block) {
    for (int i = kTogether * block; i < std::min(n, kTogether * (block + 1)); ++i) {
      const auto& [x, y] = pixels[static_cast<std::size_t>(i)];
      std::uint8_t& k = samples[static_cast<std::size_t>(i)];
      k = static_cast<std::uint8_t>(samples_at(plan, x, y));
      if (model->edges() > 0 && (is_edge_pixel(*model, x, y) || is_defect_pixel(*model, x, y))) k = kEdgePixel;
    }
  });
  std::array<std::size_t, 257> place{};  // where those of 255, 254, .. samples begin
  for (const std::uint8_t k : samples) ++place[static_cast<std::size_t>(256 - k)];
  std::partial_sum(place.begin(), place.end(), place.begin());
  std::vector<std::size_t> order(pixels.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[place[static_cast<std::size_t>(255 - samples[i])]++] = i;
  const auto passing_at = [&](const PlainOf<S>& column, const PlainOf<S>& row) {
    S v;
    model->passing(column, row, &v);
    return v;
  };
  const auto put = [&](std::size_t pixel, const S& v, int k) {
    out.intensity(static_cast<Eigen::Index>(pixel)) = lane(plain(v), k);
    if constexpr (ScalarTraits<S>::derivatives > 0)
      for (std::size_t j = 0; j < active.size(); ++j)
        out.derivatives(static_cast<Eigen::Index>(pixel), first_column + static_cast<int>(j)) = lane(v.d[j], k);
  };
  const int edges = static_cast<int>(
                std::count_if(samples.begin(), samples.end(), [](std::uint8_t k) { return (k & kEdgePixel) != 0; })),
            groups = (n - edges + kStep - 1) / kStep;
  parallel_for(edges, threads, [&](int i) {
    const std::size_t pixel = order[static_cast<std::size_t>(i)];
    S v = mean_over_cut_pixel(*model, plan, pixels[pixel][0], pixels[pixel][1]);
    if (model->has_passing_light()) v = v + passing_at(PlainOf<S>(pixels[pixel][0]), PlainOf<S>(pixels[pixel][1]));
    put(pixel, v, 0);
  });
  const int together = std::clamp(groups / 64, 1, 16);
  parallel_for((groups + together - 1) / together, threads, [&](int block) {
    for (int g = together * block; g < std::min(groups, together * (block + 1)); ++g) {
      double columns[kLanes], rows[kLanes];
      std::array<std::size_t, kLanes> at;
      for (int k = 0; k < kLanes; ++k) {
        at[static_cast<std::size_t>(k)] = order[static_cast<std::size_t>(std::min(edges + g * kStep + k, n - 1))];
        const auto& pixel = pixels[at[static_cast<std::size_t>(k)]];
        columns[k] = pixel[0];
        rows[k] = pixel[1];
      }
      const int most = samples[at[0]];
      const PlainOf<S> column = load_lanes<PlainOf<S>>(columns), row = load_lanes<PlainOf<S>>(rows);
      S v;
      if (most == 1 && plan.means.fringes) {
        FringePoint<S> p[3][3];
        for (int j = 0; j < 3; ++j)
          for (int i = 0; i < 3; ++i) model->fringe(column + PlainOf<S>(i - 1.0), row + PlainOf<S>(j - 1.0), &p[j][i]);
        v = model->in_phase() ? fringe_mean<false>(p) : fringe_mean<true>(p);
      } else {
        v = mean_over_pixels(*model, column, row, std::max(most, 2));  // the point value alone is no pixel mean
      }
      if (model->has_passing_light()) v = v + passing_at(column, row);
      for (int k = 0; k < std::min(kStep, n - edges - g * kStep); ++k) put(at[static_cast<std::size_t>(k)], v, k);
    }
  });
}

/// Of points one by one, and of a picture: eight where they are read from a table.
std::size_t derivatives_at_once(const RenderPlan& plan) { return choices(plan).radial_panels > 0 ? 8 : 4; }
std::size_t derivatives_of_picture(const RenderPlan& plan) {
  const std::vector<std::uint8_t>& blocks = choices(plan).fringe_blocks;
  const bool all_from_squares = !blocks.empty() && std::find(blocks.begin(), blocks.end(), 0) == blocks.end();
  return all_from_squares ? 8 : derivatives_at_once(plan);
}

/// Calls body<S>(chunk, first) for the active parameters in chunks of at most `most` (4 or 8) derivatives a pass: every
/// pass computes the values, too.
template <class Body>
void in_chunks(const std::vector<int>& active, std::size_t most, const Body& body) {
  std::size_t first = 0;
  while (first < active.size()) {
    const std::size_t left = active.size() - first;
    const std::size_t take = std::min(left, most);
    const std::vector<int> chunk(active.begin() + static_cast<long>(first),
                                 active.begin() + static_cast<long>(first + take));
    if (take > 4)
      body.template operator()<Dual8>(chunk, static_cast<int>(first));
    else if (take > 2)
      body.template operator()<Dual4>(chunk, static_cast<int>(first));
    else if (take == 2)
      body.template operator()<Dual2>(chunk, static_cast<int>(first));
    else
      body.template operator()<Dual1>(chunk, static_cast<int>(first));
    first += take;
  }
}

/// What light of one direction brings.
void render_direction(const Scene& scene, const RenderPlan& plan, const BeamMaker& light, const Theta& theta,
                      const std::vector<int>& active, int threads, Rendering& into) {
  if (plan.wave) return render_wave(scene, plan, light, theta, active, threads, into);
  into.derivatives.resize(active.size());
  if (active.empty()) {
    render_planes<Pack>(scene, plan, light, theta, {}, threads, {&into.intensity});
    return;
  }
  in_chunks(active, derivatives_of_picture(plan), [&]<class S>(const std::vector<int>& chunk, int first) {
    std::vector<Image*> images{&into.intensity};
    for (std::size_t j = 0; j < chunk.size(); ++j)
      images.push_back(&into.derivatives[static_cast<std::size_t>(first) + j]);
    render_planes<S>(scene, plan, light, theta, chunk, threads, images);
  });
}
/// The same at chosen pixels.
void render_direction(const Scene& scene, const RenderPlan& plan, const BeamMaker& light, const Theta& theta,
                      const std::vector<std::array<int, 2>>& pixels, const std::vector<int>& active, int threads,
                      PixelRendering& into) {
  into.intensity.resize(static_cast<long>(pixels.size()));
  into.derivatives.resize(static_cast<long>(pixels.size()), static_cast<long>(active.size()));
  if (pixels.empty()) return;
  if (plan.wave) {  // there is no part of such a picture
    Rendering all;
    render_wave(scene, plan, light, theta, active, threads, all);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const auto [column, row] = pixels[i];
      into.intensity[static_cast<long>(i)] = all.intensity(column, row);
      for (std::size_t j = 0; j < active.size(); ++j)
        into.derivatives(static_cast<long>(i), static_cast<long>(j)) = all.derivatives[j](column, row);
    }
    return;
  }
  if (active.empty())
    render_list<Pack>(scene, plan, light, theta, pixels, {}, threads, into, 0);
  else
    in_chunks(active, derivatives_at_once(plan), [&]<class S>(const std::vector<int>& chunk, int first) {
      render_list<S>(scene, plan, light, theta, pixels, chunk, threads, into, first);
    });
}

/// What the sample's own picture sums.
SumsOfSample sample_sums(const Scene& scene, const RenderPlan& plan, const Theta& theta) {
  const SampleKind& kind = kind_of(scene, plan.observable);
  return {plan.wavelengths && kind.sums_wavelengths && kind.sums_wavelengths(scene, plan, theta),
          plan.condenser_rings > 0 && kind.directions(scene, plan) == ManyDirections::by_sample};
}

/// The picture in this light, or, null, in the microscope's own.
void render_in(const Scene& scene, const RenderPlan& plan, const Exposure* exposure, const Theta& theta,
               const std::vector<int>& active, int threads, Rendering& into) {
  sum_over_light(scene.microscope, plan, exposure, sample_sums(scene, plan, theta), theta, active, into,
                 [&](const RenderPlan& own, const Theta& at, const BeamMaker& light, const std::vector<int>& by,
                     Rendering& one) { render_direction(scene, own, light, at, by, threads, one); });
}
/// The same at chosen pixels.
PixelRendering render_pixels_in(const Scene& scene, const RenderPlan& plan, const Exposure* exposure,
                                const Theta& theta, const std::vector<std::array<int, 2>>& pixels,
                                const std::vector<int>& active, int threads) {
  PixelRendering out;
  sum_over_light(scene.microscope, plan, exposure, sample_sums(scene, plan, theta), theta, active, out,
                 [&](const RenderPlan& own, const Theta& at, const BeamMaker& light, const std::vector<int>& by,
                     PixelRendering& one) { render_direction(scene, own, light, at, pixels, by, threads, one); });
  return out;
}

}  // namespace

void render(const Scene& scene, const RenderPlan& plan, const Exposure& exposure, const Theta& theta,
            const std::vector<int>& active, int threads, Rendering& into) {
  render_in(scene, plan, &exposure, theta, active, threads, into);
}

void render(const Scene& scene, const RenderPlan& plan, const Theta& theta, const std::vector<int>& active, int threads,
            Rendering& into) {
  render_in(scene, plan, nullptr, theta, active, threads, into);
}

Rendering render(const Scene& scene, const RenderPlan& plan, const Theta& theta, const std::vector<int>& active,
                 int threads) {
  Rendering r;
  render(scene, plan, theta, active, threads, r);
  return r;
}

PixelRendering render_pixels(const Scene& scene, const RenderPlan& plan, const Exposure& exposure, const Theta& theta,
                             const std::vector<std::array<int, 2>>& pixels, const std::vector<int>& active,
                             int threads) {
  return render_pixels_in(scene, plan, &exposure, theta, pixels, active, threads);
}

PixelRendering render_pixels(const Scene& scene, const RenderPlan& plan, const Theta& theta,
                             const std::vector<std::array<int, 2>>& pixels, const std::vector<int>& active,
                             int threads) {
  return render_pixels_in(scene, plan, nullptr, theta, pixels, active, threads);
}

Image render_scalar(const Scene& scene, const RenderPlan& plan, const Theta& theta) {
  if (plan.wave) throw std::logic_error("wave optics has no rays to take one at a time");
  Rendering r;
  SumsOfSample by_sample = sample_sums(scene, plan, theta);
  by_sample.wavelengths = false;
  sum_over_light(scene.microscope, plan, nullptr, by_sample, theta, {}, r,
                 [&](const RenderPlan& own, const Theta& at, const BeamMaker& light, const std::vector<int>&,
                     Rendering& one) { render_planes<double>(scene, own, light, at, {}, 1, {&one.intensity}); });
  return std::move(r.intensity);
}

bool picture_is_cheaper(const Scene& scene, const RenderPlan& plan, const std::vector<std::array<int, 2>>& pixels) {
  const double all = static_cast<double>(scene.view.width) * scene.view.height,
               count = static_cast<double>(pixels.size());
  if (2 * count > all) return true;
  const SampleChoices& own = choices(plan);
  const bool blocks = !own.fringe_blocks.empty(), squares = !own.disc.empty();
  if (pixels.empty() || plan.wave || !(blocks || squares)) return false;
  double rays = 0, looked_at = 0;  // of a pixel by itself, in the mean
  for (std::size_t i = 0; i < pixels.size(); i += 1 + pixels.size() / 256) {
    const int n = samples_at(plan, pixels[i][0], pixels[i][1]);
    rays += plan.means.fringes && n == 1 ? 9 : square(std::max(n, 2));
    ++looked_at;
  }
  rays /= looked_at;
  double tables = 0, left = 0;  // rays of the tables, share of the picture that has none
  if (blocks) {
    const double smooth = static_cast<double>(std::count(own.fringe_blocks.begin(), own.fringe_blocks.end(), 1));
    tables = smooth * FringeTable<Pack>::kRays;
    left = 1 - smooth / static_cast<double>(own.fringe_blocks.size());
  } else {
    for (const DiscSquare& q : own.disc) {
      if (q.smooth)
        tables += PolarTable<Pack>::kRays;
      else
        left += q.points / (all * rays);
    }
  }
  constexpr double kReading = 0.05;  // of a ray's time, a pixel
  return count * rays > tables + all * (left * (plan.means.fringes ? 1 : rays) + kReading);
}

std::vector<JonesRow> jones(const Scene& scene, const RenderPlan& plan, const Theta& theta) {
  const Values<double> value(theta, {}, plan.demand.memo.get());
  if (plan.demand.ceiling == Ceiling::wave)
    throw UserError(Where{}, "under ceiling: wave a point of the image has no Jones matrix of its own ray",
                    "use `render`, or ceiling: one_way");
  const SampleKind& kind = kind_of(scene);
  if (!kind.jones)
    throw UserError(Where{},
                    fmt::format("a {} has no jones table: its retarder is one closed formula per pixel", kind.name),
                    "use `render`");
  JonesTable table(value(scene.microscope.wavelength_nm));
  kind.jones(scene, plan, value, table);
  return std::move(table).rows();
}

}  // namespace birefit
