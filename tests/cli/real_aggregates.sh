#!/usr/bin/env bash
# Micrographs from which no birefringence follows: crystal aggregates of unknown material, thickness, wavelength and camera, clipped in
# parts. Whatever a user takes them for, there must be no answer (exit code 1), or the data are refused (2).
# usage: real_aggregates.sh BIREFIT SOURCE_DIR      BIREFIT_REAL_DATA = the folder of tools/fetch_real, default out/real
# shellcheck source=../support/real_data.sh
source "$2/tests/support/real_data.sh" "$1" "$2" crystal_aggregates sample_1.tif 'crystal aggregates (tools/fetch_real fetches them)'
# refuse IMAGE ROI WHAT EXIT_CODE WORDS, the sample on standard input: one of the words must be said
refuse() {
  {
    printf 'micrograph:\n  image: %s/%s\n  channel: g\n  roi_px: %s\n  pixel_size_um: 0.32\n  saturation_counts: 255\n' "$data" "$1" "$2"
    printf '  gain: {fit: auto}\n  offset: {fit: auto}\n'
    printf 'microscope: {light: {wavelength_nm: 550}, polarizer_deg: 0, analyzer_deg: 90}\n'
    cat
  } > config.yaml
  "$birefit" fit config.yaml --out out > said.txt 2>&1
  code=$?
  if [ $code -eq "$4" ] && grep -Eiq "$5" said.txt; then
    echo "$1 $2 as $3: exit code $code: $(grep -Eio "$5" said.txt | sort -u | head -3 | tr '\n' ',')"
  else
    echo "FAIL $1 $2 as $3: exit code $code"
    cat said.txt
    failures=$((failures + 1))
  fi
  rm -rf out
}
nothing='not identifiable|ambiguous|no signal|at its bound'
for image in sample_1.tif sample_2.tif; do
  for place in "[400, 1400, 800, 1800]" "[1200, 800, 1600, 1200]"; do
    refuse $image "$place" "a film of anything" 1 "$nothing" <<'YAML'
sample:
  cell:
    thickness_um: {value: 5, fit: [1, 20]}
    director: {uniform: {azimuth_deg: {value: 30, fit: [0, 90]}}}
  material: {ordinary: 1.52, birefringence: {value: 0.1, fit: [0.01, 0.4]}}
  surround: {index: 1.5}
YAML
    refuse $image "$place" "a film of known thickness" 1 "$nothing" <<'YAML'
sample:
  cell: {thickness_um: 5, director: {uniform: {azimuth_deg: 45}}}
  material: {ordinary: 1.52, birefringence: {value: 0.1, fit: [0.01, 0.4]}}
  surround: {index: 1.5}
YAML
  done
  refuse $image "[1200, 800, 1600, 1200]" "a droplet" 1 "$nothing" <<'YAML'
sample:
  droplet: {diameter_um: {fit: auto, value: 60}, director: {radial: {}}}
  material: {ordinary: 1.52, birefringence: {value: 0.1, fit: [0.01, 0.4]}}
  surround: {index: 1.5}
YAML
done
refuse sample_2.tif "[100, 900, 500, 1300]" "a film where all is clipped" 2 "no usable pixel.*saturated" <<'YAML'
sample:
  cell: {thickness_um: 5, director: {uniform: {azimuth_deg: 45}}}
  material: {ordinary: 1.52, birefringence: {value: 0.1, fit: [0.01, 0.4]}}
  surround: {index: 1.5}
YAML
[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
