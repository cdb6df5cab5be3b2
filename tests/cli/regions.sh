#!/usr/bin/env bash
# A region of a large file costs what the region costs; binned pixels give the same answer. usage: regions.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1

"$birefit" new droplet --demo demo > demo.txt 2>&1 || fail 'the demonstration'
picture=$(find demo -name '*.png' | head -1)
config=demo/droplet.yaml
# NAME OPTION ..: a fit of the demonstration with other keys
fit() { local name=$1; shift; "$birefit" fit "$config" --out "$name" "$@" > "$name.txt" 2> "$name.err"; echo $? > "$name.code"; }
# Two fits have the same numbers, errors that differ by no more than a ratio, and describe their pictures.
agree() {  # NAME NAME RATIO
  paste -d ' ' <(grep '+/-' "$1.txt") <(grep '+/-' "$2.txt") | awk -v pair="$1 and $2" -v ratio="$3" '
    { k = 0
      for (i = 1; i < NF; ++i) if ($i == "+/-") { ++k; name[k] = $(i - 3); value[k] = $(i - 1); error[k] = $(i + 1) }
      if (k != 2 || name[1] != name[2]) next
      ++n
      off = value[1] - value[2]; if (off < 0) off = -off
      if (off > error[1] + error[2]) { print "FAIL " pair ": " name[1] " = " value[1] " and " value[2] " +/- " error[2]; bad = 1 }
      if ((error[2] > ratio * error[1] || error[1] > ratio * error[2]) && name[1] !~ /gain|offset/) { print "FAIL " pair ": errors of " name[1] ", " error[1] " and " error[2]; bad = 1 } }
    END { if (n < 3) { print "FAIL " pair ": " n + 0 " numbers compared"; bad = 1 } exit bad }' || failures=$((failures + 1))
  for name in "$1" "$2"; do
    [ "$(cat "$name.code")" = 0 ] || fail "$name ends with $(cat "$name.code"): $(head -2 "$name.err")"
    python3 -c 'import json, sys
f = json.load(open(sys.argv[1] + "/fit.json"))
c = f["reduced_chi_square"]
sys.exit(not 0.8 < c < 1.25)' "$name" || fail "$name: reduced chi-square is not about 1"
  done
}
fit whole
fit binned --set micrograph.bin=2
fit coarse --set micrograph.bin=4
agree whole binned 6  # errors of the whole picture contain a discrepancy that binned ones of this size do not
agree binned coarse 1.6
size=$(oiiotool --info "$picture" | sed 's/.* : *\([0-9]*\) x *\([0-9]*\),.*/\1 \2/')
read -r width height <<< "$size"
oiiotool --info binned/residual.tif | grep -q "$((width / 2)) x *$((height / 2))" || fail 'a binned residual has another size'
"$birefit" explain "$config" --set micrograph.bin=2 > explain.txt 2>&1
grep -q 'each the mean of 2 x 2 pixels of the file' explain.txt || fail 'explain does not say of what a pixel is the mean'

# The same picture inside a large one: places in the file move by where it lies, all else stays.
for kind in tiles rows; do
  tiles=''
  [ $kind = tiles ] && tiles='--tile 128 128'
  # shellcheck disable=SC2086
  oiiotool "$picture" --create 4000x3000 1 --paste +2100+1300 $tiles -d uint16 -o "$kind.tif" > oiiotool.txt 2>&1 ||
    fail "oiiotool: $(cat oiiotool.txt)"
  fit "$kind" --image "$kind.tif" --set "micrograph.roi_px=[2100, 1300, $((2100 + width)), $((1300 + height))]"
  for key in x y; do
    moved=$([ $key = x ] && echo 2100 || echo 1300)
    awk -v key="center_px.$key" -v moved="$moved" '
      $1 ~ key "$" && $4 == "+/-" { place[FILENAME] = $3; error = $5 }
      END { off = place[ARGV[2]] - place[ARGV[1]] - moved; exit !(off * off < error * error) }' whole.txt "$kind.txt" ||
      fail "$kind: the centre did not move by $moved"
  done
  grep '+/-' whole.txt | grep -v center_px | cut -d'[' -f1 > a
  grep '+/-' "$kind.txt" | grep -v center_px | cut -d'[' -f1 > b
  diff a b > difference || fail "$kind: $(cat difference)"
done

[ $failures -eq 0 ] && echo 'all as required' || echo "$failures failures"
exit $((failures > 0))
