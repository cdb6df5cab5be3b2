#!/usr/bin/env bash
# Pictures, fields and stacks as other programs write them (tests/data/files): read right, or refused by their name.
# usage: files.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
data=$2/tests/data/files
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }

# A droplet of diameter 9.3 um and birefringence 0.22; further lines of `micrograph:` as arguments.
droplet() {  # NAME IMAGE [LINE ..]
  local name=$1 image=$2
  shift 2
  {
    echo 'micrograph:'
    echo "  image: $image"
    printf '  %s\n' "$@"
    cat << 'YAML'
  gain: {fit: auto}
  offset: {fit: auto}
  center_px: {fit: auto}
sample:
  droplet:
    diameter_um: {value: 9.0, fit: [8, 10.5]}
    director: {radial: {}}
  material: {ordinary: 1.52, birefringence: {value: 0.2, fit: [0.05, 0.4]}}
  surround: {index: 1.43}
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
physics: {ceiling: one_way}
YAML
  } > "$name.yaml"
  run "$name"
}
run() { "$birefit" "${2:-fit}" "$1.yaml" --out "$1" > "$1.txt" 2> "$1.err"; echo $? > "$1.code"; }
says() { grep -qF -- "$2" "$1.txt" "$1.err" || fail "$1 does not say: $2"; }
ends() { [ "$(cat "$1.code")" = "$2" ] || fail "$1 ends with $(cat "$1.code") and not $2: $(head -2 "$1.err")"; }
# A parameter, by the end of its name, lies within four standard errors of the truth: "name = value +/- error ..".
holds() {  # CASE NAME TRUTH
  awk -v name="$2" -v truth="$3" '
    $1 ~ name "$" && $2 == "=" && $4 == "+/-" {
      found = 1
      off = $3 - truth
      inside = $5 > 0 && off * off < 16 * $5 * $5
    }
    END { exit !(found && inside) }' "$1.txt" || fail "$1: $2 = $3 is not $(grep -m1 "$2 *=" "$1.txt")"
}
is_droplet() { ends "$1" 0; holds "$1" diameter_um 9.3; holds "$1" birefringence 0.22; }

# ---- white is zero; masks ---------------------------------------------------------------------------------------------
droplet white_is_zero "$data/droplet_white_is_zero_16.tif" 'pixel_size_um: 0.1'
is_droplet white_is_zero
says white_is_zero 'white is stored as zero: values inverted'
for mask in 1bit inverting; do
  droplet "mask_$mask" "$data/droplet.tif" "mask: $data/droplet_mask_$mask.tif" 'pixel_size_um: 0.1'
  is_droplet "mask_$mask"
  says "mask_$mask" "of the mask's 16384 pixels 9853 are taken as selected"
done
says mask_inverting 'white is zero in this file'

[ $failures -eq 0 ] && echo 'all as required' || echo "$failures failures"
exit $((failures > 0))
