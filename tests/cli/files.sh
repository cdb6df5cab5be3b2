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

# ---- raw photographs --------------------------------------------------------------------------------------------------
droplet thumbnail "$data/droplet_thumbnail_first.dng" 'channel: g' 'pixel_size_um: 0.1'
ends thumbnail 2
says thumbnail 'is a raw photograph'
droplet cfa "$data/droplet_cfa.tif" 'pixel_size_um: 0.1'
ends cfa 2
says cfa 'is a colour filter mosaic'

# ---- mosaics ----------------------------------------------------------------------------------------------------------
droplet bayer_unstated "$data/droplet_bayer.tif" 'pixel_size_um: 0.1'
ends bayer_unstated 2
says bayer_unstated 'pixels alternate in cells of 2 x 2: a colour (Bayer) mosaic'
droplet polarization_unstated "$data/droplet_polarization.tif" 'pixel_size_um: 0.05'
ends polarization_unstated 2
says polarization_unstated 'pixels alternate in cells of 2 x 2: a polarization mosaic'
for channel in r g b; do
  droplet "bayer_$channel" "$data/droplet_bayer.tif" 'pixel_size_um: 0.1' 'bayer: rggb' "channel: $channel"
  is_droplet "bayer_$channel"
done
grep -qF 'droplet_bayer.tif (g2)' bayer_g/fit.json || fail 'bayer_g: greens of both rows are not two pictures'
says bayer_g 'a channel of a colour camera passes light'
droplet polarization "$data/droplet_polarization.tif" 'pixel_size_um: 0.05' 'mosaic: polarization'
ends polarization 2
says polarization 'analyzer_deg is given beside mosaic: polarization'
grep -v analyzer_deg polarization.yaml > polarization_four.yaml
run polarization_four
is_droplet polarization_four
grep -qF 'droplet_polarization.tif (135 deg)' polarization_four/fit.json || fail 'polarization_four: no picture at 135 deg'
sed 's/mosaic: polarization/mosaic: {polarization: [[90, 45], [135, 0]]}/' polarization_four.yaml > polarization_layout.yaml
run polarization_layout
is_droplet polarization_layout
# The truth is not in another layout, and the picture says so.
sed 's/mosaic: polarization/mosaic: {polarization: [[0, 45], [135, 90]]}/' polarization_four.yaml > polarization_wrong.yaml
run polarization_wrong
ends polarization_wrong 1
droplet two_taps "$data/droplet_two_taps.tif" 'pixel_size_um: 0.1'
is_droplet two_taps  # taps that differ along one side are no mosaic
droplet mosaic_none "$data/droplet_bayer.tif" 'pixel_size_um: 0.1' 'mosaic: none'
! grep -q 'alternate' mosaic_none.err || fail 'mosaic: none still looks for one'

# ---- pixels that are not square ---------------------------------------------------------------------------------------
droplet not_square_file "$data/droplet_not_square.tif"
ends not_square_file 2
says not_square_file 'states pixels of 0.1 x 0.12 um: they are not square'
droplet not_square_stated "$data/droplet.tif" 'pixel_size_um: [0.1, 0.12]'
ends not_square_stated 2
says not_square_stated 'pixels of 0.1 x 0.12 um are not square'
droplet square_stated "$data/droplet.tif" 'pixel_size_um: [0.1, 0.1]'
is_droplet square_stated

# ---- fields: 0.5 everywhere -------------------------------------------------------------------------------------------
field() {  # NAME KEYS
  printf '%s\n' 'image_size_px: [8, 8]' 'micrograph: {pixel_size_um: 0.3}' 'sample:' "  volume: {$2}" \
    '  material: {ordinary: 1.5, birefringence: 0.1}' \
    'microscope: {light: {wavelength_nm: 800}, polarizer_deg: 0, analyzer_deg: 90}' > "$1.yaml"
  "$birefit" render "$1.yaml" --out "$1.exr" > "$1.txt" 2> "$1.err"; echo $? > "$1.code"
}
field zlib "file: $data/director_zlib.vti"
ends zlib 0
field norm "file: $data/q_three_halves.npy, spacing_um: [0.5, 0.5, 0.5], bulk_order: 0.53"
ends norm 2
says norm 'add q_norm: 1.5 to sample.volume'
field norm_stated "file: $data/q_three_halves.npy, spacing_um: [0.5, 0.5, 0.5], bulk_order: 0.53, q_norm: 1.5"
ends norm_stated 0
field open_qmin "file: $data/open_qmin.txt, spacing_um: [0.5, 0.5, 0.5]"
ends open_qmin 0
for picture in zlib norm_stated open_qmin; do
  oiiotool --stats "$picture.exr" | grep -q 'Stats Avg: 0.500000' || fail "$picture: not 0.5 everywhere"
done

[ $failures -eq 0 ] && echo 'all as required' || echo "$failures failures"
exit $((failures > 0))
