#include "wave/fft.h"

#include <algorithm>
#include <mutex>
#include <utility>

#ifdef BIREFIT_KISSFFT
#include <kissfft.hh>
#else
#include <fftw3.h>
#endif

namespace birefit {

int fast_fft_size(int n) {
  // Products of 2 and 5 with few fives: on these both libraries are fastest for their size (measured), and there is
  // always one within a quarter of n.
  for (int size = n + n % 2;; size += 2) {
    int left = size, fives = 0;
    while (left % 2 == 0) left /= 2;
    while (left % 5 == 0) left /= 5, ++fives;
    if ((left == 1 && fives <= 2) || (left == 3 && fives == 0 && size < 100)) return size;
  }
}

#ifdef BIREFIT_KISSFFT

struct Fft2::Plans {
  kissfft<double> rows[2], columns[2];  // forward, inverse
  void run(int direction, int width, int height, Plane& plane) const {
    const std::size_t w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
    thread_local std::vector<std::complex<double>> line;
    line.resize(std::max(w, h));
    for (std::size_t y = 0; y < h; ++y) {
      rows[direction].transform(plane.data() + y * w, line.data());
      std::copy_n(line.data(), w, plane.data() + y * w);
    }
    for (std::size_t x = 0; x < w; ++x) {
      columns[direction].transform(plane.data() + x, line.data(), 0, 1, w);
      for (std::size_t y = 0; y < h; ++y) plane[y * w + x] = line[y];
    }
  }
};

Fft2::Fft2(int width, int height)
    : width_(width),
      height_(height),
      plans_(new Plans{{{static_cast<std::size_t>(width), false}, {static_cast<std::size_t>(width), true}},
                       {{static_cast<std::size_t>(height), false}, {static_cast<std::size_t>(height), true}}}) {}
Fft2::~Fft2() = default;
void Fft2::forward(Plane& plane) const { plans_->run(0, width_, height_, plane); }
void Fft2::inverse(Plane& plane) const { plans_->run(1, width_, height_, plane); }

#else

namespace {

/// FFTW's planner is not for two threads at once; its transforms are.
std::mutex& planner() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

struct Fft2::Plans {
  fftw_plan steps[2][2];  // forward, inverse; columns, rows
  void run(int direction, Plane& plane) const {
    thread_local Plane other;
    if (other.size() < plane.size()) other.resize(plane.size());
    auto *here = reinterpret_cast<fftw_complex*>(plane.data()), *there = reinterpret_cast<fftw_complex*>(other.data());
    fftw_execute_dft(steps[direction][0], here, there);
    fftw_execute_dft(steps[direction][1], there, here);
  }
};

Fft2::Fft2(int width, int height) : width_(width), height_(height), plans_(new Plans) {
  Plane plane(size()), other(size());
  auto *here = reinterpret_cast<fftw_complex*>(plane.data()), *there = reinterpret_cast<fftw_complex*>(other.data());
  const std::lock_guard lock(planner());
  // Measured plans would differ from run to run, and with them the last bits. Of the estimated ones those from one
  // array to another and back are the fastest, columns first: in place they copy (up to twice the time), and as one
  // transform of two dimensions too.
  for (int i = 0; i < 2; ++i) {
    const int sign = i == 0 ? FFTW_FORWARD : FFTW_BACKWARD;
    plans_->steps[i][0] =
        fftw_plan_many_dft(1, &height, width, here, nullptr, width, 1, there, nullptr, width, 1, sign, FFTW_ESTIMATE);
    plans_->steps[i][1] =
        fftw_plan_many_dft(1, &width, height, there, nullptr, 1, width, here, nullptr, 1, width, sign, FFTW_ESTIMATE);
  }
}
Fft2::~Fft2() {
  const std::lock_guard lock(planner());
  for (auto& direction : plans_->steps)
    for (fftw_plan step : direction) fftw_destroy_plan(step);
}
void Fft2::forward(Plane& plane) const { plans_->run(0, plane); }
void Fft2::inverse(Plane& plane) const { plans_->run(1, plane); }

#endif

}  // namespace birefit
