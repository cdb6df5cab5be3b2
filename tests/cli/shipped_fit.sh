#!/usr/bin/env bash
# The README's main job from outside: the shipped micrograph, its known truth, the files a fit leaves.
set -uo pipefail
program=$1 source=$2
rm -rf out
summary=$("$program" fit "$source/fit_configs/e12_droplet.yaml" --out out) || { echo "FAILED: exit code $?"; exit 1; }
# "name = value +/- stderr ...": every estimate within 5 standard errors of data/e12_droplet/truth.csv.
awk -F, -v summary="$summary" '
  FNR > 1 {
    count = split(summary, lines, "\n")
    for (i = 1; i <= count; ++i) {
      n = split(lines[i], word, /[ \t]+/)
      for (j = 1; j <= n; ++j)
        if (word[j] == $1 && word[j + 1] == "=" && !($1 in seen)) {
          seen[$1] = 1
          difference = word[j + 2] - $2
          if (difference < 0) difference = -difference
          if (!(word[j + 4] > 0) || difference > 5 * word[j + 4]) { print "FAILED: " lines[i] ", truth " $2; bad = 1 }
        }
    }
    if (!($1 in seen)) { print "FAILED: no estimate of " $1; bad = 1 }
  }
  END { exit bad }' "$source/data/e12_droplet/truth.csv" || exit 1
for file in fit.json report.html fitted.tif residual.tif config.yaml log.txt; do
  [[ -s out/$file ]] || { echo "FAILED: no $file"; exit 1; }
done
# The report opens without network.
if grep -qiE '(src|href)="(https?:)?//' out/report.html; then echo "FAILED: the report loads something from the network"; exit 1; fi
"$program" explain "$source/fit_configs/e12_droplet.yaml" | grep -q diagonal || { echo "FAILED: explain"; exit 1; }
"$program" render "$source/fit_configs/e12_droplet.yaml" --out render.tif || { echo "FAILED: render"; exit 1; }
echo "all as required"
