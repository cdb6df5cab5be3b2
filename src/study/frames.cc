#include "study/frames.h"

#include "study/rays.h"

namespace birefit::study {
namespace {

/// The medium of a column as the rows of a profile, to be joined by splines.
SlabProfile profile_of(const Column<double>& column, int rows) {
  SlabProfile profile;
  profile.interpolation = SlabProfile::Interpolation::cubic;
  for (int i = 0; i < rows; ++i) {
    const double u = static_cast<double>(i) / (rows - 1);
    OpticalPoint<double> p;
    column.sample({&u, 1}, &p);
    const Complex<double> n_o = sqrt(Complex<double>(p.ordinary, p.ordinary_im)),
                          n_e = sqrt(Complex<double>(p.extraordinary, p.extraordinary_im));
    profile.rows.push_back({u * p.depth_slope_um, p.axis.x, p.axis.y, p.axis.z, n_o.re, n_e.re, n_o.im, n_e.im});
  }
  return profile;
}

std::vector<int> indices(const std::vector<ParameterRef>& list) {
  std::vector<int> out;
  for (const ParameterRef& ref : list) out.push_back(ref.index);
  return out;
}

}  // namespace

std::vector<FrameScene> frame_scenes() {
  std::vector<FrameScene> all(4);
  for (int i = 0; i < 4; ++i) {
    FrameScene& f = all[static_cast<std::size_t>(i)];
    f.scene.view.width = f.scene.view.height = 500;
    f.scene.microscope.polarizer_deg = f.table.add_constant("polarizer_deg", 0);
    f.scene.microscope.analyzer_deg = f.table.add_constant("analyzer_deg", 90);
    if (i == 3) {
      f.name = "evaluation_slab";
      Slab slab;
      slab.profile = profile_of(*ray_column<double>("evaluation_slab", 0.0), 17);
      slab.half_angle_deg = f.table.add_constant("half_angle_deg", 15);
      f.scene.sample = slab;
      f.scene.surround_index = f.table.add_constant("index", 1.0);
      f.scene.microscope.wavelength_nm = f.table.add_constant("wavelength_nm", 500);
      f.scene.view.center_x_px = f.table.add_constant("center_x", 249.8);
      f.scene.view.center_y_px = f.table.add_constant("center_y", 250.3);
      f.parameters = indices({slab.half_angle_deg, f.scene.microscope.wavelength_nm, f.scene.view.center_x_px,
                              f.scene.view.center_y_px, f.scene.surround_index, f.scene.microscope.analyzer_deg,
                              f.scene.microscope.polarizer_deg});
      continue;
    }
    if (i == 2) {
      f.name = "e44_plate";
      Plate plate;
      plate.thickness_um = f.table.add_constant("thickness_um", 800);
      plate.director.axis = {f.table.add_constant("x", -0.353553), f.table.add_constant("y", 0.353553),
                             f.table.add_constant("z", -0.866025)};
      HeatStep heat;
      heat.fourier_number = f.table.add_constant("fourier_number", 0.1);
      heat.cold_k = f.table.add_constant("cold_k", 278);
      heat.hot_k = f.table.add_constant("hot_k", 368);
      plate.heat = heat;
      plate.half_angle_deg = f.table.add_constant("half_angle_deg", 15);
      f.scene.sample = plate;
      f.scene.material = E44Steinberg2020{};
      f.scene.surround_index = f.table.add_constant("index", 1.0);
      f.scene.microscope.wavelength_nm = f.table.add_constant("wavelength_nm", 640);
      f.scene.view.center_x_px = f.table.add_constant("center_x", 249.8);
      f.scene.view.center_y_px = f.table.add_constant("center_y", 250.3);
      f.parameters = indices({heat.fourier_number, plate.thickness_um, f.scene.view.center_x_px,
                              f.scene.view.center_y_px, plate.half_angle_deg, heat.hot_k,
                              f.scene.microscope.wavelength_nm, f.scene.microscope.analyzer_deg});
      continue;
    }
    f.name = i == 0 ? "hedgehog" : "twisted_droplet";
    Droplet droplet;
    droplet.diameter_um = f.table.add_constant("diameter_um", 9);
    if (i == 1) droplet.director = RadialDirector{f.table.add_constant("twist_deg", 60)};
    f.scene.sample = droplet;
    ConstantIndices material;
    material.ordinary = f.table.add_constant("ordinary", 1.52);
    material.birefringence = f.table.add_constant("birefringence", 0.22);
    f.scene.material = material;
    f.scene.surround_index = f.table.add_constant("index", 1.43);
    f.scene.microscope.wavelength_nm = f.table.add_constant("wavelength_nm", 590);
    f.scene.view.pixel_size_um = f.table.add_constant("pixel_size_um", 0.025);
    f.scene.view.center_x_px = f.table.add_constant("center_x", 249.8);
    f.scene.view.center_y_px = f.table.add_constant("center_y", 250.3);
    f.parameters = indices({droplet.diameter_um, material.birefringence, f.scene.view.center_x_px,
                            f.scene.view.center_y_px, material.ordinary, f.scene.surround_index,
                            f.scene.microscope.wavelength_nm, f.scene.microscope.analyzer_deg});
  }
  return all;
}

}  // namespace birefit::study
