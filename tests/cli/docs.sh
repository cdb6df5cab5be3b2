#!/usr/bin/env bash
# The documents: their links lead somewhere, the commands of the quick pages run as printed and give the figures beside them, and
# the site of all of them is made without a warning and asks for nothing but its own files. long_docs.sh runs the slow pages.
# usage: docs.sh BIREFIT SOURCE_DIR
set -u
program=$(realpath "$1")
source=$(realpath "$2")
command -v python3 > /dev/null || { echo 'skipped: no python3 here (tools/setup installs it)'; exit 77; }
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
check=$source/tests/support/check_docs.py

python3 "$check" links "$source" || fail 'links'
python3 "$check" run "$program" "$source" tutorial_cell.md tutorial_plate.md || fail 'pages that are run'

# The check itself: what is wrong is found.
rm -rf wrong
mkdir -p wrong/docs wrong/fit_configs wrong/data
printf '# A page\n\n[nothing](nothing.md) [no heading](page.md#elsewhere) [this](#a-page)\n' > wrong/docs/page.md
touch wrong/README.md wrong/CONTRIBUTING.md wrong/CHANGELOG.md
python3 "$check" links wrong > wrong.txt && fail 'links that lead nowhere pass'
grep -q 'docs/page.md:3: nothing.md leads nowhere' wrong.txt && grep -q 'page.md#elsewhere: no heading' wrong.txt && grep -q '^2 failures' wrong.txt ||
  { fail 'wrong links are not said'; cat wrong.txt; }
printf '# A page\n\n```sh\necho 1.25 um\n```\n\n```text\n1.27 um\n```\n\nFound: 3.0 ± 0.1.\n' > wrong/docs/page.md
mkdir -p wrong/tools
python3 "$check" run "$program" wrong page.md > wrong.txt && fail 'figures that are wrong pass'
grep -q 'not printed: 1.27 um' wrong.txt && grep -q 'no fit of the page gives 3.0 ± 0.1' wrong.txt || { fail 'wrong figures are not said'; cat wrong.txt; }

if command -v mkdocs > /dev/null; then
  rm -rf site
  # The library's pages are cli.api's.
  "$source/tools/docs" --without-api "$PWD/site" > site.txt 2>&1 || { fail 'tools/docs'; cat site.txt; }
  for page in index which_sample tutorial_disc configuration methods gallery configs/disc; do
    [ -s "site/$page.html" ] || fail "the site has no $page"
  done
  grep -q '"location":"configuration.html' site/search/search_index.json || fail 'no configuration in the index of the search'
  grep -rqF "$source" site && fail 'the site names a folder of this machine'
else
  echo 'without the site: no mkdocs here (tools/setup --docs installs it)'
fi
[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
