#!/usr/bin/env bash
# A series from outside: a killed and resumed run leaves what an uninterrupted one does, nothing is fitted twice or lost.
# usage: series.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source_dir=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }

. "$source_dir/tests/support/crystal_frames.sh"

mkdir frames
echo 'file,time_s,sample.crystal.bias_v' > frames.csv
for i in 1 2 3 4 5 6 7 8 9 10; do
  volts=$((600 + 30 * i))
  expose frames/f$i.tif $volts $i
  echo "f$i.tif,$((10 * i)),$volts" >> frames.csv
done
cat > series.yaml <<'YAML'
micrographs: {files: "frames/*.tif", set_from: frames.csv, along: time_s, shared: ["sample.crystal.field_legendre[1]"]}
micrograph:
  gain: {fit: auto}
  offset: {fit: auto}
sample:
  crystal:
    half_wave_voltage_v: {value: 1400, fit: [1000, 2500]}
    bias_v: 700
    field_along: y
    electrodes_px: [-0.5, 47.5]
    field_legendre: [{value: 0.3, fit: [0.1, 0.7]}]
microscope:
  light: {wavelength_nm: 1550}
  polarizer_deg: 0
  analyzer_deg: 90
YAML

run() { "$birefit" series series.yaml --threads 1 "$@" > stdout.txt 2> stderr.txt; }
same() { cmp -s whole/series.csv "$1/series.csv" && cmp -s whole/shared.csv "$1/shared.csv" && cmp -s whole/series.svg "$1/series.svg"; }
done_in() { find "$1/frames" -name fit.json 2> /dev/null | wc -l; }

# ---- a whole run -----------------------------------------------------------------------------------------------------

run --out whole || { fail "exit code $?"; cat stdout.txt stderr.txt; }
[ "$(wc -l < whole/series.csv)" -eq 11 ] || fail 'not a row for each frame'
[ "$(done_in whole)" -eq 10 ] || fail 'not a fit.json for each frame'
# Every estimate within five of its errors of what the images were made with, and f10 behind f9.
awk -F, '
  NR == 1 { for (i = 1; i <= NF; ++i) at[$i] = i; next }
  function off(name, truth, d) { d = ($(at[name]) - truth) / $(at[name "_stderr"]); return !($(at[name "_stderr"]) > 0) || d > 5 || d < -5 }
  $1 != "frames/f" NR - 1 ".tif" || $(at["time_s"]) != 10 * (NR - 1) || $(at["verdict"]) != "answer" { print; bad = 1 }
  off("sample.crystal.half_wave_voltage_v", 1500) || off("sample.crystal.field_legendre[1]", 0.4) { print; bad = 1 }
  !($(at["sample.crystal.half_wave_voltage_v_low95"]) < $(at["sample.crystal.half_wave_voltage_v"])) { print; bad = 1 }
  NR > 2 && $(at["sample.crystal.field_legendre[1]"]) != before { print "not shared: " $0; bad = 1 }
  { before = $(at["sample.crystal.field_legendre[1]"]) }
  END { exit bad || NR != 11 }' whole/series.csv || fail 'series.csv'
[ "$(tail -n 1 whole/series.svg)" = '</svg>' ] || fail 'no series.svg'
grep -q '>half wave voltage (V)<' whole/series.svg && grep -q '>field legendre\[1\], shared<' whole/series.svg && grep -q '>time (s)<' whole/series.svg ||
  fail 'series.svg has other axes'
# A slow machine says once a minute how far it has come.
grep -v '^birefit: .*after [0-9]' stderr.txt | grep -q . && fail "something on stderr: $(cat stderr.txt)"

# ---- frames side by side: the same to the byte ------------------------------------------------------------------------

"$birefit" series series.yaml --threads 4 --out four --quiet > stdout.txt 2> stderr.txt || { fail 'four threads'; cat stdout.txt stderr.txt; }
same four || fail 'four threads give another result than one'

# ---- a second run does not touch it -----------------------------------------------------------------------------------

find whole -type f -exec md5sum {} + | sort > before.txt
run --out whole
[ $? -eq 2 ] && grep -q '^whole: holds a series already; --resume' stderr.txt || fail 'a folder in use'
find whole -type f -exec md5sum {} + | sort | cmp -s - before.txt || fail 'a refused run changed something'
run --out whole --resume || fail 'resume of a whole run'
grep -q '^10 frames were up to date' stdout.txt || fail 'a whole run was fitted again'
find whole -type f -exec md5sum {} + | sort | cmp -s - before.txt || fail 'resuming a whole run changed something'

# ---- killed, then resumed ---------------------------------------------------------------------------------------------

# end_early FOLDER SIGNAL: a series ended so after two frames or more; sets `code` and `finished`. A busy machine may look so
# late that all is done: then once more.
end_early() {
  local pid k attempt
  for ((attempt = 0; attempt < 5; ++attempt)); do
    rm -rf "$1"
    "$birefit" series series.yaml --threads 1 --out "$1" > /dev/null 2>&1 &
    pid=$!
    for ((k = 0; k < 2000; ++k)); do
      [ "$(done_in "$1")" -ge 2 ] && break
      sleep 0.005
    done
    kill "-$2" $pid
    wait $pid 2> /dev/null
    code=$?
    finished=$(done_in "$1")
    [ "$finished" -lt 10 ] && break
  done
}

end_early killed KILL
[ "$finished" -ge 2 ] && [ "$finished" -lt 10 ] || fail "killed after $finished frames"
find killed -name fit.json -exec stat -c '%n %i %y' {} + | sort > before.txt
# What a kill between two system calls may leave.
echo '{"version": ' > killed/frames/f1/.fit.json.1.0.part
run --out killed --resume || fail "resume: exit code $?"
same killed || fail 'a resumed run differs from an uninterrupted one'
grep -q "^$finished frames were up to date" stdout.txt || fail "of $finished finished frames: $(head -1 stdout.txt)"
find killed -name fit.json -exec stat -c '%n %i %y' {} + | sort > after.txt
[ "$(comm -12 before.txt after.txt | wc -l)" -eq "$finished" ] || fail 'a finished frame was written again'
find killed -name '*.part' | grep -q . && fail 'leftovers of the killed run'

# ---- half a record is no record ---------------------------------------------------------------------------------------

cp -r whole damaged
head -c 1000 whole/frames/f4/fit.json > damaged/frames/f4/fit.json
rm damaged/frames/f9/fit.json damaged/series.csv
run --out damaged --resume || fail 'resume of a damaged run'
same damaged && grep -q '^8 frames were up to date' stdout.txt || fail "damaged records: $(head -1 stdout.txt)"

# ---- Ctrl-C -----------------------------------------------------------------------------------------------------------

end_early stopped INT
[ "$code" -eq 1 ] || fail 'exit code after Ctrl-C'
[ "$(wc -l < stopped/series.csv)" -eq 11 ] && [ "$(grep -c ',not done,$' stopped/series.csv)" -eq $((10 - finished)) ] || fail 'series.csv after Ctrl-C'
run --out stopped --resume && same stopped || fail 'resume after Ctrl-C'

# ---- what changed is fitted again -------------------------------------------------------------------------------------

cp -r whole changed
expose frames/f10.tif 900 77
run --out changed --resume || fail 'resume with another image'
grep -q '^9 frames were up to date' stdout.txt || fail "another image: $(head -1 stdout.txt)"
cmp -s whole/series.csv changed/series.csv && fail 'another image, the same table'
expose frames/f11.tif 930 11
echo 'f11.tif,110,930' >> frames.csv
run --out changed --resume || fail 'resume with one more frame'
grep -q '^10 frames were up to date' stdout.txt && [ "$(wc -l < changed/series.csv)" -eq 12 ] || fail "one more frame: $(head -1 stdout.txt)"

# ---- nothing stale beside new results: frames that the series no longer has stand apart, and come back -----------------

cp -r changed narrowed
mkdir narrowed/frames/notes narrow && cp frames/f1.tif frames/f2.tif frames/f3.tif narrow/ && head -4 frames.csv > narrow.csv
sed 's/files: "frames/files: "narrow/; s/frames.csv/narrow.csv/' series.yaml > narrow.yaml
"$birefit" series narrow.yaml --threads 1 --resume --out narrowed > stdout.txt 2> stderr.txt || fail "fewer frames: $(cat stderr.txt)"
ls narrowed/frames | tr '\n' ' ' | grep -qx 'f1 f2 f3 notes ' || fail "stale frames beside new ones: $(ls narrowed/frames)"
ls narrowed/earlier | tr '\n' ' ' | grep -qx 'f10 f11 f4 f5 f6 f7 f8 f9 ' || fail "earlier frames: $(ls narrowed/earlier)"
grep -q 'warning: 8 frames of an earlier run are no frame of this series: moved to earlier/' stdout.txt &&
  grep -q 'warning: frames/notes is no frame of this series' stdout.txt || fail "stale frames are not said: $(cat stdout.txt)"
run --out narrowed --resume || fail 'frames that came back'
grep -q '^8 frames were up to date' stdout.txt && [ -z "$(ls narrowed/earlier)" ] || fail "frames that came back: $(head -1 stdout.txt)"
cmp -s changed/series.csv narrowed/series.csv || fail 'frames that came back: another table'

# ---- a line of units is held against the names ------------------------------------------------------------------------

{ head -1 frames.csv; echo ',s,kV'; tail -n +2 frames.csv; } > units.csv
sed 's/frames.csv/units.csv/' series.yaml > units.yaml
"$birefit" series units.yaml --out units > stdout.txt 2> stderr.txt
[ $? -eq 2 ] && grep -q 'units.csv:1:13: sample.crystal.bias_v is in kV by the table.s line of units, and in V by its name; give the column in V' stderr.txt ||
  fail "units of a table: $(cat stderr.txt)"
[ -e units ] && fail 'units of a table: something was written'
sed -i 's/,s,kV/,s,V/' units.csv
"$birefit" explain units.yaml > stdout.txt 2> stderr.txt || fail "units that agree: $(cat stderr.txt)"

# ---- frames without an answer stay ------------------------------------------------------------------------------------

sed 's/fit: \[1000, 2500\]/fit: [1000, 1450]/' series.yaml > pinned.yaml
"$birefit" series pinned.yaml --threads 1 --quiet --out pinned > stdout.txt 2> stderr.txt
[ $? -eq 1 ] && [ "$(grep -c ',at a bound,' pinned/series.csv)" -eq 11 ] || fail 'frames at a bound'

# ---- frames that cannot be read are rows, the others are fitted -----------------------------------------------------------

# Cut off, empty, absent, of another size than the mask; f1 and f6 are fitted, f6 from where f1 ended.
mkdir torn && cp frames/f1.tif frames/f6.tif torn/
head -c 1000 frames/f2.tif > torn/f2.tif
: > torn/f3.tif
{ head -c 30 frames/f1.tif; printf '\40'; tail -c +32 frames/f1.tif; } > torn/f5.tif
cp frames/f1.tif all.tif
{ head -1 frames.csv; for i in 1 2 3 4 5 6; do echo "f$i.tif,$((10 * i)),$((600 + 30 * i))"; done; } > torn.csv
sed 's/files: "frames/files: "torn/; s/frames.csv/torn.csv/; s/^micrograph:/micrograph:\n  mask: all.tif/' series.yaml > torn.yaml
"$birefit" series torn.yaml --threads 2 --out torn_out > stdout.txt 2> stderr.txt
[ $? -eq 1 ] || fail "frames that cannot be read: $(cat stderr.txt)"
cut -d, -f1 torn_out/series.csv | tail -n +2 | tr '\n' ' ' | grep -qx 'torn/f1.tif torn/f2.tif torn/f3.tif torn/f4.tif torn/f5.tif torn/f6.tif ' ||
  fail 'a frame without its row'
for row in 'f1.*,answer,$' 'f2.*,unreadable,.*truncated or damaged' 'f3.*,unreadable,.*is empty' 'f4.*,unreadable,.*does not exist' \
  'f5.*,unreadable,.*all.tif is 48 x 48 pixels, f5.tif is 48 x 32' 'f6.*,answer,$'; do
  grep -q "^torn/$row" torn_out/series.csv || fail "no row /$row/ in $(cat torn_out/series.csv)"
done
grep -q '2 answer, 4 unreadable' stdout.txt && grep -q '^unreadable: f2: .*truncated' stdout.txt || fail 'unreadable frames are not said'
ls torn_out/frames | tr '\n' ' ' | grep -qx 'f1 f6 ' || fail 'results of a frame that cannot be read'
cp frames/f2.tif frames/f3.tif frames/f4.tif frames/f5.tif torn/
"$birefit" series torn.yaml --threads 2 --resume --out torn_out > stdout.txt 2> stderr.txt || fail "frames that came back: $(cat stderr.txt)"
grep -q '^1 frames were up to date' stdout.txt || fail "frames that came back: $(head -1 stdout.txt)"
head -c 1000 frames/f2.tif > torn/f2.tif
cp -r torn_out torn_later && "$birefit" series torn.yaml --threads 2 --resume --quiet --out torn_later
[ $? -eq 1 ] && [ ! -e torn_later/frames/f2 ] && [ -e torn_later/earlier/f2/fit.json ] || fail 'the result of a frame that can no longer be read'
cp frames/f2.tif torn/
"$birefit" series torn.yaml --threads 2 --quiet --out torn_whole && cmp -s torn_out/series.csv torn_whole/series.csv || fail 'frames that came back: not what they are'

# ---- text of others is drawn, never run --------------------------------------------------------------------------------

sed 's/along: time_s/along: "t`touch RunByColumn`<\&"/' series.yaml > named.yaml
sed -i 's/files: "frames/files: "few/; s/frames.csv/few.csv/' named.yaml
mkdir few && cp frames/f1.tif frames/f2.tif frames/f3.tif few/
{ echo 'file,t`touch RunByColumn`<&,sample.crystal.bias_v'; sed -n '2,4p' frames.csv; } > few.csv
"$birefit" series named.yaml --threads 1 --quiet --out named > stdout.txt 2> stderr.txt || fail "a column with backticks: $(cat stderr.txt)"
[ -e RunByColumn ] && fail "a column's name was run as a command"
grep -qF '>t`touch RunByColumn`&lt;&amp;<' named/series.svg || fail "a column's name is not on its axis"
"$birefit" series named.yaml --threads 1 --quiet --out $'lines\nsystem "touch RunByFolder"\n#' > stdout.txt 2> stderr.txt || fail "a folder with line ends: $(cat stderr.txt)"
[ -e RunByFolder ] && fail "a folder's name was run as a command"
[ -e lines ] && fail 'the picture went to a part of the folder name'
cmp -s named/series.svg $'lines\nsystem "touch RunByFolder"\n#/series.svg' || fail 'the picture is not in its folder'

[ $failures -eq 0 ] && echo 'all as required' || echo "$failures failures"
exit $((failures > 0))
