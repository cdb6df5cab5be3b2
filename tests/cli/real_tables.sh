#!/usr/bin/env bash
# Real tables of birefringence whose flaws a tool must name: a tape whose stated thickness contradicts its spectrum, the same tape heated and
# cooled, and a liquid crystal whose birefringence is not that of the literature.
# usage: real_tables.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source=$(realpath "$2")
data=$source/data/real
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $*"; failures=$((failures + 1)); }
# run CONFIG EXIT_CODE
run() {
  sed "s#\.\./data/real#$data#" "$source/fit_configs/$1.yaml" > "$1.yaml"
  "$birefit" fit "$1.yaml" --out "$1" > "$1.txt" 2>&1
  local code=$?
  [ "$code" = "$2" ] || { fail "$1: exit code $code, expected $2"; cat "$1.txt"; }
}
# says CONFIG WORDS
says() { if grep -q -- "$2" "$1.txt"; then echo "ok   $1: $2"; else fail "$1 does not say: $2"; cat "$1.txt"; fi; }
# between TEXT VALUE LOW HIGH
between() { if awk "BEGIN { exit !($2 > $3 && $2 < $4) }"; then echo "ok   $1: $2"; else fail "$1: $2, expected $3 to $4"; fi; }

# A straight line through orders and 1/wavelength is a path of 6081 nm: 670 um of the birefringence stated, sixteen layers of the thickness.
run tape_spectrum 1
says tape_spectrum "Data and prior contradict each other"
between "tape_spectrum, thickness without the prior" "$(sed -n 's/.*thickness_um = \([0-9.]*\) .*instead.*/\1/p' tape_spectrum.txt)" 650 690

run tape_temperature 1
says tape_temperature "stand out of their neighbours"
says tape_temperature "(line 3, "
says tape_temperature "hysteresis"

# Wu et al. (1993) at 34.8 C: 0.117; this table: 0.097 at 35.5 C.
run lc_5pch 0
says lc_5pch "birefringence_factor contradicts what was known of it"
between "lc_5pch, over the literature" "$(awk '/"sample.material.birefringence_factor": \{/ { on = 1 } on && /"value":/ { sub(/.*: /, ""); sub(/,.*/, ""); print; exit }' lc_5pch/fit.json)" 0.75 0.9
exit $((failures > 0))
