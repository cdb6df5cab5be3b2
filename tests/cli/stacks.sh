#!/usr/bin/env bash
# Pages of a TIFF stack as the frames of a series and as the micrographs of one fit: four droplets of diameter 9.3 um and of
# birefringences 0.22, 0.215, 0.208 and 0.2 (tests/data/files). usage: stacks.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
data=$2/tests/data/files
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }

config() {  # NAME MICROGRAPHS DIAMETER BIREFRINGENCE
  cat > "$1.yaml" << YAML
micrographs: $2
micrograph: {pixel_size_um: 0.12, center_px: {fit: auto}}
sample:
  droplet: {diameter_um: $3, director: {radial: {}}}
  material: {ordinary: 1.52, birefringence: $4}
  surround: {index: 1.43}
microscope: {light: {wavelength_nm: 590}, polarizer_deg: 0, analyzer_deg: 90}
physics: {ceiling: one_way}
YAML
}
diameter='{value: 9.0, fit: [8, 10.5]}' birefringence='{value: 0.2, fit: [0.02, 0.3]}'

# ---- frames of a series -----------------------------------------------------------------------------------------------

config series "{files: $data/droplet_stack.tif}" "$diameter" "$birefringence"
"$birefit" series series.yaml --out series > series.txt 2> series.err || fail "series: $(cat series.txt series.err)"
awk -F, '
  NR == 1 { for (i = 1; i <= NF; ++i) at[$i] = i; split("0.22 0.215 0.208 0.2", truth, " "); next }
  function off(name, true_value, d) { d = ($(at[name]) - true_value) / $(at[name "_stderr"]); return !(d * d < 16) }
  $(at["page"]) != NR - 2 || $(at["verdict"]) != "answer" { print; bad = 1 }
  off("sample.material.birefringence", truth[NR - 1]) || off("sample.droplet.diameter_um", 9.3) { print; bad = 1 }
  END { exit bad || NR != 5 }' series/series.csv || fail 'series.csv'
ls series/frames | tr '\n' ' ' | grep -qx 'droplet_stack_p0 droplet_stack_p1 droplet_stack_p2 droplet_stack_p3 ' || fail "frames: $(ls series/frames)"

# A page that its table names and the file has no more is a row with the reason.
printf '%s\n' page,time_s 1,10 0,20 2,30 3,40 4,50 > times.csv
config table "{files: $data/droplet_stack.tif, set_from: times.csv, along: time_s}" 9.3 "$birefringence"
"$birefit" series table.yaml --out table > table.txt 2> table.err
[ $? -eq 1 ] && grep -q '4 answer, 1 unreadable' table.txt || fail "table: $(cat table.txt table.err)"
cut -d, -f2,3 table/series.csv | tr '\n' ' ' | grep -qx 'page,time_s 1,10 0,20 2,30 3,40 4,50 ' || fail "rows of the table: $(cut -d, -f2,3 table/series.csv)"
grep -q 'unreadable,.*has no page 4' table/series.csv || fail 'a page that is not there has no reason'

# ---- micrographs of one fit -------------------------------------------------------------------------------------------

printf '%s\n' page,sample.material.birefringence 0,0.22 1,0.215 2,0.208 3,0.2 > known.csv
config fit "{files: $data/droplet_stack.tif, set_from: known.csv, own: [micrograph.center_px]}" "$diameter" 0.2
"$birefit" fit fit.yaml --out fit > fit.txt 2> fit.err || fail "fit: $(cat fit.txt fit.err)"
awk '$1 ~ "diameter_um$" && $2 == "=" { found = $5 > 0 && ($3 - 9.3)^2 < 16 * $5^2 } END { exit !found }' fit.txt || fail "fit: $(grep diameter fit.txt)"
[ "$(grep -c '^ *micrographs\[[0-3]\].micrograph.center_px.[xy] *=' fit.txt)" -eq 8 ] || fail 'fit: not a centre for each page'

# ---- metadata -----------------------------------------------------------------------------------------------------------

# What a file states of the objective and of the light is compared with the config; of its pixels' size a warning is enough.
if /usr/bin/python3 -c 'import PIL' 2> /dev/null; then
  config plain '[{image: stated.tif}]' "$diameter" "$birefringence"
  sed -i 's/micrograph: {/micrograph: {page: 0, /; s/polarizer_deg: 0/polarizer_deg: 0, objective_na: 0.8/; s/physics: .*/physics: {ceiling: one_way}/' plain.yaml
  /usr/bin/python3 - "$data/droplet_stack.tif" << 'P' || fail 'stated.tif'
import sys, PIL.Image
ome = ('<?xml version="1.0"?><OME xmlns="x"><Instrument><Objective ID="o" LensNA="0.4"/></Instrument><Image><Pixels SizeX="2" '
       'PhysicalSizeX="0.16" PhysicalSizeY="0.16"><Channel EmissionWavelength="546"/></Pixels></Image></OME>')
PIL.Image.open(sys.argv[1]).save("stated.tif", tiffinfo={270: ome})
P
  sed -i 's/page: 0, //' plain.yaml
  "$birefit" fit plain.yaml --out plain > plain.txt 2> plain.err
  [ $? -eq 2 ] && grep -q 'yaml:.*objective of NA 0.4, and microscope.objective_na is 0.8' plain.err && grep -q 'in light of 546 nm, and' plain.err || fail "metadata: $(cat plain.err)"
  "$birefit" explain plain.yaml --set micrograph.metadata=ignore > plain.txt 2> plain.err || fail "metadata: ignore: $(cat plain.err)"
  "$birefit" explain plain.yaml --set microscope.objective_na=0.4 --set microscope.light.wavelength_nm=546 > plain.txt 2> plain.err || fail "metadata: $(cat plain.err)"
  grep -q 'states pixels of 0.16 um, the config of 0.12 um' plain.txt plain.err || fail "metadata: size: $(cat plain.txt)"
fi

[ $failures -eq 0 ] && echo 'all as required' || echo "$failures failures"
exit $((failures > 0))
