#!/usr/bin/env bash
# Shipped configs name files of the repository, and results of other shipped configs (out/), and nothing else; what is measured says where it is from.
# usage: shipped_paths.sh BIREFIT SOURCE_DIR
set -u
source=$(realpath "$2")
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
for config in "$source"/fit_configs/*.yaml; do
  while read -r path; do
    case $path in
      ../out/*) ;;
      ../data/*) [ -f "$source/fit_configs/$path" ] || fail "$(basename "$config") names $path, which is not there" ;;
      *) fail "$(basename "$config") points to $path" ;;
    esac
  done < <(grep -o '\.\./[A-Za-z0-9_./-]*\|[ {]/[A-Za-z][A-Za-z0-9_./-]*' "$config")
done
for folder in "$source"/data/real/*/; do
  grep -q '^Origin: GitHub repository `[^`]*`, commit [0-9a-f]\{40\}' "$folder/SOURCE.md" || fail "$folder has no SOURCE.md with repository and commit"
  grep -q 'Licence: ' "$folder/SOURCE.md" || fail "$folder/SOURCE.md states no licence"
  grep -q 'LICENSE.txt' "$folder/SOURCE.md" && [ ! -f "$folder/LICENSE.txt" ] && fail "$folder has no LICENSE.txt"
done
grep -vE '^(#|[0-9a-f]{64}  [^ /][^ ]*  [^ /]+/[^ /]+/[0-9a-f]{40}/[^ ]+$)' "$source/tools/fetch_real.list" && fail "tools/fetch_real.list: lines above"
[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
