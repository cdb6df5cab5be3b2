#!/usr/bin/env bash
# One binary, three sets of kernels (preset `levels`): the loader takes the widest, narrower ones give the same fit.
#   simd_levels.sh BIREFIT SOURCE
set -euo pipefail
birefit=$1 source=$2
if [[ ! -d $(dirname "$birefit")/glibc-hwcaps ]]; then
  echo "skipped: built for one machine; cmake --preset levels builds for all"
  exit 77
fi
loader=$(ls /lib64/ld-linux-x86-64.so.* | head -n 1)

supported=$("$loader" --help)
declare -A lanes=([x86-64]=2 [x86-64-v3]=4 [x86-64-v4]=8)
for level in x86-64 x86-64-v3 x86-64-v4; do
  if [[ $level != x86-64 ]] && ! grep -q "$level (supported" <<<"$supported"; then
    echo "skip $level: not this machine"
    continue
  fi
  version=$("$loader" --glibc-hwcaps-mask "$level" "$birefit" --version)
  grep -q "(${lanes[$level]} rays side by side)" <<<"$version" || { echo "FAIL $level: $version"; exit 1; }
  "$loader" --glibc-hwcaps-mask "$level" "$birefit" fit "$source/fit_configs/e12_droplet.yaml" --out "$level" > "$level.txt"
  "$loader" --glibc-hwcaps-mask "$level" "$birefit" fit "$source/fit_configs/e44_plate.yaml" --out "$level-plate" > "$level-plate.txt"
  echo "ok   $level: $version"
done

# The same estimates: to the digits printed, a tenth of their standard errors.
for level in x86-64-v3 x86-64-v4; do
  for kind in "" -plate; do
    [[ -d $level$kind ]] || continue
    paste -d ' ' "x86-64$kind.txt" "$level$kind.txt" | awk -v level="$level$kind" '
      # name = value +/- error .. name = value +/- error
      { for (i = 1; i < NF; ++i) if ($i == "+/-") { ++k; name[k] = $(i - 3); value[k] = $(i - 1); error[k] = $(i + 1) } 
        if (k == 2) {
          if (name[1] != name[2]) { print "FAIL " level ": " $0; bad = 1 }
          d = value[1] - value[2]; if (d < 0) d = -d
          # Numbers are printed with a digit or two of their error.
          if (d > 0.1 * error[1]) { print "FAIL " level ": " $0; bad = 1 }
          ++n
        }
        k = 0 }
      END { if (n < 1 || bad) { print "FAIL: " n " compared"; exit 1 } print "ok   " level ": " n " estimates" }'
  done
done
