#!/usr/bin/env bash
# The shipped fits from outside: data, known truth, the files a fit leaves; and the shipped slab's matrices.
set -uo pipefail
program=$1 source=$2
rm -rf out_*

# Every estimate within 5 standard errors of truth.csv, by the names of the fit's parameters.
fit_and_compare() {  # CONFIG [DATA [OPTION ..]]
  local config=$1 data=${2:-$1} summary
  summary=$("$program" fit "$source/fit_configs/$config.yaml" "${@:3}" --out "out_$config") || { echo "FAILED: $config, exit code $?"; exit 1; }
  # "name = value +/- stderr ..."
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
    END { exit bad }' "$source/data/$data/truth.csv" || exit 1
  for file in fit.json report.html config.yaml log.txt; do
    [[ -s out_$config/$file ]] || { echo "FAILED: $config leaves no $file"; exit 1; }
  done
  # The report opens without network.
  if grep -qiE '(src|href)="(https?:)?//' "out_$config/report.html"; then echo "FAILED: the report loads something from the network"; exit 1; fi
}
for config in e12_droplet wave_droplet bipolar_droplet eccentric_shell e44_plate twisted_cell axial_droplet disc freedericksz_sweep; do fit_and_compare $config; done
fit_and_compare e12_polarizers e12_droplet
# A quarter of the pixels: every one of them is 36 rays through 32 layers.
fit_and_compare volume volume --set "micrograph.roi_px=[12,12,36,36]"
for file in fitted.tif residual.tif; do
  [[ -s out_e12_droplet/$file ]] || { echo "FAILED: no $file"; exit 1; }
done
# Five times the noise that the table has is no good news.
"$program" fit "$source/fit_configs/freedericksz_sweep.yaml" --set signal.noise=0.05 --out out_loud 2>&1 | grep -q 'far less than the noise that is stated' ||
  { echo "FAILED: noise stated too large is not named"; exit 1; }
"$program" explain "$source/fit_configs/e12_droplet.yaml" | grep -q diagonal || { echo "FAILED: explain"; exit 1; }
"$program" render "$source/fit_configs/e12_droplet.yaml" --out render.tif || { echo "FAILED: render"; exit 1; }

# The shipped slab is a uniform 90-degree twist; along its normal between crossed polarizers, the first along its
# director, it transmits 1 - sin^2(pi/2 sqrt(1 + u^2)) / (1 + u^2), u = 2 d dn / lambda (Gooch & Tarry, J. Phys. D 8, 1575
# (1975)), less what the extraordinary wave loses at both faces, 2 (0.13 / 3.13)^2 = 3.5e-3.
"$program" jones "$source/fit_configs/slab_jones.yaml" --out jones.csv || { echo "FAILED: jones"; exit 1; }
awk -F, '
  NR == 1 { for (i = 1; i <= NF; ++i) column[$i] = i }
  NR == 2 {
    pi = 3.14159265358979; u = 2 * 5 * 0.13 / 0.55
    expected = 1 - sin(pi / 2 * sqrt(1 + u * u)) ^ 2 / (1 + u * u)
    crossed = $column["re_ps"] ^ 2 + $column["im_ps"] ^ 2
    if (crossed > expected || crossed < expected - 3.5e-3) { print "FAILED: crossed transmission " crossed ", closed form " expected; exit 1 }
    seen = 1
  }
  END { if (!seen) exit 1 }' jones.csv || { echo "FAILED: slab_jones"; exit 1; }
echo "all as required"
