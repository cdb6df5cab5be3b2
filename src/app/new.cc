// birefit new: commented configs to start from.

#include <iostream>
#include <map>
#include <memory>
#include <string>

#include "app/commands.h"
#include "birefit/error.h"

namespace birefit {
namespace {

const char* const kDroplet =
    R"(# A nematic droplet between polarizers. `birefit fit THIS_FILE` estimates what is marked `fit`.
micrograph:
  image: droplet.tif           # 8 or 16 bit or float; colour images also need channel: r | g | b | mean
  pixel_size_um: 0.05          # of the sample, not of the camera
  gain: {fit: auto}            # counts = gain * intensity + offset
  offset: {fit: auto}
  center_px: {fit: auto}       # found in the image
  # roi_px: [20, 20, 236, 236] # x0, y0, x1, y1, end exclusive
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
  files: "frames/*.tif"        # in natural order: frame2 before frame10
  # set_from: frames.csv       # columns file, then parameter paths: what is known for each frame
  # along: time_s              # the column that the plot is drawn against; it need not be a parameter
  # shared: [sample.droplet.diameter_um]   # fitted, the same in all frames; everything else marked `fit` is each frame's own
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
micrograph:
  image: cell.tif
  gain: {fit: auto}            # known illumination (a calibrated instrument) tells far more than one grey level:
  offset: 0                    # write gain: 1.0e4 if you know it
sample:
  cell:
    thickness_um: 5
    director:
      twisted: {twist_deg: 90, azimuth_deg: 0, pretilt_deg: 0}   # or uniform: {azimuth_deg: 45, tilt_deg: 0}
  material:
    ordinary: 1.52
    birefringence: {value: 0.1, fit: [0.05, 0.15]}
  surround: {index: 1.5}       # the glass; 1.0 when left out
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
)";

const char* const kFreedericksz = R"(# A nematic cell in a field along its normal: how far above its threshold is it?
# For a table of signal against voltage give `signal:` in place of `micrograph:` (docs/configuration.md).
micrograph:
  image: cell.tif
  gain: 1.0e4                  # of one grey level no fit can tell the light from the voltage: calibrate it, or fit several images
  offset: 0
sample:
  cell:
    thickness_um: 5
    director:
      freedericksz:
        reduced_voltage: {value: 1.3, fit: [1, 1.6]}   # V over the threshold of the untwisted cell; or voltage_v and threshold_v
        k33_over_k11: 1.54     # or k11_pn, k33_pn
        eps_ratio: 3.70        # eps_parallel / eps_perpendicular, or both
        pretilt_deg: 1
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
  image: conoscopy.tif
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
  - {image: 400V.png, set: {sample.crystal.bias_v: 400}}
  - {image: 800V.png, set: {sample.crystal.bias_v: 800}}
micrograph:                    # what all of them have in common
  roi_px: [70, 78, 430, 142]   # x0, y0, x1, y1, end exclusive: the bar
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
  image: disc.tif              # camera files are rarely linear: transfer: srgb
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
  image: shell.tif
  pixel_size_um: 0.2
  gain: {fit: auto}
  offset: {fit: auto}
  center_px: {fit: auto}
sample:
  shell:
    diameter_um: {value: 40, fit: auto}
    wall_um: {value: 5, fit: [2, 10]}
    # core_offset_um: [{value: 1, fit: [-3, 3]}, {value: 0, fit: [-3, 3]}, 0]   # the core's centre; the sign of z does not show
    core: {index: 1.42}
  material:
    ordinary: 1.534           # 5CB at 590 nm
    birefringence: 0.173
  surround: {index: 1.42}
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
  objective_na: 0.6
)";

const char* const kVolume = R"(# A director field from a simulation, sampled on a box of nodes, seen along its z.
micrograph:
  image: field.tif
  pixel_size_um: 0.1
  gain: {fit: auto}
  offset: {fit: auto}
  # center_px: [{value: 127.5, fit: [120, 135]}, {value: 127.5, fit: [120, 135]}]   # of the box; the image's middle when left out
  # rotation_deg: {value: 0, fit: [-10, 10]}
sample:
  volume:
    file: field.npy            # NumPy: [z, y, x, component]; or .vti (VTK image data) with n or Q, perhaps S and domain_mask
    spacing_um: [0.2, 0.2, 0.2]  # dx, dy, dz between nodes, of .npy files; a .vti says it itself
    # axes: xyz                # array[x, y, z, component]
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
# physics: {ceiling: wave}     # wave optics in place of straight rays; needs objective_na and surround
)";

}  // namespace

Command add_new_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("new", "print a commented config to start from");
  auto kind = std::make_shared<std::string>();
  command->add_option("KIND", *kind, "droplet, shell, cell, freedericksz, plate, crystal, slab, disc or volume")
      ->required();
  return {command, [kind] {
            const std::map<std::string, const char*> templates = {
                {"droplet", kDroplet}, {"shell", kShell},     {"cell", kCell}, {"freedericksz", kFreedericksz},
                {"plate", kPlate},     {"crystal", kCrystal}, {"slab", kSlab}, {"disc", kDisc},
                {"volume", kVolume},   {"series", kSeries}};
            const auto found = templates.find(*kind);
            if (found == templates.end())
              throw UserError({}, "new " + *kind + ": unknown kind",
                              "known: droplet, shell, cell, freedericksz, plate, crystal, slab, disc, volume");
            std::cout << found->second;
            return kExitDone;
          }};
}

}  // namespace birefit
