#!/usr/bin/env bash
# `birefit jones` against other programs' matrices of a tilted plate (tests/data/peers/README.md), every direction at
# once, from a config as a user would write it: forwards only and with all reflections.
set -uo pipefail
program=$1 source=$2
table=$source/tests/data/peers/stacks/stacks_layered.csv
here=$(mktemp -d)
trap 'rm -rf "$here"' EXIT
cd "$here" && mkdir work
# a = (cos30 cos25, cos30 sin25, sin30)
printf 'depth_um,ax,ay,az,n_o,n_e\n9,0.78488556712,0.36599815077,0.5,1.52,1.74\n' > work/plate.csv

check() { # METHOD_OF_THE_TABLE CEILING
  {
    printf 'sample:\n  slab: {profile: plate.csv, interpolation: constant}\n  surround: {index: 1.43}\n'
    printf 'microscope:\n  light: {wavelength_nm: 590}\n  directions:\n'
    awk -F, -v m="$1" '$1 == "plate_tilted" && $2 == 1.43 && $6 == m { printf "    - {theta_deg: %s, azimuth_deg: %s}\n", $3, $4 }' "$table"
    printf 'accuracy: {intensity: 1.0e-11}\nphysics: {ceiling: %s}\n' "$2"
  } > work/plate.yaml
  "$program" jones work/plate.yaml --out work/jones.csv || { echo "FAILED: jones, ceiling $2"; exit 1; }
  # The file's tps is p OUT for s in; ours is the other way round. The axis above has 11 digits: 1e-8.
  awk -F, -v m="$1" '
    function compare(name, ours, theirs) { d = ours - theirs; if (d < 0) d = -d; if (!(d < 1e-8)) { print "FAILED: " m ", direction " n ", " name ": " ours " against " theirs; bad = 1 } }
    FNR == 1 { for (i = 1; i <= NF; ++i) column[FILENAME, $i] = i; next }
    FILENAME ~ /jones.csv/ { ++rows; for (i = 1; i <= NF; ++i) value[rows, i] = $i; next }
    $1 == "plate_tilted" && $2 == 1.43 && $6 == m {
      ++n
      split("ss tss pp tpp ps tsp sp tps", pair, " ")
      for (k = 1; k < 8; k += 2)
        for (part = 0; part < 2; ++part) {
          p = part ? "im" : "re"
          compare(pair[k] " " p, value[n, column["work/jones.csv", p "_" pair[k]]], $column[FILENAME, pair[k + 1] "_" p])
        }
    }
    END { if (n < 20 || n != rows) { print "FAILED: " n " directions, " rows " rows"; bad = 1 } exit bad }' work/jones.csv "$table" || exit 1
}
check 2x2_1 one_way
check 2x2 e_only
check berreman4x4 reflections
echo "all as required"
