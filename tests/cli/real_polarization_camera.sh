#!/usr/bin/env bash
# A real picture of a polarization camera, four polarizers standing in it: the cells of its sensor are read, what crossed analysers let
# through together says that its codes are no light, and by which gamma they are; then the polarizers stand as they are labelled.
# usage: real_polarization_camera.sh BIREFIT SOURCE_DIR      BIREFIT_REAL_DATA = the folder with the data, default out/real
# shellcheck source=../support/real_data.sh
source "$2/tests/support/real_data.sh" "$1" "$2" polcam_four_polarizers four_polarizers_mosaic.png 'picture of a polarization camera'
check() { if awk "BEGIN { exit !($2) }"; then echo "ok   $1"; else fail "$1"; fi; }

# Light through one polarizer, which leaks, and no sample; of NAME, with these lines in its micrograph.
config() {  # LINES
  printf 'micrograph:\n  image: %s/four_polarizers_mosaic.png\n  pixel_size_um: 1\n  gain: {fit: auto}\n  offset: 0\n%b\n' "$data" "$1"
  cat << 'YAML'
sample:
  cell: {thickness_um: 1, director: {uniform: {azimuth_deg: 0, tilt_deg: 0}}}
  material: {ordinary: 1, birefringence: 0}
microscope:
  light: {wavelength_nm: 550}
  polarizer_deg: {value: 90, fit: [0, 180]}
  polarizer_extinction_ratio: {value: 5, fit: [1, 1000]}
YAML
}
mosaic='  mosaic: polarization'
gamma_of() { sed -n 's/.*light = code^\([0-9.]*\) (+- \([0-9.]*\)) the pairs agree.*/\1 \2/p' "$1"; }

# Nobody has said that there are cells: refused.
config '' | sed 's/  polarizer_deg/  analyzer_deg: 0\n&/' > plain.yaml
"$birefit" explain plain.yaml > plain.txt 2>&1
[ $? -eq 2 ] && grep -q 'pixels alternate in cells of 2 x 2: a .*polarization' plain.txt || fail "not seen to be a mosaic: $(cat plain.txt)"

# I0 + I90 = I45 + I135 of any light, which of these codes the powers 2.0 to 2.2 bring about (README of the data).
config "$mosaic" > whole.yaml
"$birefit" explain whole.yaml > whole.txt 2>&1 || fail "whole: $(cat whole.txt)"
read -r gamma error <<< "$(gamma_of whole.txt)"
check "gamma ${gamma:=nan} +- ${error:=nan}" "$gamma > 2 && $gamma < 2.2 && $error > 0 && $error < 0.1"
# Decoded so, nothing is said any more; decoded in part, the rest is.
config "$mosaic\n  transfer: {gamma: $gamma}" > decoded.yaml
"$birefit" explain decoded.yaml > decoded.txt 2>&1 || fail "decoded: $(cat decoded.txt)"
[ -z "$(gamma_of decoded.txt)" ] || fail "decoded: $(cat decoded.txt)"
config "$mosaic\n  transfer: {gamma: 1.5}" > part.yaml
"$birefit" explain part.yaml > part.txt 2>&1
check "gamma $(gamma_of part.txt) after 1.5" "($(gamma_of part.txt | cut -d' ' -f1) - $gamma) ^ 2 < 0.05 ^ 2"

# One of the polarizers alone does not say it: its pixels may differ as much.
config "$mosaic\n  roi_px: [300, 310, 460, 470]" > one.yaml
"$birefit" explain one.yaml > one.txt 2>&1
[ -z "$(gamma_of one.txt)" ] || fail "one: $(cat one.txt)"

# Sony's order of the cell: the polarizers stand at 90 degrees - label, which are set by hand to some degrees. Their light's degree of
# polarization, (X - 1) / (X + 1) of an extinction ratio X, rises from 0.40 .. 0.52 of the codes to 0.70 .. 0.90.
degree_of() { awk '$1 == "microscope.polarizer_extinction_ratio" { if ($3 == "<") for (i = 4; i <= NF; ++i) if ($i == "best") x = $(i + 1) + 0; if ($3 != "<") x = $3; print (x - 1) / (x + 1); exit }' "$1"; }
while read -r label region; do
  for name in codes light; do
    transfer=linear
    [ $name = light ] && transfer="{gamma: $gamma}"
    config "$mosaic\n  roi_px: $region\n  transfer: $transfer" > $name$label.yaml
    "$birefit" fit $name$label.yaml --out $name$label > $name$label.txt 2> $name$label.err
    [ $? -le 1 ] || fail "$name, $label: $(cat $name$label.err)"
    # A landscape is no even light: no answer, or one with the misfit that is said.
    grep -q 'does not describe the image within its noise' $name$label.txt || fail "$name, $label: no word of the landscape"
  done
  angle=$(awk '$1 == "microscope.polarizer_deg" { print $3; exit }' light$label.txt)
  check "label $label: polarizer at ${angle:=nan}" "((($angle + $label - 90 + 270) % 180) - 90) ^ 2 < 10 ^ 2"
  codes=$(degree_of codes$label.txt) light=$(degree_of light$label.txt)
  check "label $label: degree of polarization ${codes:=nan} of the codes, ${light:=nan} of light" \
    "$codes > 0.35 && $codes < 0.57 && $light > 0.65 && $light < 0.95"
done << 'FILTERS'
0 [320, 330, 440, 450]
45 [940, 336, 1060, 456]
90 [1494, 336, 1614, 456]
135 [2046, 350, 2166, 470]
FILTERS
[ $failures -eq 0 ] && echo 'all as required' || echo "$failures failures"
exit $((failures > 0))
