#!/usr/bin/env bash
# `birefit fit --samples N`: as many draws as were asked for, a column a parameter, said in every file; and nothing of
# them stays beside a later fit without. usage: samples.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
says() { grep -q -- "$2" "$1" || { fail "$1 does not say: $2"; cat "$1"; }; }
config=$source/fit_configs/e12_droplet.yaml

"$birefit" fit "$config" --samples 200 --out d > d.txt || fail 'fit'
says d.txt '200 draws from the posterior, worth'
[ "$(wc -l < d/samples.csv)" -eq 201 ] || fail 'not 200 rows'
# The draws' middle is the estimate and their spread its error, but for what 200 draws, worth 100 at least, scatter by:
# three deviations and more. (Of the offset not: what a polarizer that is off by a little lets through it can only add.)
command -v python3 > /dev/null && { python3 - d <<'PYTHON' || failures=$((failures + 1))
import csv, json, statistics, sys
fit = json.load(open(sys.argv[1] + "/fit.json"))
rows = list(csv.DictReader(open(sys.argv[1] + "/samples.csv")))
assert list(rows[0]) == list(fit["parameters"]), list(rows[0])
assert fit["samples"]["draws"] == 200 and fit["samples"]["effective"] > 100, fit["samples"]["effective"]
for name, p in fit["parameters"].items():
    values = [float(row[name]) for row in rows]
    if not p["linear"]:
        assert abs(statistics.mean(values) - p["value"]) < 0.35 * p["stderr"], name
    assert abs(statistics.stdev(values) / p["stderr"] - 1) < 0.3, (name, statistics.stdev(values), p["stderr"])
    low, high = fit["samples"]["parameters"][name]["middle_95"]
    assert 0.015 <= sum(v < low for v in values) / 200 <= 0.03 and 0.015 <= sum(v > high for v in values) / 200 <= 0.03, name
PYTHON
}
says d/report.html 'Draws from the posterior'
"$birefit" fit "$config" --out d --quiet || fail 'fit without'
[ ! -e d/samples.csv ] || fail 'draws of an earlier fit stay'
says d/fit.json '"samples": null'
"$birefit" fit "$config" --samples 3 --out e > e.txt 2>&1 && fail 'three draws are no posterior'

"$birefit" audit "$source/fit_configs/audit/droplet.yaml" --departure gamma --problems 1 --samples 200 --out a > a.txt || fail 'audit'
says a.txt "Of the draws' own intervals"
[ "$failures" -eq 0 ] || exit 1
