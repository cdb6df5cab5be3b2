#pragma once
// Which entries of the parameter table a scene reads.

#include "birefit/scene.h"

namespace birefit {

/// Calls f(ParameterRef&), of a const scene f(const ParameterRef&), for every reference of the scene, the empty ones
/// included.
template <class SceneOrConst, class F>
void for_each_ref(SceneOrConst& scene, F&& f) {
  const auto uniform = [&](auto& director) {
    for (auto& component : director.axis) f(component);
    f(director.azimuth_deg);
    f(director.tilt_deg);
  };
  if (auto* droplet = std::get_if<Droplet>(&scene.sample)) {
    f(droplet->diameter_um);
    if (auto* radial = std::get_if<RadialDirector>(&droplet->director)) f(radial->twist_deg);
    if (auto* axial = std::get_if<AxialDirector>(&droplet->director)) {
      for (auto* ref : {&axial->reduced_field, &axial->field_v_per_um, &axial->coherence_voltage_v,
                        &axial->local_field_factor, &axial->ring_radius})
        f(*ref);
      f(axial->field_azimuth_deg);
    }
    if (auto* bipolar = std::get_if<BipolarDirector>(&droplet->director))
      for (auto* ref : {&bipolar->azimuth_deg, &bipolar->tilt_deg, &bipolar->pole_distance}) f(*ref);
    if (auto* shell = std::get_if<ShellDirector>(&droplet->director)) {
      f(shell->wall_um);
      for (auto& offset : shell->offset_um) f(offset);
      f(shell->core_index);
    }
  } else if (auto* cell = std::get_if<Cell>(&scene.sample)) {
    f(cell->thickness_um);
    if (auto* director = std::get_if<UniformDirector>(&cell->director)) uniform(*director);
    if (auto* director = std::get_if<TwistedDirector>(&cell->director)) {
      f(director->twist_deg);
      f(director->azimuth_deg);
      f(director->pretilt_deg);
    }
    if (auto* d = std::get_if<FreederickszDirector>(&cell->director))
      for (auto* ref : {&d->reduced_voltage, &d->voltage_v, &d->threshold_v, &d->k33_over_k11, &d->k22_over_k11,
                        &d->eps_ratio, &d->k11_pn, &d->k22_pn, &d->k33_pn, &d->eps_parallel, &d->eps_perpendicular,
                        &d->pretilt_deg, &d->azimuth_deg, &d->twist_deg, &d->pitch_um})
        f(*ref);
    if (auto* d = std::get_if<HelixDirector>(&cell->director))
      for (auto* ref : {&d->pitch_um, &d->azimuth_deg, &d->modulus}) f(*ref);
  } else if (auto* plate = std::get_if<Plate>(&scene.sample)) {
    f(plate->thickness_um);
    uniform(plate->director);
    if (auto* heat = std::get_if<HeatStep>(&plate->heat)) {
      f(heat->fourier_number);
      for (auto* ref : {&heat->time_s, &heat->diffusivity_mm2_s, &heat->cold_k, &heat->hot_k, &heat->initial_k})
        f(*ref);
    }
    f(plate->half_angle_deg);
    f(plate->screen_distance_um);
    f(plate->ring_offset);
  } else if (auto* crystal = std::get_if<Crystal>(&scene.sample)) {
    f(crystal->half_wave_voltage_v);
    f(crystal->bias_v);
    f(crystal->built_in_bias_v);
    f(crystal->slow_axis_deg);
    for (auto& coefficient : crystal->field_legendre) f(coefficient);
    f(crystal->electrode_low_px);
    f(crystal->electrode_high_px);
  } else if (auto* slab = std::get_if<Slab>(&scene.sample)) {
    f(slab->half_angle_deg);
  } else if (auto* disc = std::get_if<StressedDisc>(&scene.sample)) {
    for (auto* ref : {&disc->diameter_um, &disc->thickness_um, &disc->load_n, &disc->stress_optic_brewster,
                      &disc->load_azimuth_deg})
      f(*ref);
    for (auto& coefficient : disc->residual_normal_mpa) f(coefficient);
    for (auto& coefficient : disc->residual_shear_mpa) f(coefficient);
    for (auto& coefficient : disc->illumination) f(coefficient);
  } else if (auto* volume = std::get_if<SampledVolume>(&scene.sample)) {
    f(volume->scale);
  }
  const auto constant_indices = [&](auto& constant) {
    for (auto* ref : {&constant.ordinary, &constant.birefringence, &constant.resonance_nm}) f(*ref);
  };
  const auto dispersion = [&](auto& formula) {
    for (auto& ref : formula.refs) f(ref);
  };
  if (auto* constant = std::get_if<ConstantIndices>(&scene.material)) {
    constant_indices(*constant);
  } else if (auto* e44 = std::get_if<E44Steinberg2020>(&scene.material)) {
    f(e44->temperature_k);
  } else if (auto* law = std::get_if<LawIndices>(&scene.material)) {
    if (auto* constant = std::get_if<ConstantIndices>(&law->indices)) {
      constant_indices(*constant);
    } else if (auto* dispersive = std::get_if<DispersiveIndices>(&law->indices)) {
      dispersion(dispersive->ordinary);
      dispersion(dispersive->extraordinary);
    } else {
      for (auto& set : std::get<FourParameterIndices>(law->indices).sets)
        for (auto* ref :
             {&set.mean_index, &set.mean_slope_per_k, &set.birefringence_0k, &set.exponent, &set.clearing_k})
          f(*ref);
    }
    if (law->haller)
      for (auto* ref : {&law->haller->reference_k, &law->haller->clearing_k, &law->haller->exponent,
                        &law->haller->mean_slope_per_k})
        f(*ref);
    f(law->temperature_k);
    f(law->birefringence_factor);
  }
  f(scene.surround_index);
  if (scene.surround_dispersion) dispersion(*scene.surround_dispersion);
  f(scene.microscope.wavelength_nm);
  f(scene.microscope.polarizer_deg);
  f(scene.microscope.analyzer_deg);
  f(scene.microscope.polarizer_extinction_ratio);
  f(scene.microscope.analyzer_extinction_ratio);
  for (auto* parts : {&scene.microscope.before, &scene.microscope.behind})
    for (auto& part : *parts) {
      if (auto* retarder = std::get_if<Retarder>(&part))
        for (auto* ref : {&retarder->phase_deg, &retarder->retardance_nm, &retarder->azimuth_deg}) f(*ref);
      if (auto* rotator = std::get_if<Rotator>(&part)) f(rotator->angle_deg);
    }
  f(scene.microscope.focus_um);
  f(scene.view.center_x_px);
  f(scene.view.center_y_px);
  f(scene.view.rotation_deg);
  if (scene.view.camera)
    for (auto* ref :
         {&scene.view.camera->tilt_x_deg, &scene.view.camera->tilt_y_deg, &scene.view.camera->half_field_deg})
      f(*ref);
}

}  // namespace birefit
