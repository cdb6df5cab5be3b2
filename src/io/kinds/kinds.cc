#include "io/kinds/kinds.h"

#include <cmath>

#include <fmt/format.h>

namespace birefit {
namespace {

const char* const kDroplet =
    R"(# A nematic droplet between polarizers. `birefit fit THIS_FILE` estimates what is marked `fit`.
micrograph:
  image: droplet.png           # 8 or 16 bit or float; colour images also need channel: r | g | b | mean
  pixel_size_um: 0.05          # of the sample, not of the camera
  gain: {fit: auto}            # counts = gain * intensity + offset
  offset: {fit: auto}
  center_px: {fit: auto}       # found in the image
  # roi_px: [20, 20, 220, 220] # x0, y0, x1, y1, end exclusive
sample:
  droplet:
    diameter_um: {value: 9.3, fit: [8.5, 10.0]}
    director: {radial: {}}     # radial hedgehog
  material:
    ordinary: 1.52
    birefringence: {value: 0.2, fit: [0.1, 0.3]}
  surround: {index: 1.43}      # of the host around the droplet
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0             # from +x, counter-clockwise in the image
  analyzer_deg: 90
  objective_na: 0.8
)";

const char* const kSeries = R"(# A time series of droplets, a fit each: birefit series THIS_FILE --out DIR [--resume]
micrographs:
  files: "frames/*.png"        # in natural order: frame2 before frame10
  # set_from: frames.csv       # columns file, then parameter paths: what is known for each frame
  # along: time_s              # the column that the plot is drawn against; it need not be a parameter
  # shared: [sample.droplet.diameter_um]   # the same in all frames; all else marked `fit` is each frame's own
micrograph:
  pixel_size_um: 0.05          # of the sample, not of the camera
  gain: {fit: auto}            # counts = gain * intensity + offset
  offset: {fit: auto}
  center_px: {fit: auto}       # found in each image
sample:
  droplet:
    diameter_um: {value: 9.3, fit: [8.5, 10.0]}
    director: {radial: {}}
  material:
    ordinary: 1.52
    birefringence: {value: 0.2, fit: [0.1, 0.3]}
  surround: {index: 1.43}
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
  objective_na: 0.8
)";

const char* const kCell = R"(# A flat cell seen along its normal, for example 90 degrees twisted nematic.
micrographs:                   # one grey level is one number: turn the polarizers, and take the light without the cell
  - {image: crossed.png, set: {microscope.polarizer_deg: 0, microscope.analyzer_deg: 90}}
  - {image: parallel.png, set: {microscope.polarizer_deg: 0, microscope.analyzer_deg: 0}}
  - {image: turned.png, set: {microscope.polarizer_deg: 45, microscope.analyzer_deg: 45}}
  - {image: oblique.png, set: {microscope.polarizer_deg: 20, microscope.analyzer_deg: 80}}
  - image: empty_parallel.png
    set: {microscope.polarizer_deg: 0, microscope.analyzer_deg: 0, sample.material.birefringence: 0}
  - image: empty_crossed.png
    set: {microscope.polarizer_deg: 0, microscope.analyzer_deg: 90, sample.material.birefringence: 0}
micrograph:                    # what all of them have in common
  gain: {fit: auto}            # counts = gain * intensity + offset
  offset: {fit: auto}
sample:
  cell:
    thickness_um: 5
    director:
      twisted: {twist_deg: {value: 90, fit: [70, 110]}, azimuth_deg: 10}   # or uniform: {azimuth_deg: 45, tilt_deg: 0}
  material:
    ordinary: 1.52
    birefringence: {value: 0.12, fit: [0.09, 0.17]}
  surround: {index: 1.5}       # the glass; 1.0 when left out
microscope:
  light: {wavelength_nm: 590}
)";

const char* const kFreedericksz =
    R"(# A nematic cell in a field along its normal: its threshold and thickness, from its light against the voltage.
# Of images: micrographs: [{image: 1V.png, set: {sample.cell.director.freedericksz.voltage_v: 1}}, ..]
signal:
  file: sweep.csv              # numbers under a line of names
  value: photodiode_v          # the column that was measured, in any unit
  columns: {sample.cell.director.freedericksz.voltage_v: volts}   # which parameter a column sets, row by row
sample:
  cell:
    thickness_um: {value: 5, fit: [4.8, 5.3]}   # start within a fringe
    director:
      freedericksz:
        threshold_v: {value: 1, fit: [0.8, 1.2]}
        k33_over_k11: 1.54     # or k11_pn, k33_pn
        eps_ratio: 3.70        # eps_parallel / eps_perpendicular, or both
        pretilt_deg: {value: 1, fit: [0.2, 8]}
        azimuth_deg: 45
        # anchoring: planar    # planar, homeotropic or hybrid
        # twist_deg: 90        # twisted nematic: needs k22_over_k11 (or k22_pn) too
  material:
    ordinary: 1.52
    birefringence: 0.2
  surround: {index: 1.5}       # the glass; 1.0 when left out
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
)";

const char* const kPlate = R"(# A heated plate in a converging cone: pixel radius is proportional to tan(incidence).
micrograph:
  image: conoscopy.png
  gain: {fit: auto}
  offset: {fit: auto}
sample:
  plate:
    thickness_um: 800
    director: {uniform: {axis: [-0.353553, 0.353553, -0.866025]}}
    heat:                      # a step of the temperature at one face; T rises with depth
      fourier_number: {value: 0.1, fit: [0.005, 0.5]}
      cold_k: 278
      hot_k: 368
    view: {half_angle_deg: 15} # incidence at half the smaller side of the image
  material: {name: E44-steinberg2020}
microscope:
  light: {wavelength_nm: 640}
  polarizer_deg: 0
  analyzer_deg: 90
)";

const char* const kCrystal = R"(# A cubic crystal bar between electrodes: the applied voltage makes it birefringent.
micrographs:                   # frames share every parameter that their `set` does not name
  - {image: 300V.png, set: {sample.crystal.bias_v: 300}}
  - {image: 600V.png, set: {sample.crystal.bias_v: 600}}
  - {image: 900V.png, set: {sample.crystal.bias_v: 900}}
  - {image: 1200V.png, set: {sample.crystal.bias_v: 1200}}
micrograph:                    # what all of them have in common
  roi_px: [10, 10, 150, 50]    # x0, y0, x1, y1, end exclusive: the bar
  gain: {fit: auto}
  offset: {fit: auto}
calibration: {dark: dark.png, parallel: parallel.png, crossed: crossed_0V.png}
sample:
  crystal:
    half_wave_voltage_v: {value: 1500, fit: [800, 3000]}
    field_along: y             # from electrode to electrode in the image
microscope:
  light: {wavelength_nm: 1550}
  polarizer_deg: 0
  analyzer_deg: 90
)";

const char* const kSlab =
    R"(# A depth profile: `birefit jones THIS_FILE --out jones.csv` gives its transmission matrices.
sample:
  slab:
    profile: profile.csv       # columns depth_um, ax, ay, az, n_o, n_e and optionally k_o, k_e
    interpolation: constant    # constant | linear | cubic
  surround: {index: 1.0}
microscope:
  light: {wavelength_nm: 590}
  directions:                  # in the outside medium
    - {theta_deg: 0, azimuth_deg: 0}
    - {theta_deg: 20, azimuth_deg: 30}
)";

const char* const kDisc = R"(# A photoelastic disc pressed together across its diameter, in a polariscope.
micrograph:
  image: disc.png              # camera files are rarely linear: transfer: srgb
  pixel_size_um: 85            # on the disc
  center_px: [80, 79]          # or fitted: [{value: 80, fit: [77, 83]}, {value: 79, fit: [76, 82]}]
  gain: {fit: auto}
  offset: {fit: auto}
sample:
  disc:
    diameter_um: 12000
    stress_optic_brewster: 50  # 1e-12/Pa. One image tells stress_optic * load / wavelength / radius only:
    load_n: {value: 280, fit: [100, 600]}   # fit this, or the coefficient with a known load, not both
    load_azimuth_deg: 90       # of the line of the two forces, from +x
    contact_radius_um: 600     # around the forces nothing is fitted
    # thickness_um: 6000       # matters for residual stress only:
    # residual: {normal_mpa: [{value: 0, fit: [-1, 1]}], shear_mpa: [{value: 0, fit: [-1, 1]}]}
microscope:
  light: {wavelength_nm: 546}
  polarizer_deg: 0
  analyzer_deg: 90
  quarter_wave: true           # circular polariscope: no isoclinics; false: plane polariscope
)";

const char* const kShell = R"(# A shell of nematic liquid crystal with normal anchoring at both surfaces.
micrograph:
  image: shell.png
  pixel_size_um: 0.1
  gain: {fit: auto}
  offset: {fit: auto}
  center_px: {fit: auto}
sample:
  shell:
    diameter_um: {value: 14, fit: auto}
    wall_um: {value: 2.5, fit: [1.5, 4]}
    # core_offset_um: [{value: 1, fit: [-3, 3]}, {value: 0, fit: [-3, 3]}, 0]   # the core's; z's sign does not show
    core: {index: 1.48}
  material:
    ordinary: 1.534           # 5CB at 590 nm
    birefringence: 0.173
  surround: {index: 1.48}
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
  objective_na: 0.6
)";

const char* const kVolume = R"(# A director field from a simulation, sampled on a box of nodes, seen along its z.
micrograph:
  image: field.png
  pixel_size_um: 0.1
  gain: {fit: auto}
  offset: {fit: auto}
  # center_px: [{value: 47.5, fit: [40, 55]}, {value: 47.5, fit: [40, 55]}]   # of the box; else the image's middle
  # rotation_deg: {value: 0, fit: [-10, 10]}
sample:
  volume:
    file: field.vti            # VTK image data with n or Q, perhaps S, domain_mask; or .npy, .npz, .vtk, open-Qmin's
    # spacing_um: [0.2, 0.2, 0.2]  # dx, dy, dz between nodes, of .npy and .npz; a .vti says it itself
    # axes: xyz                # of .npy: array[x, y, z, component]; default zyx
    # scale: {value: 1, fit: [0.9, 1.1]}   # of the whole box
    # bulk_order: 0.53         # the S that the birefringence below belongs to; the file's largest when left out
  material:
    ordinary: 1.52
    birefringence: {value: 0.1, fit: [0.05, 0.15]}
  # surround: {index: 1.5}     # around the box, and in it where there is no liquid crystal; for waves only
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
  # objective_na: 0.6
accuracy: {intensity: 3.0e-3}  # a third of the noise of a bright pixel; the default, 1e-4, takes much longer
# physics: {ceiling: wave}     # wave optics in place of straight rays; needs objective_na and surround
)";

/// A box of 6 x 6 x 2.4 um whose director turns along x and splays along y.
std::string demo_field() {
  constexpr int kNodes = 25, kLayers = 7;
  constexpr double kStep = 0.25, kLayer = 0.4;
  std::string text = fmt::format(
      "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
      "<ImageData WholeExtent=\"0 {0} 0 {0} 0 {1}\" Origin=\"0 0 0\" Spacing=\"{2} {2} {3}\">\n"
      "<Piece Extent=\"0 {0} 0 {0} 0 {1}\">\n<PointData>\n"
      "<DataArray type=\"Float32\" Name=\"n\" NumberOfComponents=\"3\" format=\"ascii\">\n",
      kNodes - 1, kLayers - 1, kStep, kLayer);
  for (int z = 0; z < kLayers; ++z)
    for (int y = 0; y < kNodes; ++y)
      for (int x = 0; x < kNodes; ++x) {
        const double azimuth = M_PI * x / (kNodes - 1), tilt = M_PI / 2 * y / (kNodes - 1);
        text += fmt::format("{:.4f} {:.4f} {:.4f}\n", std::cos(tilt) * std::cos(azimuth),
                            std::cos(tilt) * std::sin(azimuth), std::sin(tilt));
      }
  return text + "</DataArray>\n</PointData>\n</Piece>\n</ImageData>\n</VTKFile>\n";
}

/// Layers that turn by 90 degrees.
std::string demo_profile() {
  constexpr int kLayers = 20;
  std::string text = "depth_um,ax,ay,az,n_o,n_e\n";
  for (int i = 0; i < kLayers; ++i) {
    const double azimuth = M_PI / 2 * (i + 0.5) / kLayers;
    text += fmt::format("{:.3g},{:.6f},{:.6f},0,1.52,1.72\n", 0.2 * (i + 1), std::cos(azimuth), std::sin(azimuth));
  }
  return text;
}

Kind of_fit(const char* name, const char* words, const char* config, int width, int height, double gain = 3200,
            double offset = 150) {
  return {name, words, config, "fit", width, height, gain, offset, {}, {}, {}};
}

std::vector<Kind> all_kinds() {
  const std::string polarizer = "microscope.polarizer_deg=", analyzer = "microscope.analyzer_deg=",
                    empty = "sample.material.birefringence=0",
                    bias = "sample.crystal.bias_v=", birefringence = "sample.material.birefringence=";
  std::vector<Kind> all;
  const auto add = [&](Kind kind) -> Kind& { return all.emplace_back(std::move(kind)); };

  Kind& droplet =
      add(of_fit("droplet", "liquid-crystal droplet, PDLC, emulsion, hedgehog, radial, bipolar, Maltese cross",
                 kDroplet, 240, 240));
  droplet.truth = {{"sample.droplet.diameter_um", 9.12}, {"sample.material.birefringence", 0.187}};
  droplet.pictures = {{"droplet.png", {}}};

  Kind& shell = add(of_fit("shell", "liquid-crystal shell, double emulsion, capsule, vesicle wall", kShell, 176, 176));
  shell.truth = {{"sample.shell.diameter_um", 14.4}, {"sample.shell.wall_um", 2.3}};
  shell.pictures = {{"shell.png", {}}};

  Kind& cell = add(of_fit(
      "cell", "film, LCD, twisted nematic, cholesteric, wave plate, retarder, mica, tape, Michel-Levy", kCell, 32, 32));
  cell.truth = {{"sample.cell.director.twisted.twist_deg", 84}, {"sample.material.birefringence", 0.131}};
  cell.pictures = {{"crossed.png", {polarizer + "0", analyzer + "90"}},
                   {"parallel.png", {polarizer + "0", analyzer + "0"}},
                   {"turned.png", {polarizer + "45", analyzer + "45"}},
                   {"oblique.png", {polarizer + "20", analyzer + "80"}},
                   {"empty_parallel.png", {polarizer + "0", analyzer + "0", empty}},
                   {"empty_crossed.png", {polarizer + "0", analyzer + "90", empty}}};

  Kind& freedericksz = add(of_fit(
      "freedericksz", "cell in a voltage, threshold, variable retarder, modulator, hysteresis, a table of signal",
      kFreedericksz, 0, 0, 2.5, 0.1));
  freedericksz.truth = {{"sample.cell.thickness_um", 5.08},
                        {"sample.cell.director.freedericksz.threshold_v", 0.96},
                        {"sample.cell.director.freedericksz.pretilt_deg", 2}};

  Kind& plate = add(of_fit(
      "plate",
      "conoscopy, interference figure, isogyres, isochromes, converging light, heated plate, ring radii on a screen",
      kPlate, 160, 160));
  plate.truth = {{"sample.plate.heat.fourier_number", 0.13}};
  plate.pictures = {{"conoscopy.png", {}}};

  Kind& crystal =
      add(of_fit("crystal", "Pockels effect, electro-optic crystal, CdZnTe, field in a bar, half-wave voltage",
                 kCrystal, 160, 60, 3000, 0));
  crystal.truth = {{"sample.crystal.half_wave_voltage_v", 1640}};
  crystal.pictures = {{"300V.png", {bias + "300"}},     {"600V.png", {bias + "600"}},
                      {"900V.png", {bias + "900"}},     {"1200V.png", {bias + "1200"}},
                      {"crossed_0V.png", {bias + "0"}}, {"parallel.png", {bias + "0", analyzer + "0"}},
                      {"dark.png", {bias + "0"}, true}};

  Kind& slab = add(
      of_fit("slab", "stratified medium, depth profile, multilayer, Jones matrices, chiral film", kSlab, 0, 0, 0, 0));
  slab.command = "jones";
  slab.files = {{"profile.csv", demo_profile()}};

  Kind& disc = add(of_fit("disc", "photoelasticity, stress, isochromatics, granular discs, Brazilian test, polariscope",
                          kDisc, 160, 160));
  disc.truth = {{"sample.disc.load_n", 311}};
  disc.pictures = {{"disc.png", {}}};

  Kind& volume =
      add(of_fit("volume", "simulation, director field, Q tensor, open-Qmin, Nemaktis, VTK, NumPy", kVolume, 96, 96));
  volume.truth = {{"sample.material.birefringence", 0.112}};
  volume.pictures = {{"field.png", {}}};
  volume.files = {{"field.vti", demo_field()}};

  Kind& series =
      add(of_fit("series", "time-lapse, video, frames, temperature or voltage ramp, stack", kSeries, 240, 240));
  series.command = "series";
  series.truth = {{"sample.droplet.diameter_um", 9.12}};
  series.pictures = {{"frames/t0.png", {birefringence + "0.190"}},
                     {"frames/t1.png", {birefringence + "0.185"}},
                     {"frames/t2.png", {birefringence + "0.179"}}};
  return all;
}

}  // namespace

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = all_kinds();
  return all;
}

}  // namespace birefit
