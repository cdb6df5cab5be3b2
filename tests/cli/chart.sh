#!/usr/bin/env bash
# birefit chart: its tables hold together, and say what theory says they must.
set -uo pipefail
program=$1
rm -rf out
"$program" chart --quick --quiet --out out || { echo "FAILED: exit code $?"; exit 1; }
awk -F, '
  function fail(text) { print "FAILED: " text; bad = 1 }
  FNR == 1 { for (i = 1; i <= NF; ++i) column[$i] = i; next }
  FILENAME ~ /scenes/ {
    # Two methods of different order agree on every reference (the columns count from the end: "what" holds commas).
    if (!($(NF - 2) < 1e-11)) fail($1 ": the reference is agreed on to " $(NF - 2) " only")
    ++scenes; next
  }
  { error[$1, $2, $3] = $column["jones_error"]; time[$1, $2, $3] = $column["seconds_per_ray"]; samples[$1, $2, $3] = $column["medium_samples_per_ray"] }
  END {
    if (scenes != 7) fail(scenes " scenes")
    # Orders on the twisted cell, from 64 to 256 steps: errors fall by 4^order.
    split("layers_edge 1 layers_midpoint 2 magnus4 4", order, " ")
    for (i = 1; i <= 5; i += 2) {
      measured = log(error["twisted_cell", order[i], "n=64"] / error["twisted_cell", order[i], "n=256"]) / log(4)
      if (measured < order[i + 1] - 0.3 || measured > order[i + 1] + 0.3) fail(order[i] " has order " measured)
    }
    # A radial droplet needs one phase integral; a cholesteric is what that cannot do.
    if (!(error["hedgehog", "diagonal", "n=64"] < 1e-10)) fail("diagonal on the hedgehog: " error["hedgehog", "diagonal", "n=64"])
    if (!(error["cholesteric", "diagonal", "n=16"] > 1e-2)) fail("diagonal on the cholesteric: " error["cholesteric", "diagonal", "n=16"])
    # An axis that does not turn is the best case of the closed form (b2 = 0).
    if (!(error["e44_plate", "wei_norman", "n=16"] < 1e-5)) fail("wei_norman on the heated plate")
    if (samples["twisted_cell", "magnus4", "n=64"] != 128) fail("magnus4 samples the medium twice a step")
    exit bad
  }' out/scenes.csv out/chart.csv || exit 1
# The table of the documents: the fastest effort of every method that holds 1e-4 here and at every later one.
awk -F' *[|] *' '
  function fail(text) { print "FAILED: summary.md: " text; bad = 1 }
  /^\| ray \| layers_edge/ && !n { n = NF; for (i = 1; i <= NF; ++i) column[$i] = i; next }
  n && NF == n && $2 !~ /^-+$/ { ++rows; for (name in column) cell[$2, name] = $column[name] }
  END {
    if (rows != 7) fail(rows " rays")
    if (cell["cholesteric", "diagonal"] != "-") fail("diagonal on the cholesteric: " cell["cholesteric", "diagonal"])
    if (!(cell["hedgehog", "diagonal"] > 0)) fail("diagonal on the hedgehog: " cell["hedgehog", "diagonal"])
    if (!(cell["twisted_cell", "magnus4"] > 0)) fail("magnus4 on the twisted cell: " cell["twisted_cell", "magnus4"])
    exit bad
  }' out/summary.md || exit 1
for picture in chart waves; do
  [ "$(tail -n 1 out/$picture.svg)" = "</svg>" ] || { echo "FAILED: $picture.svg is not complete"; exit 1; }
  grep -q "[ \"ML]-\?\(nan\|inf\)[ \".]" out/$picture.svg && { echo "FAILED: what is no number is drawn in $picture.svg"; exit 1; }
done
# Every ray and every method is named in it.
for name in $(tail -n +2 out/scenes.csv | cut -d, -f1) layers_edge magnus6 diagonal; do
  grep -q ">$name[ <]" out/chart.svg || { echo "FAILED: $name is not named in chart.svg"; exit 1; }
done
echo "all as required"
