#!/usr/bin/env bash
# `birefit audit`: pictures that are nearly the model's are paid for or refused, and what it says of them is what the
# files hold. usage: audit.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
says() { grep -q -- "$2" "$1" || { fail "$1 does not say: $2"; cat "$1"; }; }
cp "$source/fit_configs/audit/droplet.yaml" .
"$birefit" audit droplet.yaml --list > list.txt 2>&1 || fail 'list'
for departure in microscope.polarizer_deg sample.surround.index bandwidth leak 'field stop' blur neighbour gamma 'black cut' compressed; do
  says list.txt "^$departure "
done
grep -q 'lamp' list.txt && fail 'one picture has no drift'

some=()
for departure in microscope.polarizer_deg sample.surround.index leak 'field stop' 'uneven light' blur 'pixel aspect' gamma 'black cut'; do
  some+=(--departure "$departure")
done
"$birefit" audit droplet.yaml --problems 1 "${some[@]}" --out a > a.txt 2>&1 || { fail 'audit'; cat a.txt; }
cat a.txt
awk -f "$source/tests/support/audit_law.awk" a/audit.csv || failures=$((failures + 1))
says a/audit.svg '>blur<'
says a/intervals.csv '^"none","",0,"answer",0,"sample.droplet.diameter_um",'

# The same numbers from the same seed, on as many threads as one likes; others from another.
"$birefit" audit droplet.yaml --departure gamma --problems 1 --out b -q --threads 1 || fail 'one departure'
"$birefit" audit droplet.yaml --departure gamma --problems 1 --out c -q --threads 2 || fail 'two threads'
cmp -s b/intervals.csv c/intervals.csv || fail 'not the same numbers from the same seed'
"$birefit" audit droplet.yaml --departure gamma --problems 1 --out d -q --seed 2 || fail 'seed'
cmp -s b/intervals.csv d/intervals.csv && fail 'the same numbers from another seed'

# What a fit does not ask for it charges for or refuses; what it does not know it does not take.
"$birefit" audit droplet.yaml --departure gamma --problems 1 --out g -q --without gamma --without curve || fail 'without'
cmp -s b/intervals.csv g/intervals.csv && fail 'asked for what it was not to ask for'
"$birefit" audit droplet.yaml --without fog > f.txt 2>&1 && fail 'without what nobody knows'

"$birefit" audit droplet.yaml --departure fog --out e > e.txt 2>&1
[ $? -eq 2 ] || fail 'an unknown departure does not end in 2'
says e.txt 'fog is no departure'
says e.txt 'field stop'
[ -e e ] && fail 'a folder of nothing is left'
"$birefit" audit "$source/fit_configs/twisted_cell.yaml" --list > cell.txt 2>&1 || fail 'cell'
says cell.txt '^lamp drift '
grep -q '^blur ' cell.txt && fail 'a cell is one number a picture'
grep -q '^charge ' cell.txt && fail 'charge in a cell'
"$birefit" audit "$source/fit_configs/pockels_field.yaml" --list > bar.txt 2>&1 || fail 'bar'
says bar.txt '^charge '
# Electrodes that are elsewhere, and what looks like a field that bends.
"$birefit" audit "$source/fit_configs/pockels_field.yaml" --departure 'pixel aspect' --departure charge --departure gamma --problems 2 --out h -q > bar_run.txt 2>&1 || { fail 'audit of a bar'; cat bar_run.txt; }
awk -F, 'NR > 1 { of += $8; held += $9 } END { print held " of " of " intervals of a bar hold"; exit !(of >= 40 && held >= 0.93 * of) }' h/audit.csv || fail 'intervals of a bar'
# A dial that is off by what dials are off by: another twist that takes it as it stands is no plain answer.
"$birefit" audit "$source/fit_configs/crossed_cell.yaml" --departure sample.cell.director.twisted.azimuth_deg --problems 2 --out t -q > dial.txt 2>&1 || { fail 'audit of a cell'; cat dial.txt; }
awk -F, '$4 == "\"answer\"" && $11 > 2.5 { print; bad = 1 } END { exit bad }' t/intervals.csv || fail 'a dial makes another twist an answer'
[ "$failures" -eq 0 ] && echo ok
exit "$failures"
