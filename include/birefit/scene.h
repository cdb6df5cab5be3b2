#pragma once
// What is in front of the camera: a sample, its material and surround, the microscope; how it is computed is a Demand
// (demand.h). A scene is immutable and holds no numbers of its own: every number that may vary is a ParameterRef into
// the job's table (parameters.h). Frames, signs and units: docs/conventions.md. Sources: docs/methods.md.

#include <optional>
#include <string>

#include "birefit/material.h"
#include "birefit/microscope.h"
#include "birefit/sample.h"

namespace birefit {

/// A camera that looks at a cone's screen from the side: a pinhole whose axis points at the cone's middle.
struct SideCamera {
  /// it stands in the direction (tan tilt_x, tan tilt_y, 1) of the screen, x right, y up; [-80, 80]
  ParameterRef tilt_x_deg, tilt_y_deg;
  /// what half the picture's smaller side subtends, [0, 60]; 0: from far away, no perspective
  ParameterRef half_field_deg;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("tilt_x_deg", self.tilt_x_deg, numbers::angle(-80, 80).or_else(0),
                 "it stands in the direction (tan tilt_x, tan tilt_y, 1) of the screen");
    visit.number("tilt_y_deg", self.tilt_y_deg, numbers::angle(-80, 80).or_else(0), "the same");
    visit.number("half_field_deg", self.half_field_deg, numbers::angle(0, 60).physical().or_else(0),
                 "what half the picture's smaller side subtends; 0: from far away");
  }
};

/// Which pixels of a file a view's are: `bin` x `bin` of them each, from (x0, y0) on.
struct FilePixels {
  int x0 = 0, y0 = 0, bin = 1;
  int width = 0, height = 0;  ///< of the file's image; 0: as large as the view
};

/// How pixels lie on the sample.
struct View {
  int width = 0, height = 0;   ///< pixels of the picture
  FilePixels file;             ///< where these are in the file's image
  ParameterRef pixel_size_um;  ///< on the sample; none for conoscopic plates, cells and crystals, which need none
  ParameterRef center_x_px;    ///< sample centre; pixel centres are integers, (0, 0) the top left pixel's
  ParameterRef center_y_px;
  ParameterRef rotation_deg;         ///< of the sample, counter-clockwise as seen in the image
  std::optional<SideCamera> camera;  ///< of plates and slabs in a cone; none: it looks along the cone's axis

  /// Width of the file's whole image, in the view's pixels.
  double whole_width() const { return file.width > 0 ? static_cast<double>(file.width) / file.bin : width; }
  /// Height of the same.
  double whole_height() const { return file.height > 0 ? static_cast<double>(file.height) / file.bin : height; }
  /// Column of the middle of the file's whole image, in the view's pixels; may lie outside of the view.
  double middle_x() const { return 0.5 * (whole_width() - 1) - static_cast<double>(file.x0) / file.bin; }
  /// Row of the same.
  double middle_y() const { return 0.5 * (whole_height() - 1) - static_cast<double>(file.y0) / file.bin; }

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("pixel_size_um", self.pixel_size_um, numbers::length_um(1000).left_out().known_within_share(0.005),
                 "on the sample; the file's own where it states one");
    visit.number("center_px.x", self.center_x_px, numbers::within(-1e6, 1e6, "px").left_out(),
                 "of the sample; not given: the image's middle");
    visit.number("center_px.y", self.center_y_px, numbers::within(-1e6, 1e6, "px").left_out(),
                 "of the sample; not given: the image's middle");
    visit.number("rotation_deg", self.rotation_deg, numbers::angle().or_else(0), "of the sample, counter-clockwise");
    visit.inside("camera", self.camera);
  }
};

/// Imaginary parts of the indices: a wave of extraordinary polarization falls off as exp(-2 k0 k_e depth) in intensity,
/// an ordinary one by k_o (pleochroism, dichroism). Of cells and plates.
struct Absorption {
  double wavelength_nm = 0;  ///< vacuum, where they hold; 0: at all wavelengths
  ParameterRef ordinary, extraordinary;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.number("ordinary", self.ordinary, numbers::within(0, 1).or_else(0), "imaginary part of n_o");
    visit.number("extraordinary", self.extraordinary, numbers::within(0, 1).or_else(0), "imaginary part of n_e");
  }
};

/// Everything that decides what a picture looks like but the values of its parameters.
struct Scene {
  Sample sample;
  Material material;
  /// None: transparent. Several: by growing wavelength, linear in between, as at the first and the last beyond.
  std::vector<Absorption> absorption;
  ParameterRef surround_index;                    ///< of the isotropic medium around the sample
  std::optional<Dispersion> surround_dispersion;  ///< instead of surround_index
  Microscope microscope;
  View view;

  template <class Self, class Visit>
  static void describe(Self& self, Visit&& visit) {
    visit.inside("sample", self.sample);
    visit.inside("sample.material", self.material);
    visit.inside("sample.material.absorption", self.absorption);
    visit.number("sample.surround.index", self.surround_index, numbers::tabulated_index().left_out(),
                 "of what is around the sample");
    visit.inside("sample.surround.file", self.surround_dispersion);
    visit.inside("microscope", self.microscope);
    visit.inside("micrograph", self.view);
  }
};

}  // namespace birefit
