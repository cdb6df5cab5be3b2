# A folder with a config for the tests of `birefit view`, in the working folder. Needs source_dir.
. "$source_dir/tests/support/crystal_frames.sh"
mkdir inner
# A name that a careless page would run.
image='f<img src=x onerror=alert(1)>.tif'
expose "inner/$image" 700 1
cat > inner/crystal.yaml << YAML
# What the user wrote stays.
micrograph:
  image: "$image"
  gain: {fit: auto}
  offset: {fit: auto}
sample:
  crystal:
    half_wave_voltage_v: {value: 1400, fit: [1000, 2500]}   # of the maker
    bias_v: 700
    field_along: y
    electrodes_px: [-0.5, 47.5]
    field_legendre: [{value: 0.3, fit: [0.1, 0.7]}]
microscope:
  light: {wavelength_nm: 1550}
  polarizer_deg: 0
  analyzer_deg: 90
YAML
