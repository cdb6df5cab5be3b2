# Sourced by tests of measured data that are not in the repository.
#   source real_data.sh BIREFIT SOURCE_DIR FOLDER FILE WHAT: sets birefit, source, data, work (the working folder from here on) and failures;
#   skips (77), saying WHAT is missing, where $BIREFIT_REAL_DATA (default: out/real) has no FOLDER/FILE. fail WORDS.. counts a failure.
set -u
birefit=$(realpath "$1")
source=$(realpath "$2")
data=$(realpath -m "${BIREFIT_REAL_DATA:-$source/out/real}")/$3
if [ ! -f "$data/$4" ]; then
  echo "skipped: no $5 at $data; BIREFIT_REAL_DATA names a folder that has it"
  exit 77
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $*"; failures=$((failures + 1)); }
