#!/usr/bin/env bash
# `birefit watch`: every image of a folder once, however it was written and however often the program was ended.
# usage: watch.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source_dir=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
. "$source_dir/tests/support/watch_files.sh"
watch_files "$birefit" "$source_dir" 30

refused() {  # NAME WORDS, arguments of watch
  local name=$1 words=$2
  shift 2
  "$birefit" watch "$@" > out.txt 2> err.txt
  [ $? -eq 2 ] && grep -qF -- "$words" err.txt || fail "$name: $(head -c 300 err.txt)"
}
refused 'a folder in use' 'holds a series already' crystal.yaml --folder in --out out
refused 'no folder' 'is no folder' crystal.yaml --folder none --out other
sed 's/bias_v: 700/bias_w: 700/' crystal.yaml > wrong.yaml
refused 'a wrong config' 'bias_w' wrong.yaml --folder in --out other
[ -e other ] && fail 'a refused run leaves a folder'

# Links to what is there already are images of their own, once; a picture is that of its row, however soon it was overwritten.
mkdir links
cp pool/1.tif links/a.tif
ln -s a.tif links/latest.tif
ln links/a.tif links/again.tif
"$birefit" watch crystal.yaml --folder links --out linked --threads 1 > links.txt 2>&1 &
pid=$!
for ((k = 0; k < 600; ++k)); do
  [ "$(grep -c ': answer' links.txt)" -ge 3 ] && break
  sleep 0.1
done
expose other.tif 650 9
for ((k = 1; k <= 12; ++k)); do
  cp pool/1.tif "links/b$k.tif"
  sleep "0.0$k"
  cp other.tif "links/b$k.tif"
done
for ((k = 0; k < 600; ++k)); do
  [ "$(grep -c '^b[0-9]*.tif,' linked/series.csv)" -ge 12 ] && break
  sleep 0.1
done
sleep 1
kill -TERM "$pid"
wait "$pid"
[ "$(grep -c '^latest.tif: \|^a.tif: \|^again.tif: ' links.txt)" -eq 3 ] || fail "links: $(sort links.txt | uniq -c | head)"
python3 - << 'PYTHON' || fail 'rows of overwritten pictures'
import csv
rows = list(csv.DictReader(open('linked/series.csv')))
values = {r['file']: float(r['sample.crystal.half_wave_voltage_v']) for r in rows if r['file'].startswith('b')}
assert len(values) == 12 and len(set(values.values())) == 1, values
PYTHON

# A name that is no UTF-8 is found again.
mkdir odd
cp pool/1.tif odd/$'n\xff.tif'
for run in '' --resume; do
  "$birefit" watch crystal.yaml --folder odd --out odd_out --threads 1 $run > "odd$run.txt" 2>&1 &
  pid=$!
  for ((k = 0; k < 600; ++k)); do
    grep -q ', answer\|,answer' odd_out/series.csv 2> /dev/null && break
    sleep 0.1
  done
  sleep 1
  kill -TERM "$pid"
  wait "$pid"
  cp odd_out/series.csv "odd$run.csv"
done
cmp -s odd.csv odd--resume.csv || fail "a name that is no UTF-8: $(tail -1 odd--resume.csv | head -c 200)"
grep -q 'is now called' odd--resume.txt && fail 'a file that was not renamed'

[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
