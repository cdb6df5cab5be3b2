#!/usr/bin/env bash
# A real imaging polarimeter looking at a mirror through two rotating retarders: are the zeros of its three dials those of its makers'
# calibration, and the two retarders, which are of one make and fitted independently, equal within their errors at every wavelength?
# usage: real_polarimeter.sh BIREFIT SOURCE_DIR      BIREFIT_REAL_DATA = the folder with the data, default out/real
# shellcheck source=../support/real_data.sh
source "$2/tests/support/real_data.sh" "$1" "$2" polarimeter_mirror_stack mirror_580nm.tif 'stacks of a polarimeter'

# The polarizer is fixed, at the angle that the first retarder's dial would call so; the mirror is a half-wave plate at 0, a rotator before it
# and one behind the second retarder take dial to dial. Dials are exact: their zeros are what is asked. Every eleventh of the 512 frames,
# which is prime to the steps of all dials; zeros and retardances within the fringe that the makers' calibration says (a 90 degree turn and the
# sign of a retarder are conventions). Pixels scatter by 0.3 to 0.6 grey levels within a frame.
config() {  # WAVELENGTH EXACT
  cat << YAML
signal:
  frames: $data/mirror_$1nm.tif
  set_from: $data/frames.csv
  columns:
    microscope.before[1].retarder.azimuth_deg: psg_retarder_deg
    microscope.behind[1].retarder.azimuth_deg: psa_retarder_deg
    microscope.analyzer_deg: psa_polarizer_deg
  every: 11
  noise: 0.3
sample:
  cell: {thickness_um: 1, director: {uniform: {azimuth_deg: 0, tilt_deg: 0}}}
  material: {ordinary: 1, birefringence: 0}
microscope:
  light: {wavelength_nm: {value: $1, exact: true}}
  polarizer_deg: {value: 60, fit: [40, 80]}
  analyzer_deg: {value: 0, exact: $2}
  before:
    - retarder: {phase_deg: {value: 90, fit: [40, 140]}, azimuth_deg: {value: 0, exact: $2}}
    - rotator: {angle_deg: {value: 30, fit: [0, 50]}}
    - half_wave: {azimuth_deg: {value: 0, exact: $2}}
  behind:
    - retarder: {phase_deg: {value: 90, fit: [40, 140]}, azimuth_deg: {value: 0, exact: $2}}
    - rotator: {angle_deg: {value: 50, fit: [30, 80]}}
YAML
}
# of NAME: value and standard error of a parameter in NAME.txt
of() { awk -v path="$2" '$1 == path && $2 == "=" { print $3, $5; exit }' "$1.txt"; }
check() { if awk "BEGIN { exit !($2) }"; then echo "ok   $1"; else fail "$1"; fi; }

# Zeros 61.69, 94.36, 151.05 degrees (makers' calibration): the polarizer at the first one, the rotators at -(first + second) = 23.95 and at
# third - second = 56.69, all but for half turns. Retardances of the calibration over all wavelengths, and what the data's description
# has of each wavelength by itself; a degree is what the two differ by.
for each in '460 109.3 110.5' '510 94.9 94.6' '580 80.3 79.9' '630 72.4 72.4'; do
  read -r wavelength calibrated alone <<< "$each"
  config "$wavelength" true > "$wavelength.yaml"
  "$birefit" fit "$wavelength.yaml" --out "$wavelength" > "$wavelength.txt" 2> "$wavelength.err" || fail "$wavelength: exit code $?: $(cat "$wavelength.err")"
  while read -r path truth; do
    read -r value error <<< "$(of "$wavelength" "$path")"
    check "$wavelength nm: $path ${value:=nan} +- ${error:=nan} of $truth" "$error > 0 && $error < 1 && ($value - $truth) ^ 2 < 9 * $error ^ 2"
  done << 'TRUTH'
microscope.polarizer_deg 61.69
microscope.before[2].rotator.angle_deg 23.95
microscope.behind[2].rotator.angle_deg 56.69
TRUTH
  read -r first first_error <<< "$(of "$wavelength" 'microscope.before[1].retarder.phase_deg')"
  read -r second second_error <<< "$(of "$wavelength" 'microscope.behind[1].retarder.phase_deg')"
  check "$wavelength nm: retarders ${first:=nan} +- ${first_error:=nan} and ${second:=nan} +- ${second_error:=nan} are equal" \
    "$first_error > 0 && ($first - $second) ^ 2 < 4 * ($first_error ^ 2 + $second_error ^ 2)"
  for value in "$first $first_error" "$second $second_error"; do
    check "$wavelength nm: $value of $calibrated to $alone" \
      "${value% *} + 2 * ${value#* } > ($calibrated < $alone ? $calibrated : $alone) && ${value% *} - 2 * ${value#* } < ($calibrated > $alone ? $calibrated : $alone)"
  done
  echo "$first" >> retardances
done
# Of a film or plate the phase falls with the wavelength, faster than 1/wavelength: the retardance falls, too.
check "the retardance falls with the wavelength" "$(awk '{ n = NR; r[n] = $1 } END { w[1] = 460; w[2] = 510; w[3] = 580; w[4] = 630; good = n == 4; for (i = 2; i <= 4; ++i) good = good && r[i] * w[i] < r[i - 1] * w[i - 1]; print good + 0 }' retardances)"

# A dial that nobody says to be exact is known to a degree, and so are the zeros that are read off it.
config 580 false > dials.yaml
"$birefit" fit dials.yaml --out dials > dials.txt 2> dials.err || fail "dials: exit code $?: $(cat dials.err)"
read -r value error <<< "$(of dials microscope.polarizer_deg)"
check "dials that are not exact: polarizer_deg ${value:=nan} +- ${error:=nan}" "$error > 0.9"
[ $failures -eq 0 ] && echo 'all as required' || echo "$failures failures"
exit $((failures > 0))
