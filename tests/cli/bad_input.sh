#!/usr/bin/env bash
# Bad input through the program itself: exit code 2, one message at the place of the mistake, nothing written.
# usage: bad_input.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source_dir=$(realpath "$2")
work=$(mktemp -d)
trap 'chmod -R u+w "$work"; rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
checks=0

# ---- images, byte by byte --------------------------------------------------------------------------------------------

# Without a process a byte: there are thousands of them.
le16() { local i hex; for i in "$@"; do printf -v hex '\\x%02x\\x%02x' $((i & 255)) $((i >> 8 & 255)); printf "$hex"; done; }
le32() { local i; for i in "$@"; do le16 $((i & 65535)) $((i >> 16 & 65535)); done; }
entry() { le16 "$1" "$2"; le32 "$3" "$4"; } # TIFF tag, type (3 short, 4 long), count, value

# tiff WIDTH HEIGHT BITS SAMPLES PHOTOMETRIC FORMAT DATA_BYTES NEXT_OFFSET < data    one strip, data right after the header
tiff() {
  printf 'II'; le16 42; le32 8
  le16 11
  entry 256 4 1 "$1"; entry 257 4 1 "$2"; entry 258 3 1 "$3"; entry 259 3 1 1; entry 262 3 1 "$5"
  entry 273 4 1 146; entry 277 3 1 "$4"; entry 278 4 1 "$2"; entry 279 4 1 "$7"; entry 284 3 1 1; entry 339 3 1 "$6"
  le32 "${8:-0}"
  cat
}
bytes() { head -c "$1" /dev/zero | tr '\0' "$2"; } # COUNT OCTAL_CHAR

speckle() { # 32 x 32 bytes of a plain image with contrast
  local i hex out=""
  for ((i = 0; i < 1024; ++i)); do printf -v hex '\\x%02x' $((20 + (i * 37 + i / 32 * 11) % 180)); out+=$hex; done
  printf "$out"
}
speckle > speckle.raw
tiff 32 32 8 1 1 1 1024 < speckle.raw > good.tif
# The same as an array, which takes no library to read.
{ printf '\x93NUMPY\1\0\x76\0'; printf '%-117s\n' "{'descr': '|u1', 'fortran_order': False, 'shape': (32, 32), }"; cat speckle.raw; } > good.npy
head -c 600 good.tif > truncated.tif
: > empty.tif
tiff 0 0 8 1 1 1 0 < /dev/null > no_pixels.tif
bytes 128 '\252' | tiff 32 32 1 1 1 1 128 > one_bit.tif
bytes 100 '\0' | tiff 20000 20000 8 1 1 1 400000000 > huge.tif
bytes 1024 '\377' | tiff 32 32 8 1 1 1 1024 > saturated.tif
printf '\0\0\300\177%.0s' {1..1024} | tiff 32 32 32 1 1 3 4096 > nan.tif
# Two pages: the second directory is a copy of the first behind the data, with the same strip.
{ tiff 32 32 8 1 1 1 1024 1170 < speckle.raw; tiff 32 32 8 1 1 1 1024 < /dev/null | tail -c +9; } > pages.tif
# Palette: 256 colours of three 16-bit values behind the data.
{
  printf 'II'; le16 42; le32 8; le16 11
  entry 256 4 1 32; entry 257 4 1 32; entry 258 3 1 8; entry 259 3 1 1; entry 262 3 1 3
  entry 273 4 1 146; entry 277 3 1 1; entry 278 4 1 32; entry 279 4 1 1024; entry 284 3 1 1; entry 320 3 768 1170
  le32 0; cat speckle.raw; head -c 1536 speckle.raw speckle.raw 2>/dev/null | head -c 1536
  bytes 1536 '\100'
} > palette.tif
# RGB: bits per sample 8, 8, 8 lie behind the data.
{
  printf 'II'; le16 42; le32 8; le16 11
  entry 256 4 1 32; entry 257 4 1 32; entry 258 3 3 3218; entry 259 3 1 1; entry 262 3 1 2
  entry 273 4 1 146; entry 277 3 1 3; entry 278 4 1 32; entry 279 4 1 3072; entry 284 3 1 1; entry 274 3 1 1
  le32 0; cat speckle.raw speckle.raw speckle.raw; le16 8 8 8
} > colour.tif
# Animated GIF, 1 x 1, two frames, two colours.
gif_frame='\x21\xf9\x04\x00\x0a\x00\x00\x00\x2c\x00\x00\x00\x00\x01\x00\x01\x00\x00\x02\x02\x44\x01\x00'
printf "GIF89a\x01\x00\x01\x00\x80\x00\x00\x00\x00\x00\xff\xff\xff$gif_frame$gif_frame\x3b" > animated.gif

# ---- configs ---------------------------------------------------------------------------------------------------------

# config [SED_EXPRESSION...]: a sound config for good.npy, changed. Line numbers in the expectations count in it.
config() {
  cat > base.yaml <<'YAML'
micrograph:
  image: good.npy
  pixel_size_um: 0.5
  gain: {fit: auto}
  offset: {fit: auto}
  center_px: [15.5, 15.5]
sample:
  droplet:
    diameter_um: {value: 9.3, fit: [8.5, 10.0]}
    director: {radial: {}}
  material: {ordinary: 1.52, birefringence: 0.2}
  surround: {index: 1.43}
microscope:
  light: {wavelength_nm: 590}
  polarizer_deg: 0
  analyzer_deg: 90
  objective_na: 0.8
YAML
  local expression
  for expression in "$@"; do sed -i "$expression" base.yaml; done
  mv base.yaml bad.yaml
}

fail() {
  echo "FAIL $1"
  failures=$((failures + 1))
  sed 's/^/     /' stderr.txt | head -8
}

# expect NAME PLACE WORDS: runs `fit bad.yaml`; stderr must hold a line that begins with PLACE and has WORDS (grep -E).
expect() {
  checks=$((checks + 1))
  rm -rf out
  ls -A > before.txt
  timeout 60 "$birefit" fit bad.yaml --out out > stdout.txt 2> stderr.txt
  local code=$?
  [ $code -eq 2 ] || { fail "$1: exit code $code, expected 2"; return; }
  grep -F -- "$2" stderr.txt | grep -q -E -- "$3" || { fail "$1: no message at $2 with /$3/"; return; }
  [ -e out ] && { fail "$1: a folder was written"; return; }
  [ -s stdout.txt ] && { fail "$1: something on stdout"; return; }
  return 0
}
# The same, and it must be the only message.
expect_one() {
  expect "$@" || return
  [ "$(wc -l < stderr.txt)" -eq 1 ] || fail "$1: more than one message"
}

touch stdout.txt stderr.txt before.txt

for image in missing truncated empty no_pixels one_bit huge saturated nan pages palette colour; do
  config "s/good.npy/$image.tif/"
  case $image in
    missing) words='does not exist' ;;
    truncated) words='truncated|ends|incomplete|cut|read' ;;
    empty | no_pixels) words='empty|zero|no pixel|0 bytes|cannot|not' ;;
    one_bit) words='1.bit|one bit' ;;
    huge) words='20000' ;;
    saturated) words='no usable pixel.*saturated' ;;
    nan) words='no usable pixel.*not finite' ;;
    pages) words='page' ;;
    palette) words='palette|indexed' ;;
    colour) words='channel' ;;
  esac
  expect_one "$image image" bad.yaml:2:10: "$words"
done
config 's/good.npy/animated.gif/'
expect_one 'animated image' bad.yaml:2:10: 'animat|frames|images|pages'
config 's/good.npy/bad.yaml/'
expect_one 'image that is a text' bad.yaml:2:10: 'image|format'

# Director fields outside their range, or of two kinds at once.
director() { config "s/director: {radial: {}}/director: {$1}/"; }
director 'axial: {reduced_field: 80}'
expect_one 'field outside the family' bad.yaml:10: 'reduced_field'
director 'axial: {reduced_field: 5, field_v_per_um: 1}'
expect 'field given twice' bad.yaml:10: 'reduced field and an applied'
director 'axial: {reduced_field: 5, ring_radius: 0.9, branch: hedgehog}'
expect_one 'ring of a hedgehog' bad.yaml:10: 'no ring_radius'
director 'axial: {field_v_per_um: 2}'
expect 'field without what reduces it' bad.yaml:10: 'coherence_voltage_v'
director 'bipolar: {pole_distance: 0.5}'
expect_one 'poles inside' bad.yaml:10: 'pole_distance'
config 's/  droplet:/  shell:/; s/director: {radial: {}}/wall_um: 6/'
expect_one 'wall thicker than the radius' bad.yaml:10: 'no core'
config 's/  droplet:/  shell:/; s/director: {radial: {}}/wall_um: 1\n    core_offset_um: [0.9, 0.9, 0]/'
expect_one 'core outside the shell' bad.yaml:11: 'leave the wall'
config '$aphysics: {rays: eikonal}' 's/radial: {}/radial: {twist_deg: 40}/'
expect_one 'curved rays through a twist' bad.yaml: 'without twist'
config '$aphysics: {rays: eikonal}' 's/radial: {}/bipolar: {}/'
expect_one 'curved rays through a bipolar droplet' bad.yaml: 'rays: eikonal is for radial droplets'
config '$aphysics: {rays: eikonal}' 's/  droplet:/  shell:/; s/director: {radial: {}}/wall_um: 1\n    core_offset_um: [0.2, 0, 0]/'
expect_one 'curved rays around a core off the middle' bad.yaml: 'whose core is in the middle'

config '/pixel_size_um/d'
expect_one 'missing pixel size' bad.yaml:1:1: 'pixel_size_um'
config 's/gain: .*/gain: {fit: auto/'
expect_one 'syntax error' bad.yaml: 'syntax error'
config '5s/offset/gain/'
expect_one 'duplicate key' bad.yaml:5:3: 'duplicate key gain'
{ echo 'a: &a [x, x, x, x, x, x, x, x, x]'; for l in b c d e f g h i; do p=$(echo $l | tr b-i a-h); echo "$l: &$l [*$p, *$p, *$p, *$p, *$p, *$p, *$p, *$p, *$p]"; done; } > bad.yaml
expect_one 'alias bomb' bad.yaml:1: 'alias'
{ printf 'sample: '; bytes 10000 '['; bytes 10000 ']'; echo; } > bad.yaml
expect_one '10,000-deep flow nesting' bad.yaml:1: 'deeper than'
{ printf 'sample:\n  '; for ((i = 0; i < 10000; ++i)); do printf -- '- '; done; echo x; } > bad.yaml
expect_one '10,000-deep list nesting' bad.yaml:2: 'deeper than'
awk 'BEGIN { for (i = 0; i < 2500; ++i) { printf "%*sa:\n", i, "" } }' > bad.yaml
expect_one '2,500-deep block nesting' bad.yaml:65: 'deeper than'
{ printf 'sample: '; for ((i = 0; i < 10000; ++i)); do printf '{a: '; done; } > bad.yaml
expect_one '10,000 unclosed maps' bad.yaml:1: 'deeper than'
: > bad.yaml
expect_one 'empty config' bad.yaml: 'empty'
printf 'sample: \xff\xfe\n' > bad.yaml
expect_one 'binary config' bad.yaml:1:9: 'UTF-8'
head -c 5000000 /dev/zero | tr '\0' '#' > bad.yaml
expect_one '5 MB config' bad.yaml: '4 MB'
config; printf -- '---\na: 1\n' >> bad.yaml
expect_one 'two documents' bad.yaml: 'second YAML document'
rm bad.yaml
expect_one 'missing config' bad.yaml: 'does not exist'
mkdir bad.yaml
expect_one 'config is a folder' bad.yaml: 'folder'
rmdir bad.yaml

config 's/wavelength_nm/wavelenght_nm/'
expect_one 'unknown key' bad.yaml:14:11: 'unknown key wavelenght_nm.*did you mean wavelength_nm'
config 's/surround: .*/surround: 1.43/'
expect 'wrong type' bad.yaml:12:13: 'must be a map'
config 's/590/green/'
expect_one 'text for a number' bad.yaml:14:26: 'wavelength_nm must be a number, found green'
config 's/: {value: 9.3.*/: .nan/'
expect_one 'NaN' bad.yaml:9:18: 'diameter_um = .nan is not a finite number'
config 's/: {value: 9.3.*/: -.inf/'
expect_one 'infinite length' bad.yaml:9:18: 'not a finite number'
config 's/: {value: 9.3.*/: -3.2/'
expect_one 'negative length' bad.yaml:9:18: 'diameter_um = -3.2 is outside \(0, 10000\]; did you mean 3.2\?'
config 's/590/0.59/'
expect_one 'wavelength in um' bad.yaml:14:26: 'did you mean 590\? the key is in nm'
config 's/0.5$/500/'
expect_one 'pixel size in nm' bad.yaml:3:18: 'did you mean 0.5\? the key is in um'
config 's/: {value: 9.3.*/: 9300/'
expect_one 'diameter in nm' bad.yaml:9:18: 'field of view.*did you mean 9.3\?'
config 's/: {value: 9.3.*/: 9.3e-6/'
expect_one 'diameter in m' bad.yaml:9:18: 'did you mean 9.3\?'
config 's/objective_na: .*/objective_na: 80/'
expect_one 'aperture in percent' bad.yaml:17:17: 'did you mean 0.8\?'
config '$d' '$a physics: {ceiling: wave}'
expect_one 'waves without an aperture' bad.yaml:17:20: 'ceiling: wave needs microscope.objective_na'
config 's/objective_na: .*/objective_na: 1.5/' '$a physics: {ceiling: wave}'
expect_one 'aperture beyond the host' '' 'objective_na 1.5 is above the surround.s index 1.43'
config 's/9.3, fit: \[8.5, 10.0\]/900/' 's/pixel_size_um: 0.5/pixel_size_um: 18/' 's/radial: {}/bipolar: {azimuth_deg: 0}/' '$a physics: {ceiling: wave}'
expect_one 'a sphere too large for waves' '' 'wave optics of a sphere of 900 um would need .* GB and .* min an image'
config 's/  polarizer_deg: 0/  focus_um: 3\n  polarizer_deg: 0/' '$d'
expect_one 'defocus without waves' bad.yaml:15:13: 'defocus needs wave optics'
config '$a physics: {ceiling: waves}'
expect_one 'unknown ceiling' bad.yaml:18:20: 'waves'
config 's/\[8.5, 10.0\]/[10, 8.5]/'
expect_one 'bounds reversed' bad.yaml:9:36: 'reversed; did you mean \[8.5, 10\]'
config 's/value: 9.3/value: 12/'
expect_one 'start outside bounds' bad.yaml:9:26: 'outside its fit bounds'
config 's/\[8.5, 10.0\]/[-1, 10]/'
expect_one 'bound outside range' bad.yaml:9:37: 'bound -1 is outside'
config 's/0.2}/{value: 0.2, exact: true, prior_sd: 0.01}}/'
expect_one 'exact, and known to something' bad.yaml:11: 'is exact and has a prior_sd'
config '10a\  cell: {thickness_um: 5, director: {uniform: {azimuth_deg: 0}}}'
expect_one 'two sample kinds' bad.yaml:11:3: 'droplet and cell'
config 's/center_px: .*/center_px: [300, 300]/'
expect_one 'droplet outside image' bad.yaml:6:15: 'outside'
config '6a\  roi_px: [0, 0, 64, 32]'
expect_one 'roi outside image' bad.yaml:7:11: 'outside'
config 's/wavelength_nm: 590/wavelength_nm: -590/' 's/index: 1.43/index: 143/'
expect 'all mistakes at once' bad.yaml:12:21: 'index = 143'
expect 'all mistakes at once' bad.yaml:14:26: 'did you mean 590'
config '3a\  calibration: {dark: a.tif, parallel: b.tif}'
expect 'missing calibration frames' bad.yaml:4:23: 'does not exist'
expect 'missing calibration frames' bad.yaml:4:40: 'does not exist'
config; echo 'prior: {from: none.json, parameters: [sample.droplet.diameter_um]}' >> bad.yaml
expect_one 'missing prior' bad.yaml:18:15: 'does not exist'

# ---- series ------------------------------------------------------------------------------------------------------------

# series MICROGRAPHS [SED_EXPRESSION...]: the sound config with this in place of its image. expect_series NAME PLACE WORDS.
series() {
  local block=$1
  shift
  config '/image: good.npy/d' "1i micrographs: $block" "$@"
}
expect_series() {
  checks=$((checks + 1))
  rm -rf out
  timeout 60 "$birefit" series bad.yaml --out out > stdout.txt 2> stderr.txt
  local code=$?
  [ $code -eq 2 ] || { fail "$1: exit code $code, expected 2"; return; }
  grep -F -- "$2" stderr.txt | grep -q -E -- "$3" || { fail "$1: no message at $2 with /$3/"; return; }
  [ "$(wc -l < stderr.txt)" -eq 1 ] || fail "$1: more than one message"
  [ -e out ] && fail "$1: a folder was written"
  return 0
}
mkdir -p frames other
cp good.npy frames/f1.npy
cp good.npy frames/f2.npy
cp good.npy other/f1.npy
table() { printf '%s\n' "$@" > frames.csv; }
both='{files: "frames/*.npy", set_from: frames.csv}'

config
expect_series 'series of a single image' bad.yaml: 'is no series.*run birefit fit bad.yaml'
series '{files: "frames/*.npy", shared: [sample.droplet.diameter_um]}'
expect_one 'fit of a series' bad.yaml:1:47: 'run birefit series bad.yaml'
series '{files: "frames/*.npy", own: [sample.droplet.diameter_um]}'
expect_series 'series of one fit' bad.yaml:1:44: 'micrographs.own is of one fit of all images'
series '{files: "frames/*.png"}'
expect_series 'no file matches' bad.yaml:1:22: 'no file matches frames/\*.png'
series '{file: "frames/*.npy", set_from: frames.csv}'
table 'file' 'frames/f1.npy'
expect_series 'unknown key of a series' bad.yaml:1:15: 'unknown key file in micrographs; did you mean files'
series '{files: "*/f1.npy"}'
expect_series 'two frames of a name' bad.yaml:1:22: 'frames/f1.npy and other/f1.npy are both called f1'
series '{files: "frames/*.npy", set_from: none.csv}'
expect_series 'missing table' bad.yaml:1:48: 'none.csv does not exist'
series "$both"
table 'name,surround.index' 'f1.npy,1.43' 'f2.npy,1.44'
expect_series 'table without files' frames.csv:1:1: 'has no column file'
table 'file,sample.surround.indx' 'f1.npy,1.43' 'f2.npy,1.44'
expect_series 'unknown path in the header' frames.csv:1:6: 'sample.surround.indx is no parameter.*did you mean sample.surround.index'
table 'file,sample.surround.index' 'f1.npy,1.43' 'f2.npy,wide'
expect_series 'text in the table' frames.csv:3:8: 'index must be a number, found wide'
table 'file,sample.surround.index' 'f1.npy,1.43' 'f2.npy,143'
expect_series 'number out of range in the table' frames.csv:3:8: 'index = 143 is outside'
table 'file,sample.surround.index' 'f1.npy,1.43' 'f2.npy,'
expect_series 'empty cell' frames.csv:3:8: 'index must be a number, found nothing'
table 'file,sample.surround.index' 'f1.npy,1.43' 'f2.npy,1.44,1'
expect_series 'row too long' frames.csv:3: 'has 3 fields'
table 'file,sample.surround.index' 'f1.npy,1.43'
expect_series 'file without a row' bad.yaml:1:22: 'frames/f2.npy has no row in frames.csv'
table 'file,sample.surround.index' 'f1.npy,1.43' 'f2.npy,1.43' ',1.43'
expect_series 'row without a file' frames.csv:4:1: 'names no file'
table 'file,sample.surround.index' 'f1.npy,1.43' 'f2.npy,1.43' 'good.npy,1.43'
expect_series 'row of another file' frames.csv:4:1: 'good.npy is not among the files of the series'
table 'file,sample.surround.index' 'f1.npy,1.43' 'f2.npy,1.43' 'f1.npy,1.43'
expect_series 'file with two rows' frames.csv:4:1: 'f1.npy has a row already, in line 2'
table 'file,time_s' 'f1.npy,1' 'f2.npy,soon'
series '{files: "frames/*.npy", set_from: frames.csv, along: time_s}'
expect_series 'text along the axis' frames.csv:3:8: 'time_s must be a number, found soon'
series '{files: "frames/*.npy", set_from: frames.csv, along: times}'
expect_series 'axis that is no column' bad.yaml:1:67: 'times, which is no column of frames.csv; did you mean time_s'
series '{files: "frames/*.npy", shared: [sample.droplet.diamter_um]}'
expect_series 'unknown shared parameter' bad.yaml:1:47: 'no parameter of this config; did you mean sample.droplet.diameter_um'
series '{files: "frames/*.npy", shared: [microscope.polarizer_deg]}'
expect_series 'shared parameter that is known' bad.yaml:1:47: 'is not fitted here'
cp truncated.tif other/f1.tif
series '{files: "other/*.tif"}'
expect_series 'a truncated frame alone' bad.yaml:1:22: 'f1.tif. is truncated or damaged'

# ---- output ----------------------------------------------------------------------------------------------------------

config
checks=$((checks + 1))
echo mine > taken
"$birefit" fit bad.yaml --out taken > stdout.txt 2> stderr.txt
[ $? -eq 2 ] && [ "$(cat taken)" = mine ] && grep -q '^taken: ' stderr.txt || fail 'output folder is a file'
checks=$((checks + 1))
"$birefit" fit bad.yaml --out taken/below > stdout.txt 2> stderr.txt
[ $? -eq 2 ] && grep -q '^taken/below: ' stderr.txt || fail 'output folder below a file'
checks=$((checks + 1))
"$birefit" fit bad.yaml --out /proc/birefit > stdout.txt 2> stderr.txt
[ $? -eq 2 ] && grep -q '^/proc/birefit: ' stderr.txt || fail 'unwritable output folder'
checks=$((checks + 1))
"$birefit" render bad.yaml --out image.jpg > stdout.txt 2> stderr.txt
[ $? -eq 2 ] && [ ! -e image.jpg ] && grep -q 'image.jpg.*\.exr' stderr.txt || fail 'render to an unknown format'
checks=$((checks + 1))
"$birefit" render bad.yaml --out none/image.tif > stdout.txt 2> stderr.txt
[ $? -eq 2 ] && grep -q 'does not exist' stderr.txt || fail 'render into a missing folder'
# A disk that is full: a mount of a few kilobytes, where the tests may mount (as root in a container).
mkdir full
if unshare -m true 2> /dev/null && unshare -m sh -c "mount -t tmpfs -o size=4k none full" 2> /dev/null; then
  checks=$((checks + 1))
  unshare -m sh -c "mount -t tmpfs -o size=4k none full && head -c 4096 /dev/zero > full/filler
    '$birefit' fit bad.yaml --out full > stdout.txt 2> stderr.txt; code=\$?; [ \$code -eq 2 ] && [ \"\$(ls -A full)\" = filler ]" ||
    fail 'full disk'
  grep -q 'disk is full\|cannot be written\|No space' stderr.txt || fail 'full disk: message'
else
  echo 'SKIP full disk: this user may not mount'
fi
checks=$((checks + 1))
if [ -w /dev/full ]; then
  "$birefit" new droplet > /dev/full 2> stderr.txt
  [ $? -eq 2 ] && grep -q 'stdout' stderr.txt || fail 'full stdout'
fi

# ---- command line ----------------------------------------------------------------------------------------------------

for arguments in 'frobnicate' 'fit' 'fit bad.yaml --threads many' 'fit bad.yaml --nonsense' 'new teapot' 'series' ''; do
  checks=$((checks + 1))
  "$birefit" $arguments > stdout.txt 2> stderr.txt
  [ $? -eq 2 ] && [ -s stderr.txt ] || fail "arguments: $arguments"
done
for arguments in '--help' '--version' 'fit --help' 'series --help' 'new' 'new droplet' 'new cell' 'new plate' 'new crystal' 'new slab' 'new volume'; do
  checks=$((checks + 1))
  "$birefit" $arguments > stdout.txt 2> stderr.txt
  [ $? -eq 0 ] && [ -s stdout.txt ] || fail "arguments: $arguments"
done
# A parameter to look at next that the config does not fit: the message lists those it does.
checks=$((checks + 1))
"$birefit" explain "$source_dir/fit_configs/e12_droplet.yaml" --next birefringense > stdout.txt 2> stderr.txt
[ $? -eq 2 ] && grep -q 'sample.material.birefringence' stderr.txt || fail "explain --next of an unknown parameter"
# What `new` prints has no mistake but the files it cannot know.
for kind in droplet cell plate crystal slab volume; do
  checks=$((checks + 1))
  "$birefit" new $kind > new.yaml
  "$birefit" explain new.yaml > stdout.txt 2> stderr.txt
  grep -v 'does not exist' stderr.txt | grep -q . && fail "new $kind has a mistake of its own"
done

checks=$((checks + 1))
"$birefit" new series | sed 's/0.05 /0.5 /; s/frames\/\*.png/frames\/*.npy/' > bad.yaml
"$birefit" explain bad.yaml > stdout.txt 2> stderr.txt && grep -q '32 x 32 pixels' stdout.txt || fail 'new series has a mistake of its own'

echo "$checks checks, $failures failures"
[ $failures -eq 0 ]
