#!/usr/bin/env bash
# White light and colour cameras: a photograph fitted in all its colours, rendered, and read by its colours.
# usage: colour.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }

# All three colours at once: the truth within three standard errors and a thousandth, which its makers' sums hold.
"$birefit" fit "$source/fit_configs/colour_droplet.yaml" --out colours > colours.txt 2> colours.err || fail "colours: $(tail -3 colours.err)"
while IFS=, read -r name value; do
  [[ $name == name ]] && continue
  awk -v name="$name" -v truth="$value" '
    $1 == name && $2 == "=" { found = 1; off = $3 - truth; most = 3 * $5 + 0.001 * truth; inside = $5 > 0 && off * off < most * most }
    END { exit !(found && inside) }' colours.txt || fail "colours: $name = $value is not $(grep -m1 "$name" colours.txt)"
done < "$source/data/colour_droplet/truth.csv"

# In other light, or by another camera, than is stated: no answer, or an interval that holds the truth.
for wrong in microscope.light.lamp=E microscope.camera.sensitivity=cie_1931; do
  "$birefit" fit "$source/fit_configs/colour_droplet.yaml" --set "$wrong" --out wrong > wrong.txt 2> /dev/null || continue
  grep -q '"grade": "answer with misfit"' wrong/fit.json || fail "$wrong: a plain answer"
  awk -v truth=0.165 '$1 == "sample.material.birefringence" { gsub(/[\[\]]/, ""); for (i = 1; i < NF; ++i) if ($i == "..") inside = $(i - 1) <= truth && truth <= $(i + 1) }
    END { exit !inside }' wrong.txt || fail "$wrong: $(grep -m1 birefringence wrong.txt)"
done

cat > cell.yaml <<'Y'
image_size_px: [6, 4]
micrograph: {channel: rgb, gain: 1, offset: 0}
sample:
  cell: {thickness_um: 5, director: {uniform: {azimuth_deg: 45, tilt_deg: 0}}}
  material: {ordinary: 1.5, birefringence: 0.2, resonance_nm: 220}
  surround: {index: 1.5}
physics: {ceiling: e_only}
microscope:
  light: {lamp: A}
  camera: {sensitivity: nikon_d5100}
  polarizer_deg: 0
  analyzer_deg: 90
Y
# A cell of 1 um of retardance: its colour says so, whichever way it was written.
"$birefit" render cell.yaml --out cell.tif --quiet || fail 'render: tif'
"$birefit" render cell.yaml --out cell.npy --quiet && head -c 100 cell.npy | grep -q "(4, 6, 3)" || fail 'render: npy'
"$birefit" render cell.yaml --out cell.png --quiet && file cell.png | grep -q '6 x 4, 16-bit/color RGB' || fail "render: png: $(file cell.png)"
"$birefit" michel-levy cell.yaml --image cell.tif --out map > map.txt || fail 'michel-levy: no map'
grep -q '24 pixels, 24 of them' map.txt || fail "michel-levy: $(cat map.txt)"
# Half as bright as is stated, and white balanced for another lamp: no retardance has these colours.
"$birefit" michel-levy cell.yaml --image cell.tif --set micrograph.gain=2 --out dim > dim.txt
[ $? -eq 1 ] && grep -q 'of 24 pixels are those of no retardance' dim.txt || fail "michel-levy: a wrong white: $(cat dim.txt)"
"$birefit" michel-levy cell.yaml --image cell.tif --set 'microscope.light.lamp={planck_k: 5500}' --out cold > cold.txt
[ $? -eq 1 ] && grep -q 'those of no retardance' cold.txt || fail "michel-levy: another lamp: $(cat cold.txt)"
"$birefit" michel-levy cell.yaml --out chart > /dev/null || fail 'michel-levy: no chart'
for f in michel_levy.svg michel_levy.png michel_levy.csv; do [[ -s chart/$f ]] || fail "michel-levy: no $f"; done
# Of the table: nothing passes at 0, and at 1 um what the cell's picture shows.
awk -F, 'NR == 2 { dark = $1 == 0 && $2 + $3 + $4 < 1e-6 } END { exit !dark }' chart/michel_levy.csv || fail "michel-levy: $(sed -n 2p chart/michel_levy.csv)"
if [[ -s map/retardance_nm.tif ]] && /usr/bin/python3 -c 'import numpy, PIL' 2> /dev/null; then
  /usr/bin/python3 - <<'P' || fail 'michel-levy: the map is not 1000 nm'
import numpy, PIL.Image
found = numpy.array(PIL.Image.open("map/retardance_nm.tif"))
assert found.shape == (4, 6) and abs(found - 1000).max() < 2, found
colours, table = numpy.load("cell.npy"), numpy.genfromtxt("chart/michel_levy.csv", delimiter=",", skip_header=1)
row = table[table[:, 0] == 1000][0]
assert abs(colours[0, 0] - row[1:4]).max() < 3e-4, (colours[0, 0], row)
P
fi

if /usr/bin/python3 -c 'import numpy, PIL' 2> /dev/null; then
  # Channels that mix: the picture's do as those of the light.
  sed 's/nikon_d5100/nikon_d5100, crosstalk: {r: {g: 0.25, b: 0.1}, b: {g: -0.05}}/' cell.yaml > mixing.yaml
  "$birefit" render mixing.yaml --out mixing.npy --quiet || fail 'crosstalk: render'
  "$birefit" michel-levy mixing.yaml --out mixing > mixing.txt 2>&1
  [ $? -eq 2 ] && grep -q 'crosstalk is not known' mixing.txt || fail "crosstalk: $(cat mixing.txt)"
  # A photograph whose channels a program has mixed: with the shares free the same birefringence, without them none.
  /usr/bin/python3 - "$source" <<'P' || fail 'crosstalk'
import sys, numpy, PIL.Image
a, b = numpy.load("cell.npy")[0, 0], numpy.load("mixing.npy")[0, 0]
assert abs(b[0] - (a[0] + 0.25 * a[1] + 0.1 * a[2]) / 1.35) < 1e-6 and abs(b[1] - a[1]) < 1e-6, (a, b)
assert abs(b[2] - (a[2] - 0.05 * a[1]) / 0.95) < 1e-6, (a, b)
code = numpy.array(PIL.Image.open(sys.argv[1] + "/data/colour_droplet/photograph.png")) / 255
light = numpy.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
light = light @ numpy.array([[0.7, 0.2, 0.1], [0.15, 0.8, 0.05], [0.05, 0.2, 0.75]]).T
code = numpy.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
PIL.Image.fromarray(numpy.rint(255 * code).astype(numpy.uint8)).save("mixed.png")
P
  sed 's|image: .*|image: mixed.png|' "$source/fit_configs/colour_droplet.yaml" > mixed.yaml
  if "$birefit" fit mixed.yaml --out mixed > mixed.txt 2> /dev/null && ! grep -q '"grade": "answer with misfit"' mixed/fit.json; then fail "crosstalk: a plain answer without it"; fi
  share='{value: 0, fit: [-0.3, 1]}'
  "$birefit" fit mixed.yaml --out mixed --set "microscope.camera.crosstalk={r: {g: $share, b: $share}, g: {r: $share, b: $share}, b: {r: $share, g: $share}}" > mixed.txt 2> mixed.err ||
    fail "crosstalk: no answer: $(tail -3 mixed.err)"
  awk '$1 == "sample.material.birefringence" { found = 1; off = $3 - 0.165; inside = $5 > 0 && off * off < 9 * $5 * $5 } END { exit !(found && inside) }' mixed.txt || fail "crosstalk: $(grep -m1 birefringence mixed.txt)"
  # The chart is of the polarizers and plates that there are: a full-wave plate askew, an analyser that is not crossed.
  sed 's/analyzer_deg: 90/analyzer_deg: 75\n  behind: [{full_wave: {azimuth_deg: 20, made_for_nm: 530}}]/' cell.yaml > plate.yaml
  "$birefit" render plate.yaml --out plate.npy --quiet && "$birefit" michel-levy plate.yaml --out plate --quiet || fail 'plate'
  # What the sensor saw, a colour a pixel, is fitted as it is.
  /usr/bin/python3 - "$source" <<'P' || fail 'the chart is not of the plate'
import sys, numpy, PIL.Image
table = numpy.genfromtxt("plate/michel_levy.csv", delimiter=",", skip_header=1)
assert abs(numpy.load("plate.npy")[0, 0] - table[table[:, 0] == 1000][0][1:4]).max() < 3e-4
code = numpy.array(PIL.Image.open(sys.argv[1] + "/data/colour_droplet/photograph.png")) / 255
light = numpy.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
raw = numpy.zeros(light.shape[:2])
for y, x, colour in ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 2)):
    raw[y::2, x::2] = light[y::2, x::2, colour]
PIL.Image.fromarray(numpy.rint(60000 * raw).astype(numpy.uint16)).save("raw.png")
P
  sed 's|image: .*|image: raw.png\n  bayer: rggb|; s/transfer: srgb/transfer: linear/' "$source/fit_configs/colour_droplet.yaml" > raw.yaml
  "$birefit" fit raw.yaml --out raw > raw.txt 2> raw.err || fail "bayer: $(tail -3 raw.err)"
  awk '$1 == "sample.material.birefringence" { found = 1; off = $3 - 0.165; inside = $5 > 0 && off * off < 9 * $5 * $5 } END { exit !(found && inside) }' raw.txt || fail "bayer: $(grep -m1 birefringence raw.txt)"
fi

# An objective that shows blue 0.4 % smaller than the other colours: told by its own scale, which `channels` gives it.
cat > lateral.yaml <<'Y'
image_size_px: [64, 64]
micrograph: {channel: rgb, pixel_size_um: {value: 0.16, exact: true}, channels: {b: {micrograph.pixel_size_um: 0.16064}}}
sample: {droplet: {diameter_um: 8, director: {radial: {}}}, material: {ordinary: 1.52, birefringence: 0.12, resonance_nm: 220}, surround: {index: 1.5}}
microscope: {light: {lamp: A}, camera: {sensitivity: nikon_d5100}, polarizer_deg: 0, analyzer_deg: 90}
Y
"$birefit" render lateral.yaml --out lateral.png --quiet || fail 'channels: render'
sed -e '/image_size_px/d' -e 's/micrograph: {/micrograph: {image: lateral.png, transfer: srgb, /' -e 's/diameter_um: 8/diameter_um: {value: 8.3, fit: [7, 9]}/' \
  -e 's/birefringence: 0.12/birefringence: {value: 0.11, fit: [0.05, 0.2]}/' -e 's/pixel_size_um: 0.16064/pixel_size_um: {value: 0.16, fit: [0.158, 0.162]}/' lateral.yaml > scale.yaml
"$birefit" fit scale.yaml --out scale > scale.txt 2> scale.err || fail "channels: $(tail -3 scale.err)"
awk '$1 == "micrograph.channels.b.micrograph.pixel_size_um" { found = 1; off = $3 - 0.16064 } END { exit !(found && off * off < 1e-10) }' scale.txt || fail "channels: $(cat scale.txt)"

# A line of 3 nm and a condenser of 0.12 are left out of a picture that is shown, and said; not of a fit, nor where less is allowed.
sed -e '/camera:/d' -e 's/channel: rgb, //' -e 's/lamp: A/wavelength_nm: 550, bandwidth_nm: 3/' -e 's/analyzer_deg: 90/analyzer_deg: 90\n  condenser: {na: 0.12}/' \
  -e 's/thickness_um: 5/thickness_um: 20/' cell.yaml > nearly.yaml
"$birefit" explain nearly.yaml > nearly.txt || fail "model_tolerance: $(cat nearly.txt)"
grep -q 'bandwidth of 3 nm changes the picture by .* less than physics.model_tolerance' nearly.txt && grep -q 'condenser (NA 0.12) changes the picture by .* less than' nearly.txt ||
  fail "model_tolerance: $(cat nearly.txt)"
"$birefit" explain nearly.yaml --set physics.model_tolerance=0 > exactly.txt
grep -q 'sum over [0-9]* directions' exactly.txt && grep -q 'sum over [0-9]* wavelengths' exactly.txt || fail "model_tolerance: 0 is not 0: $(cat exactly.txt)"

# What does not go together is said, with its place.
says() {  # WHAT SED ..
  sed "${@:2}" cell.yaml > wrong.yaml
  "$birefit" render wrong.yaml --out wrong.tif > /dev/null 2> wrong.txt
  [[ $? == 2 ]] && grep -q "$1" wrong.txt && grep -q 'yaml:[0-9]\|lamp.csv:' wrong.txt || fail "$1: $(cat wrong.txt)"
}
says 'needs the light and what the camera sees' -e '/camera:/d'
says 'it is not said which colour' -e 's/channel: rgb, //'
says 'has no sensitivity of its own' -e 's/channel: rgb/channel: mean/'
says 'what each colour of channel: rgb has for itself' -e 's/channel: rgb/channel: r, channels: {r: {micrograph.gain: 2}}/'
says 'is no parameter of this config' -e 's/channel: rgb/channel: rgb, channels: {r: {microscope.focus: 2}}/'
says 'no camera that birefit knows' -e 's/nikon_d5100/nikon/'
says 'given beside a lamp' -e 's/lamp: A/lamp: A, wavelength_nm: 590/'
says 'given beside a single line' -e 's/lamp: A/wavelength_nm: 590/'
says 'filters are given without a lamp' -e 's/lamp: A/wavelength_nm: 590, filters: [{centre_nm: 546, fwhm_nm: 10}]/'
says 'a half-wave voltage is of one' -e 's/cell: .*/crystal: {half_wave_voltage_v: 1500, bias_v: 100, field_along: x}/' -e '/material/d'
printf 'wavelength_um,power\n400,1\n700,2\n' > lamp.csv
says 'looks like nanometres' -e 's/lamp: A/lamp: {file: lamp.csv}/'
printf 'wavelength_nm,power\n500,1\n600,2\n' > lamp.csv
says 'lies outside' -e 's/lamp: A/lamp: {file: lamp.csv}/'
printf 'wavelength_nm,power\n400,1\n500,-2\n700,1\n' > lamp.csv
says 'is negative' -e 's/lamp: A/lamp: {file: lamp.csv}/'
printf 'nm,power\n400,1\n700,2\n' > lamp.csv
says 'unknown key r' -e 's/nikon_d5100/nikon_d5100, crosstalk: {r: {r: 0.1}}/'
printf 'wavelength_nm,all\n400,1\n700,2\n' > grey.csv
says 'crosstalk is between colours' -e 's/channel: rgb, //; s/nikon_d5100/grey.csv, crosstalk: {r: {g: 0.1}}/'
says 'is no spectrum' -e 's/lamp: A/lamp: {file: lamp.csv}/'

((failures == 0)) && echo "white light: all as it should be"
exit "$failures"
