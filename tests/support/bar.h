#pragma once
// A crystal bar whose pictures are known in closed form, to be fitted.

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "birefit/fit.h"

namespace birefit::testing {

inline constexpr double kHalfWave = 1500;

/// A crystal bar between crossed polarizers. Its field grows linearly across the bar by +-tilt, so that one image
/// holds a range of phases: intensity = sin^2(pi/2 V/V_half (1 + tilt t)), t in [-1, 1] at the image's edges.
struct Bar {
  FitJob job;
  ParameterRef half_wave, bias, tilt, gain, offset, wavelength, zero, crossed, slow;

  explicit Bar(double bias_v = 700, double tilt_value = 0.4) {
    const auto add = [&](const char* name, double value) {
      Parameter parameter;
      parameter.name = name;
      parameter.value = value;
      return job.parameters.add(parameter);
    };
    half_wave = add("sample.crystal.half_wave_voltage_v", kHalfWave);
    bias = add("sample.crystal.bias_v", bias_v);
    tilt = add("sample.crystal.field_legendre.c1", tilt_value);
    gain = add("micrograph.gain", 1);
    offset = add("micrograph.offset", 0);
    wavelength = add("microscope.light.wavelength_nm", 1550);
    zero = add("microscope.polarizer_deg", 0);
    crossed = add("microscope.analyzer_deg", 90);
    slow = add("sample.crystal.slow_axis_deg", 45);
  }
  void free(ParameterRef ref, double start, double lower, double upper) {
    job.parameters[ref].free = true;
    job.parameters[ref].value = start;
    job.parameters[ref].lower = lower;
    job.parameters[ref].upper = upper;
  }
  void free_linear() {
    for (const ParameterRef ref : {gain, offset}) job.parameters[ref].free = job.parameters[ref].linear = true;
  }
  Picture& add_image(int width, int height, ParameterRef bias_ref, bool uniform = false) {
    Picture micrograph;
    micrograph.name = "frame " + std::to_string(job.measurements.size());
    Crystal crystal;
    crystal.half_wave_voltage_v = half_wave;
    crystal.bias_v = bias_ref;
    crystal.slow_axis_deg = slow;
    if (!uniform) crystal.field_legendre = {tilt};
    Scene& scene = micrograph.scene;
    scene.sample = crystal;
    scene.microscope.wavelength_nm = wavelength;
    scene.microscope.polarizer_deg = zero;
    scene.microscope.analyzer_deg = crossed;
    scene.view.width = width;
    scene.view.height = height;
    scene.view.center_x_px = job.parameters.add_constant("cx", 0.5 * (width - 1));
    scene.view.center_y_px = job.parameters.add_constant("cy", 0.5 * (height - 1));
    scene.view.rotation_deg = zero;
    scene.surround_index = job.parameters.add_constant("surround", 1);
    scene.material = ConstantIndices{job.parameters.add_constant("n", 1), job.parameters.add_constant("dn", 0)};
    micrograph.values = Image(width, height);
    micrograph.mask = Mask(width, height, 1);
    micrograph.gain = gain;
    micrograph.offset = offset;
    job.measurements.push_back(std::move(micrograph));
    return std::get<Picture>(job.measurements.back());
  }
  /// Light and background that are known to be even: errors are those of noise.
  void under_even_light() {
    using Shape = UnevenLight::Shape;
    for (Measurement& measurement : job.measurements)
      for (const auto shape : {Shape::x, Shape::y, Shape::square})
        for (const bool of_intensity : {true, false})
          std::get<Picture>(measurement).uneven.push_back({zero, shape, of_intensity});
  }
};

inline double intensity(double bias, double tilt, int y, int height) {
  const double t = 2 * (y + 0.5) / height - 1;
  const double s = std::sin(std::numbers::pi / 2 * bias / kHalfWave * (1 + tilt * t));
  return s * s;
}

/// value = gain * intensity + offset + noise(x, y, signal).
inline void expose(Picture& micrograph, double gain, double offset, double bias, double tilt,
                   const std::function<double(int, int, double)>& noise) {
  for (int y = 0; y < micrograph.values.height(); ++y)
    for (int x = 0; x < micrograph.values.width(); ++x) {
      const double signal = gain * intensity(bias, tilt, y, micrograph.values.height()) + offset;
      micrograph.values(x, y) = signal + noise(x, y, signal);
    }
}

struct Gaussian {
  std::mt19937_64 random;
  std::normal_distribution<double> normal;
  explicit Gaussian(unsigned seed) : random(seed) {}
  double operator()() { return normal(random); }
};

inline int index_of(const FitResult& result, const std::string& name) {
  for (std::size_t i = 0; i < result.names.size(); ++i)
    if (result.names[i] == name) return static_cast<int>(i);
  ADD_FAILURE() << name;
  return 0;
}
inline const ParameterEstimate& estimate(const FitResult& result, const std::string& name) {
  return result.parameters[index_of(result, name)];
}

}  // namespace birefit::testing
