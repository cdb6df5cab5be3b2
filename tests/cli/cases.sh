#!/usr/bin/env bash
# Pictures that once were answered wrongly, with exit code 0, or not at all; made by programs that share no code with this one
# (tests/data/cases). usage: cases.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
cases=$(realpath "$2")/tests/data/cases
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }

fit_case() { "$birefit" fit "$cases/$1/config.yaml" --out "out_$1" > "$1.txt" 2> "$1.err"; }
# A parameter, by the end of its name, lies within five standard errors of the truth: "name = value +/- error ..".
holds() {  # CASE NAME TRUTH
  awk -v name="$2" -v truth="$3" '
    $1 ~ name "$" && $2 == "=" && $4 == "+/-" {
      found = 1
      off = $3 - truth
      inside = $5 > 0 && off * off < 25 * $5 * $5
    }
    END { exit !(found && inside) }' "$1.txt" || fail "$1: $2 = $3 is not $(grep -m1 "$2 *=" "$1.txt")"
}

# The better of two minima that are 35 degrees of twist apart, and one 40 % of the birefringence away.
fit_case twisted_1 || fail 'twisted_1: no answer'
holds twisted_1 twist_deg 83.982
holds twisted_1 birefringence 0.207816
fit_case twisted_2 || fail 'twisted_2: no answer'
holds twisted_2 twist_deg 101.904
holds twisted_2 birefringence 0.188238

# Tilt and birefringence in one combination: not identifiable, and the birefringence's own interval, if one is printed,
# holds the truth. Its profile about the place where the solver ended was 500 times narrower than its error.
fit_case tilt_not_told && fail 'tilt_not_told: an answer'
grep -q '^Not identifiable' tilt_not_told.txt || fail "tilt_not_told: $(cat tilt_not_told.txt)"
grep -q 'birefringence *= .*+/- not known' tilt_not_told.txt || holds tilt_not_told birefringence -0.15428

# A pixel size 2 % too large, four times what it is known to: the verdict says that what it is fitted for goes along with
# it, whatever the residual is.
fit_case pixel_size || fail 'pixel_size: no answer'
grep -o 'more of micrograph.pixel_size_um makes birefringence -[0-9.]*' pixel_size.txt | tr -d '-' |
  awk '{ by = $NF } END { exit !(by > 0.8 && by < 1.2) }' || fail "pixel_size: $(cat pixel_size.txt)"

# Forces 7.9 degrees from where the config has them: what is left out around them is left out where they are.
fit_case disc_azimuth || fail 'disc_azimuth: no answer'
holds disc_azimuth load_n 76.272
holds disc_azimuth load_azimuth_deg 97.913

# Pictures that are nearly the model's: pixels out of square, a focus and an aperture off by what nobody knows better, a
# wrong host. The 95 % interval holds the truth, or there is no answer.
holds_or_refuses() {  # CASE NAME TRUTH
  [ "$code" -eq 1 ] && return
  [ "$code" -eq 0 ] || fail "$1: exit code $code"
  awk -v name="$2" -v truth="$3" '
    $1 ~ name "$" && $2 == "=" && $4 == "+/-" {
      low = high = $0
      sub(/.*\[95%: */, "", low); sub(/ .*/, "", low); sub(/.*\.\. */, "", high); sub(/\].*/, "", high)
      held = low + 0 <= truth && truth <= high + 0
    }
    END { exit !held }' "$1.txt" || fail "$1: $2 = $3 is not $(grep -m1 "$2 *=" "$1.txt")"
}
while read -r name diameter birefringence; do
  fit_case "$name"
  code=$?
  holds_or_refuses "$name" diameter_um "$diameter"
  holds_or_refuses "$name" birefringence "$birefringence"
done <<'CASES'
not_square 9.3 0.22
focus_off 9.3 0.22
aperture_off 9.3 0.22
host_off 10 0.16
CASES

# Three droplets of 9.3, 7.1 and 6.2 um: the one within the bounds, and each.
fit_case several_droplets || fail 'several_droplets: no answer'
holds several_droplets diameter_um 9.3
holds several_droplets birefringence 0.22
grep -q 'several discs are visible' several_droplets.txt several_droplets.err || fail 'several_droplets: not said'
"$birefit" fit "$cases/several_droplets/config.yaml" --each --out each > each.txt 2> each.err || { fail 'each'; cat each.txt each.err; }
awk -F, '
  NR == 1 { for (i = 1; i <= NF; ++i) column[$i] = i; split("9.3 7.1 6.2", truth, " "); next }
  $(column["sample.droplet.diameter_um_low95"]) <= truth[NR - 1] && truth[NR - 1] <= $(column["sample.droplet.diameter_um_high95"]) &&
    $(column["sample.material.birefringence_low95"]) <= 0.22 && 0.22 <= $(column["sample.material.birefringence_high95"]) && $NF ~ /^answer/ { ++right }
  END { exit right != 3 }' each/droplets.csv || { fail 'each: not three right droplets'; cat each/droplets.csv; }
[ -f each/droplets/3/report.html ] || fail 'each: no report of the third'
# Of a size that the config leaves to the picture, which taken for one shows a disc around all three.
mkdir -p auto && cp "$cases"/several_droplets/* auto && sed -i 's/diameter_um: {[^}]*}/diameter_um: {fit: auto}/' auto/config.yaml
"$birefit" fit auto/config.yaml --each --out each_auto > each.txt 2> each.err || { fail 'each, of any size'; cat each.txt each.err; }
[ "$(grep -c ',answer' each_auto/droplets.csv)" -eq 3 ] || { fail 'each, of any size: not three'; cat each_auto/droplets.csv; }
# Neither stands beside the other's results.
"$birefit" fit "$cases/host_off/config.yaml" --out each > one.txt 2> one.err
[ $? -eq 2 ] && grep -q 'holds droplets.csv' one.err || fail 'a fit into the folder of --each'
"$birefit" fit "$cases/host_off/config.yaml" --each --out one > one.txt 2> one.err
[ $? -eq 2 ] || fail '--each of one droplet does not end in 2'

[ $failures -eq 0 ] && echo 'all as required'  || echo "$failures failures"
exit $((failures > 0))
