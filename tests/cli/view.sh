#!/usr/bin/env bash
# The page of `birefit view` as its server has it: who may ask, and what is answered. usage: view.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source_dir=$(realpath "$2")
command -v python3 > /dev/null || { echo "skipped: no python3 to ask the server with"; exit 77; }
"$birefit" view nothing.yaml 2>&1 | grep -q 'built without `view`' && { echo "skipped: built without cpp-httplib"; exit 77; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1

. "$source_dir/tests/support/view_folder.sh"
python3 "$source_dir/tests/support/ask_view.py" "$birefit" "$source_dir"
