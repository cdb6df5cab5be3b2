#!/usr/bin/env bash
# `birefit watch` with 200 images (cli/watch.sh has 30). usage: long_watch.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source_dir=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
. "$source_dir/tests/support/watch_files.sh"
watch_files "$birefit" "$source_dir" 200
[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
