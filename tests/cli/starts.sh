#!/usr/bin/env bash
# The program starts without the libraries that read and write images, opens them when it needs them, in the build and
# installed and moved, and says what is missing when they are not there. usage: starts.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
data=$2/tests/data/files
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cat > "$work/drop.yaml" << 'YAML'
image_size_px: [12, 10]
micrograph: {pixel_size_um: 0.3}
sample:
  droplet: {diameter_um: 3, director: {radial: {}}}
  material: {ordinary: 1.5, birefringence: 0.1}
  surround: {index: 1.5}
microscope: {light: {wavelength_nm: 600}, polarizer_deg: 0, analyzer_deg: 90}
YAML
cat > "$work/droplet.yaml" << YAML
micrograph: {image: $data/droplet.tif, pixel_size_um: 0.1}
sample:
  droplet: {diameter_um: {value: 9.0, fit: [8, 10.5]}, director: {radial: {}}}
  material: {ordinary: 1.52, birefringence: {value: 0.2, fit: [0.05, 0.4]}}
  surround: {index: 1.43}
microscope: {light: {wavelength_nm: 590}, polarizer_deg: 0, analyzer_deg: 90}
physics: {ceiling: one_way}
YAML

reads_and_writes() {  # PROGRAM NAME
  "$1" render "$work/drop.yaml" --out "$work/$2.tif" > "$work/$2.txt" 2>&1 && [ -s "$work/$2.tif" ] ||
    fail "$2: writes no picture: $(head -2 "$work/$2.txt")"
  "$1" fit "$work/droplet.yaml" --out "$work/$2" > "$work/$2.txt" 2>&1 && [ -s "$work/$2/residual.tif" ] ||
    fail "$2: fits no picture: $(head -2 "$work/$2.txt")"
}
images='OpenImageIO|opencv'
ldd "$birefit" > "$work/loaded" || fail 'ldd'
grep -E "$images" "$work/loaded" && fail 'the program is linked to the image libraries'
[ "$(wc -l < "$work/loaded")" -lt 60 ] || fail "the program loads $(wc -l < "$work/loaded") libraries"
# What is opened later shows in a run alone: none without a picture.
for words in --help 'new droplet' "explain $work/drop.yaml"; do
  # shellcheck disable=SC2086
  LD_DEBUG=files "$birefit" $words > "$work/out" 2> "$work/opened" || fail "birefit $words"
  grep -qE "$images" "$work/opened" && fail "birefit $words opens the image libraries"
done
reads_and_writes "$birefit" built

cmake --install "$(dirname "$birefit")" --prefix "$work/prefix" > "$work/install.log" || fail 'install'
mv "$work/prefix" "$work/elsewhere"
ldd "$work/elsewhere/bin/birefit" | grep -E "$images|not found" && fail 'the installed program misses or links libraries'
reads_and_writes "$work/elsewhere/bin/birefit" installed
ln -s "$work/elsewhere/bin/birefit" "$work/link"
reads_and_writes "$work/link" linked

# Without the library only what needs no image goes, and the error is one of the installation's.
find "$work/elsewhere" -name 'libbirefit_images*' -delete
"$work/elsewhere/bin/birefit" new droplet > "$work/out" 2>&1 || fail 'new needs the image libraries'
"$work/elsewhere/bin/birefit" fit "$work/droplet.yaml" --out "$work/without" > "$work/out" 2>&1
[ $? -eq 2 ] || fail 'a missing library is no error of the installation'
grep -q 'libbirefit_images.so: what reads and writes images cannot be opened' "$work/out" ||
  fail "of a missing library is said: $(head -3 "$work/out")"

[ $failures -eq 0 ] && echo 'all as required' || echo "$failures failures"
exit $((failures > 0))
