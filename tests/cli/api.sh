#!/usr/bin/env bash
# Doxygen makes the pages of the library without a warning; types, functions and enumerations have comments of their own;
# the pages ask for nothing from the network. usage: api.sh BIREFIT SOURCE_DIR
set -u
source=$(realpath "$2")
command -v doxygen > /dev/null || { echo 'skipped: no doxygen here (tools/setup --docs installs it)'; exit 77; }
work=$PWD
rm -rf pages comments
mkdir pages comments
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
make_pages() { (cd "$source" && { cat docs/Doxyfile; printf '%s\n' "$@"; } | doxygen -); }  # SETTING..

make_pages "OUTPUT_DIRECTORY = $work/pages" > pages.txt 2>&1 || fail 'doxygen'
[ ! -s pages.txt ] || { fail 'doxygen warns:'; head -20 pages.txt; }
[ -s pages/html/index.html ] || { fail 'no main page'; exit 1; }
for function in load_config load_config_text plan render fit; do
  grep -q "<b>$function</b>\|>$function</a>" pages/html/namespacebirefit.html || fail "no function $function"
  grep -q "namespacebirefit.html#[^>]*>birefit::$function<" pages/html/index.html || fail "the main page leads to no $function"
done
for type in structbirefit_1_1FitResult structbirefit_1_1FitJob structbirefit_1_1Scene structbirefit_1_1RenderPlan \
  classbirefit_1_1ParameterTable classbirefit_1_1UserError; do
  [ -s "pages/html/$type.html" ] || fail "no page $type"
done
# What heads a header is on its page, a comment stays with its own declaration, describe() shows what numbers may be.
grep -q 'every number that may vary is a ParameterRef' pages/html/scene_8h.html || fail 'scene.h without its head'
grep -q 'at a bound that is no physical limit' pages/html/structbirefit_1_1FitResult.html || fail 'FitResult::pinned'
grep -q 'at a bound that is no physical limit *[a-z]' pages/html/structbirefit_1_1FitResult.html && fail 'comments run into each other'
grep -q 'out of the layer plane' pages/html/structbirefit_1_1TwistedDirector.html || fail 'describe() of TwistedDirector'
grep -rnoiE '<(script|link|img|iframe)[^>]*(src|href)="?(https?:)?//[^>]*|(url\(|@import )["'\'']?(https?:)?//' pages/html --include='*.html' --include='*.css' &&
  fail 'the pages load something from the network'
grep -rlF "$source" pages/html && fail 'the pages name a folder of this machine'

make_pages "OUTPUT_DIRECTORY = $work/comments" 'WARN_IF_UNDOCUMENTED = YES' 'WARN_AS_ERROR = NO' > comments.txt 2>&1 || fail 'doxygen, comments'
grep -q '(variable)' comments.txt || fail 'doxygen does not say what has no comment'
grep 'warning: ' comments.txt | grep -v '(variable) of' | sort -u | sed "s|$source/||" > without.txt
[ ! -s without.txt ] || { fail 'without a comment:'; cat without.txt; }
[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
