#!/usr/bin/env bash
# How the program ends: signals, too little memory, no thread to be had, text of others, records that were edited.
# usage: ends.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source_dir=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
escape=$(printf '\033')

# ---- what is fitted -----------------------------------------------------------------------------------------------------

. "$source_dir/tests/support/crystal_frames.sh"
mkdir frames
echo 'file,time_s,sample.crystal.bias_v' > frames.csv
for i in 1 2 3 4 5 6 7 8; do
  expose frames/f$i.tif $((600 + 30 * i)) $i
  echo "f$i.tif,$i,$((600 + 30 * i))" >> frames.csv
done
sed -i 's/f1.tif,1,/f1.tif,1e-400,/' frames.csv
crystal() {  # MICROGRAPH_LINES
  cat << YAML
$1
sample:
  crystal:
    half_wave_voltage_v: {value: 1400, fit: [1000, 2500]}
    bias_v: 630
    field_along: y
    electrodes_px: [-0.5, 47.5]
    field_legendre: [{value: 0.3, fit: [0.1, 0.7]}]
microscope:
  light: {wavelength_nm: 1550}
  polarizer_deg: 0
  analyzer_deg: 90
YAML
}
crystal 'micrograph: {image: frames/f1.tif}' > crystal.yaml
crystal 'micrographs: {files: "frames/*.tif", set_from: frames.csv, along: time_s, shared: ["sample.crystal.field_legendre[1]"]}' > series.yaml
run() { "$birefit" "$@" > out.txt 2> err.txt; }
# One message, exit code 2, and nothing that the terminal would obey.
refused() {  # NAME CODE WORDS
  [ "$2" -eq 2 ] || fail "$1: exit code $2"
  grep -qF -- "$3" err.txt || fail "$1: $(head -c 300 err.txt)"
  grep -q "$escape" err.txt && fail "$1: control characters on the terminal"
}

# ---- an axis of numbers too small for a double -----------------------------------------------------------------------------

run series series.yaml --out whole --threads 1 --quiet || fail "1e-400 on an axis: $(cat err.txt)"
[ "$(wc -l < whole/series.csv)" -eq 9 ] || fail 'no row for each frame'

# ---- records that were edited are made anew, from whole ones ----------------------------------------------------------------

edited() {  # NAME SED_EXPRESSION FRAMES_THAT_STAY
  cp -r whole edited
  sed -i "$2" edited/frames/f3/fit.json
  cmp -s whole/frames/f3/fit.json edited/frames/f3/fit.json && fail "$1: nothing was edited"
  run series series.yaml --out edited --threads 1 --resume || fail "$1: exit code $?"
  cmp -s whole/series.csv edited/series.csv && grep -q "^$3 frames were up to date" out.txt || fail "$1: $(head -1 out.txt)"
  rm -r edited
}
edited value 's/"value": [0-9.e+-]*/"value": 1e308/' 7
edited 'nothing known' 's/"value": [0-9.e+-]*/"value": null/' 7
edited 'degrees of freedom' 's/"degrees_of_freedom": [0-9]*/"degrees_of_freedom": 1e300/' 7
edited intervals 's/"interval_degrees_of_freedom": [0-9.]*/"interval_degrees_of_freedom": -1/' 7
edited 'white space alone' 's/^  *//' 8

# ---- signals ---------------------------------------------------------------------------------------------------------------

for signal in TERM HUP; do
  "$birefit" series series.yaml --threads 1 --out "stopped_$signal" > /dev/null 2>&1 &
  pid=$!
  for ((k = 0; k < 4000; ++k)); do
    [ -e "stopped_$signal/frames/f1/fit.json" ] && break
    sleep 0.005
  done
  kill -$signal $pid
  wait $pid
  [ $? -eq 1 ] || fail "$signal does not end like Ctrl-C"
  [ "$(wc -l < "stopped_$signal/series.csv")" -eq 9 ] && grep -q ',not done,$' "stopped_$signal/series.csv" || fail "$signal: no table"
  run series series.yaml --threads 1 --out "stopped_$signal" --resume && cmp -s whole/series.csv "stopped_$signal/series.csv" ||
    fail "$signal: resumed"
done
# Wherever it is hit, nothing half written stays: a picture of some megabytes, ended at many times.
sed 's/{image: .*}/{pixel_size_um: 1}/; s/, fit: \[[0-9., ]*\]//' crystal.yaml > large.yaml
echo 'image_size_px: [1500, 1500]' >> large.yaml
run render large.yaml --out large.exr || fail "render: $(cat err.txt)"
rm -f large.exr
for ((k = 0; k < 12; ++k)); do
  "$birefit" render large.yaml --out large.exr --threads 1 --quiet &
  pid=$!
  sleep "0.$((5 + 7 * k % 10))$k"
  kill -TERM $pid 2> /dev/null
  wait $pid 2> /dev/null
done
find . -name '.*.part' | grep -q . && fail 'half a file stays'

# ---- memory ----------------------------------------------------------------------------------------------------------------

sed -i 's/1500, 1500/16384, 16384/' large.yaml
(ulimit -v 2000000 && run render large.yaml --out large.tif)
refused 'too large a picture' $? 'this takes about'
grep -q '^large.yaml:1:1: .* of memory, and at most' err.txt || fail "memory: $(cat err.txt)"
run explain crystal.yaml && grep -q '^Memory     about [0-9]* MB' out.txt || fail 'explain does not say the memory'
grep -q '^Time       about .* to fit' out.txt || fail 'explain does not say how long a fit takes'

# ---- threads ---------------------------------------------------------------------------------------------------------------

cat > few_threads.c << 'C'
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <string.h>
/* One thread from main on, which is for reading images; the libraries that it is linked to make theirs before, those that
   it opens while it does. */
extern char *program_invocation_short_name;
static int in_main, opening;
int pthread_create(pthread_t *t, const pthread_attr_t *a, void *(*f)(void *), void *x) {
  static int (*real)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
  if (!real) real = (int (*)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *))dlsym(RTLD_NEXT, "pthread_create");
  if (in_main && !opening && in_main++ > 1) return EAGAIN;
  return real(t, a, f, x);
}
void *dlopen(const char *file, int mode) {
  void *(*real)(const char *, int) = (void *(*)(const char *, int))dlsym(RTLD_NEXT, "dlopen");
  ++opening;
  void *library = real(file, mode);
  --opening;
  return library;
}
int __libc_start_main(int (*m)(int, char **, char **), int c, char **v, void (*i)(void), void (*e)(void), void (*l)(void), void *s) {
  int (*real)(int (*)(int, char **, char **), int, char **, void (*)(void), void (*)(void), void (*)(void), void *) =
      (int (*)(int (*)(int, char **, char **), int, char **, void (*)(void), void (*)(void), void (*)(void), void *))dlsym(RTLD_NEXT, "__libc_start_main");
  in_main = !strcmp(program_invocation_short_name, "birefit");
  return real(m, c, v, i, e, l, s);
}
C
if cc -shared -fPIC few_threads.c -o few_threads.so -ldl 2> /dev/null; then
  # Opened from few_threads.so the run path is its, not the program's.
  LD_LIBRARY_PATH=$(dirname "$birefit") LD_PRELOAD=$PWD/few_threads.so "$birefit" fit crystal.yaml --threads 8 --out no_threads > out.txt 2> err.txt || fail "no thread to be had: $(cat err.txt)"
fi

# ---- text of others ----------------------------------------------------------------------------------------------------------

{ cat crystal.yaml; echo '"\e[2Jkey": 1'; } > keys.yaml
run fit keys.yaml --out keys
refused 'a key' $? 'unknown key \x1b[2Jkey'
run fit crystal.yaml --image $'frames/\033[31mred\377.tif' --out keys
refused 'a missing file' $? 'frames/\x1b[31mred\xff.tif'
run fit crystal.yaml "--$escape[2J"
refused 'an option' $? '\x1b[2J'
cp frames/f1.tif $'frames/\033[31mred\377.tif'
run fit crystal.yaml --image $'frames/\033[31mred\377.tif' --out named || fail "a file that is not named in UTF-8: $(cat err.txt)"
rm frames/*red*
grep -q "$escape" out.txt named/log.txt && fail 'a name is obeyed by the terminal'
grep -qF '\x1b[31mred\xff.tif' named/log.txt named/fit.json || fail 'a name is not shown'
iconv -f UTF-8 -t UTF-8 named/fit.json named/log.txt named/report.html > /dev/null || fail 'documents that are not UTF-8'

mkdir formulas
cp frames/f1.tif 'formulas/=1+1;=2+2.tif'
cp frames/f2.tif $'formulas/b\351ta.tif'
cp frames/f3.tif 'formulas/plain.tif'
crystal 'micrographs: {files: "formulas/*.tif"}' > formulas.yaml
run series formulas.yaml --threads 1 --quiet --out formulas_out
tail -n +2 formulas_out/series.csv | grep -q '\(^\|[;,"]\)[=+@]' && fail 'a spreadsheet would evaluate a name'
printf 'file,=1+1,sample.crystal.bias_v\n=cmd|calc.tif,-1,630\n' > formulas.csv
cp frames/f1.tif '=cmd|calc.tif'
crystal 'micrographs: {set_from: formulas.csv, along: "=1+1"}' > named.yaml
run series named.yaml --threads 1 --quiet --out named_out || fail "formulas: $(cat err.txt)"
head -1 named_out/series.csv | grep -qF "file,'=1+1,sample.crystal.bias_v," || fail 'a column'
sed -n 2p named_out/series.csv | grep -q "^\"'=cmd|calc.tif\",-1,630," || fail "a file: $(sed -n 2p named_out/series.csv)"
iconv -f UTF-8 -t UTF-8 formulas_out/series.csv > /dev/null && grep -qF 'b\xe9ta.tif' formulas_out/series.csv || fail 'a table that is not UTF-8'

cp frames/f2.tif frames/...tif
printf 'file,sample.crystal.bias_v\nframes/f1.tif,630\nframes/...tif,660\n' > dots.csv
crystal 'micrographs: {set_from: dots.csv}' > dots.yaml
run series dots.yaml --out dots
refused 'a frame named ..' $? 'dots.csv:3:1: frames/...tif without its extension is .., no name for a folder'
rm frames/...tif

# ---- files of others ---------------------------------------------------------------------------------------------------------

mkdir linked
echo precious > precious.txt
bash -c 'ln -s ../precious.txt "linked/.birefit-probe-$$"; exec "$0" fit crystal.yaml --out linked --quiet' "$birefit" || fail 'a folder with a link'
[ "$(cat precious.txt)" = precious ] || fail "another's file was written to"

{ printf '{"parameters":{},"covariance":{"names":["'; head -c 30000000 /dev/zero | tr '\0' a; printf '"],"matrix":[[1]]}}'; } > long.json
{ crystal 'micrograph: {image: frames/f1.tif, gain: {fit: auto}}'; echo 'prior: {from: long.json, parameters: [micrograph.gain]}'; } > prior.yaml
(ulimit -v 1500000 && run fit prior.yaml --out prior)
refused 'a name of 30 MB' $? 'micrograph.gain was not fitted in'
[ "$(wc -c < err.txt)" -lt 500 ] || fail 'a name of 30 MB in a message'
{ cat long.json long.json long.json; } > larger.json
sed -i 's/long.json/larger.json/' prior.yaml
run fit prior.yaml --out prior
refused 'a fit.json of 90 MB' $? 'is larger than 64 MB'

# ---- errors have a place, and pictures need no other program --------------------------------------------------------------------

crystal 'micrograph: {image: frames/f1.tif, roi_px: [10, 10, 11, 11]}' > small.yaml
run fit small.yaml --out small
refused 'one pixel' $? 'small.yaml:1:1: 1 usable pixels cannot determine'
mkdir bin
ln -s "$(command -v sh)" bin/sh
PATH=$PWD/bin "$birefit" series series.yaml --out alone --threads 1 > out.txt 2> err.txt || fail "without other programs: exit code $?"
grep -q '^8 frames: 8 answer' out.txt || fail 'without other programs: no summary'
cmp -s whole/series.csv alone/series.csv && cmp -s whole/series.svg alone/series.svg || fail 'without other programs: other files'

# ---- what is written is read by others --------------------------------------------------------------------------------------

sed 's/f1.tif}/f1.tif, pixel_size_um: 0.2}/' crystal.yaml > sized.yaml
run fit sized.yaml --out sized --npy || fail "--npy: $(cat err.txt)"
run fit sized.yaml --out again
[ -e sized/fitted.npy ] && [ ! -e again/fitted.npy ] || fail 'arrays for NumPy'
without_run() { sed '/^  "run": {/,/^  }/d' "$1"; }
without_run sized/fit.json > first.json
without_run again/fit.json | cmp -s - first.json || fail 'two runs differ in more than `run`'
grep -q "\"sha256\": \"$(sha256sum frames/f1.tif | cut -d' ' -f1)\"" first.json || fail 'the picture is not named by its SHA-256'
run fit sized.yaml --out sized
[ -e sized/fitted.npy ] && fail 'a picture of an earlier fit stays'
run fit sized.yaml --out sized --npy
cat > read.py << 'PY'
import sys
import numpy
array = numpy.load('sized/fitted.npy')
assert array.shape == (48, 48) and array.dtype == numpy.float64
readers = []
try:
    import tifffile
    readers.append(tifffile.imread)
    with tifffile.TiffFile('sized/fitted.tif') as tiff:
        tags = tiff.pages[0].tags
        pixels, lengths = tags['XResolution'].value
        assert abs(lengths / pixels * 1e4 - 0.2) < 1e-6 and tags['ResolutionUnit'].value == 3  # centimetres
except ImportError:
    pass
try:
    import skimage.io
    readers.append(skimage.io.imread)
except ImportError:
    pass
try:
    import PIL.Image
    readers.append(lambda name: numpy.asarray(PIL.Image.open(name)))
except ImportError:
    pass
for read in readers:
    assert numpy.array_equal(read('sized/fitted.tif'), array.astype(numpy.float32))
PY
for python in /usr/bin/python3 python3; do
  command -v $python > /dev/null && $python -c 'import numpy' 2> /dev/null || continue
  $python read.py || fail "$python does not read what was written"
  break
done

[ $failures -eq 0 ] && echo 'all as required' || echo "$failures failures"
exit $((failures > 0))
