#!/usr/bin/env bash
# `birefit watch`: every image of a folder once, however it was written and however often the program was ended.
# usage: watch.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source_dir=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
. "$source_dir/tests/support/watch_files.sh"
watch_files "$birefit" "$source_dir" 30

refused() {  # NAME WORDS, arguments of watch
  local name=$1 words=$2
  shift 2
  "$birefit" watch "$@" > out.txt 2> err.txt
  [ $? -eq 2 ] && grep -qF -- "$words" err.txt || fail "$name: $(head -c 300 err.txt)"
}
refused 'a folder in use' 'holds a series already' crystal.yaml --folder in --out out
refused 'no folder' 'is no folder' crystal.yaml --folder none --out other
sed 's/bias_v: 700/bias_w: 700/' crystal.yaml > wrong.yaml
refused 'a wrong config' 'bias_w' wrong.yaml --folder in --out other
[ -e other ] && fail 'a refused run leaves a folder'

[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
