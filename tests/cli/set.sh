#!/usr/bin/env bash
# `--set path=value`: as if it stood in the config; errors name the item. usage: set.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
says() { grep -q -- "$2" "$1" || { fail "$1 does not say: $2"; cat "$1"; }; }
cat > a.yaml <<'YAML'
image_size_px: [24, 20]
sample:
  cell:
    thickness_um: {value: 5, fit: [4, 6]}   # known better than that
    director: {twisted: {twist_deg: 90}}
  material: {ordinary: 1.5, birefringence: 0.1}
  surround: {index: 1.5}
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
  behind: [{retarder: {phase_deg: 30, azimuth_deg: 45}}, {rotator: {angle_deg: 2}}]
YAML
sed 's/birefringence: 0.1/birefringence: 0.13/; s/analyzer_deg: 90/analyzer_deg: 60/; s/phase_deg: 30/phase_deg: 50/' a.yaml > b.yaml
set_as_b=(--set sample.material.birefringence=0.13 --set microscope.analyzer_deg=60 --set 'microscope.behind[1].retarder.phase_deg=50')
"$birefit" render b.yaml --out b.png > /dev/null 2>&1 || fail 'render'
"$birefit" render "${set_as_b[@]}" a.yaml --out a.png > /dev/null 2>&1 || fail 'render --set'
cmp -s a.png b.png || fail 'render --set is not the picture of the changed file'
"$birefit" jones b.yaml --out b.csv > /dev/null 2>&1
"$birefit" jones a.yaml "${set_as_b[@]}" --out a.csv > /dev/null 2>&1
cmp -s a.csv b.csv || fail 'jones --set'
"$birefit" explain a.yaml --set sample.cell.thickness_um=5 > e.txt 2>&1
grep -q thickness_um e.txt && fail 'thickness_um=5 is still fitted'
"$birefit" explain a.yaml --set 'sample.cell.director={uniform: {azimuth_deg: {value: 40, fit: [30, 60]}}}' > e.txt 2>&1
says e.txt 'sample.cell.director.uniform.azimuth_deg from 40'

# The config kept with results runs alone and gives the same.
config=$source/fit_configs/disc.yaml
"$birefit" fit "$config" --set sample.disc.load_n.value=290 --set 'fit={max_iterations: 50}' --out one > one.txt 2>&1 || { fail 'fit --set'; cat one.txt; }
says one/config.yaml '# *--set sample.disc.load_n.value=290'
sed "s#\.\./data#$source/data#" one/config.yaml > kept.yaml
"$birefit" fit kept.yaml --out two > two.txt 2>&1 || { fail 'the config that was kept'; cat two.txt; }
[ "$(grep load_n one.txt | head -1)" = "$(grep load_n two.txt | head -1)" ] || fail 'the config that was kept gives another load'

refused() { # WORDS OPTIONS..
  local words=$1
  shift
  "$birefit" render a.yaml --out x.tif "$@" > no.txt 2>&1
  [ $? -eq 2 ] || fail "accepted: $*"
  says no.txt "$words"
}
refused '--set sample.cell.thickness_um=-3: .*thickness_um' --set sample.cell.thickness_um=-3
refused '--set sample.cell.thicknes_um=3: .*did you mean thickness_um' --set sample.cell.thicknes_um=3
refused 'must be path=value' --set nonsense
refused 'image_size_px is a list' --set image_size_px.width=3
refused 'microscope.behind has the items 1 to 2' --set 'microscope.behind[0].rotator.angle_deg=1'
refused 'sample.material.ordinary is 1.5' --set sample.material.ordinary.value.more=2
refused '--set sample.surround=\[1: ' --set 'sample.surround=[1'
refused 'thickness_um' --set sample.cell.thickness_um=
refused 'is no path' --set 'microscope.behind[x]=1'
[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
