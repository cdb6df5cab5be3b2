#!/usr/bin/env bash
# The manual page has every command and option that the program has, and completion offers them. usage: package.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source=$(realpath "$2")
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
page=$(sed 's/\\-/-/g' "$source/tools/package/birefit.1")
commands=$("$birefit" --help | awk '/^Subcommands:/ { on = 1; next } /^$/ { on = 0 } on { print $1 }')
[ "$(wc -w <<< "$commands")" -ge 8 ] || fail 'commands of --help'
# shellcheck source=/dev/null
source "$source/tools/package/birefit.bash"
complete_words() { COMP_WORDS=("$birefit" "$@"); COMP_CWORD=$#; _birefit "$birefit"; echo " ${COMPREPLY[*]} "; }
offered=$(complete_words "")
for command in $commands; do
  grep -qw -- "$command" <<< "$page" || fail "the manual page has no $command"
  [[ $offered == *" $command "* ]] || fail "completion does not offer $command"
  options=$(complete_words "$command" --)
  for option in $("$birefit" "$command" --help | grep -o -- '^  *\(-[a-z],\)\?--[a-z]*' | grep -o -- '--[a-z]*'); do
    [ "$option" = --help ] || grep -q -- "$option" <<< "$page" || fail "the manual page has no $option of $command"
    [[ $options == *" $option "* ]] || fail "completion does not offer $option of $command"
  done
done
[[ $(complete_words new dr) == " droplet " ]] || fail 'completion of kinds'
grep -q "birefit $("$birefit" --version | awk '{ print $2 }')" <<< "$page" || fail 'the manual page is of another version'
grep -q "^version: $("$birefit" --version | awk '{ print $2 }')" "$source/CITATION.cff" || fail 'CITATION.cff is of another version'
[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
