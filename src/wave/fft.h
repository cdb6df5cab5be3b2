#pragma once
// Two-dimensional complex Fourier transforms of one size, in place. The one place that knows the library that does
// them: FFTW, or kissfft where its licence (permissive; FFTW's is the GPL) matters more than speed (README.md,
// "Licence").

#include <complex>
#include <cstddef>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace birefit {

/// Memory aligned to 64 bytes, as the transforms want it.
template <class T>
struct AlignedAllocator {
  using value_type = T;
  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) {}  // NOLINT: containers rebind
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new (n * sizeof(T), std::align_val_t{64})); }
  /// Plain numbers stay what the memory held: writing to a table that is filled later costs as much as filling it.
  template <class U>
  void construct(U* p) {
    ::new (static_cast<void*>(p)) U;
  }
  template <class U, class... Args>
  void construct(U* p, Args&&... args) {
    ::new (static_cast<void*>(p)) U(std::forward<Args>(args)...);
  }
  void deallocate(T* p, std::size_t) { ::operator delete (p, std::align_val_t{64}); }
  friend bool operator==(const AlignedAllocator&, const AlignedAllocator&) { return true; }
};
/// height rows of width values, row after row.
using Plane = std::vector<std::complex<double>, AlignedAllocator<std::complex<double>>>;

/// Frequency index m in [0, n) stands for m or, from n/2 on, m - n. Calls from several threads at once are fine. Same
/// bits for the same input, whatever ran before.
class Fft2 {
 public:
  /// Any sizes >= 1; those of fast_fft_size are fast.
  Fft2(int width, int height);
  ~Fft2();
  Fft2(const Fft2&) = delete;
  Fft2& operator=(const Fft2&) = delete;
  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t size() const { return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_); }
  /// F(m, l) = sum f(x, y) exp(-2 pi i (m x / width + l y / height)).
  void forward(Plane& plane) const;
  /// The same with +i, not divided by anything.
  void inverse(Plane& plane) const;

 private:
  struct Plans;
  int width_, height_;
  std::unique_ptr<Plans> plans_;
};

/// The cheapest good size >= n; even.
int fast_fft_size(int n);

}  // namespace birefit
