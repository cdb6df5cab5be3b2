#!/usr/bin/env bash
# tools/check_modules must be able to fail: a source tree with one violation at a time.
set -euo pipefail
check=$1/tools/check_modules
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
mkdir -p "$tree"/src/{core,medium,transport/methods,fit,io,app,python} "$tree"/include/birefit
echo '#include "birefit/error.h"' >"$tree/src/core/good.cc"
echo '// nothing' >"$tree/include/birefit/error.h"
"$check" "$tree" >/dev/null

# file, line that must be refused there
refuse() {
  printf '%s\n' "$2" >"$tree/$1"
  if "$check" "$tree" >/dev/null; then
    echo "not found: $2 in $1"
    exit 1
  fi
  rm "$tree/$1"
}
refuse src/core/bad.cc '#include "medium/column.h"'
refuse src/core/bad.cc '#include "birefit/scene.h"'
refuse src/medium/bad.h '# include "birefit/io.h"'
refuse src/transport/methods/bad.cc '#include <ceres/ceres.h>'
refuse src/fit/bad.cc '#include <OpenImageIO/imageio.h>'
refuse src/fit/bad.cc '#include <opencv2/imgproc.hpp>'
refuse src/io/bad.cc '#include <opencv2/imgproc.hpp>'
refuse src/io/bad.cc '#include "sibling.h"'
refuse src/io/bad.cc '#include <ceres/ceres.h>'
refuse src/io/bad.cc '#include <pybind11/pybind11.h>'
refuse src/io/bad.cc '#include "python/job.h"'
refuse src/app/bad.cc '#include "python/job.h"'
refuse src/python/bad.cc '#include "app/output.h"'
refuse include/birefit/error.h '#include "core/lanes.h"'
refuse include/birefit/stray.h '// a header of no module'

# what must be said of the tree
says() { { "$check" "$tree" || true; } | grep -q "$1" || { echo "not said: $1"; exit 1; }; }

# Two types of one name, unless their namespaces differ.
printf 'namespace birefit {\nstruct Band {\n};\n}\n' >"$tree/src/medium/a.h"
printf 'namespace birefit::study {\nstruct Band {\n};\n}\n' >"$tree/src/medium/b.h"
"$check" "$tree" >/dev/null
printf 'namespace birefit {\nclass Band final : public Other {\n};\n}\n' >"$tree/src/medium/b.h"
says 'birefit::Band is defined in src/medium/a.h, too'
rm "$tree"/src/medium/*

# Names of headers that an unnamed namespace further in hides.
printf 'namespace birefit {\ninline double width(double a, double b) {\n}\nconstexpr double kWide = 2;\n}\n' >"$tree/src/medium/a.h"
printf 'namespace birefit::x {\nnamespace {\nint other() {\n}\n}  // namespace\nint width(int a) {\n}\n}\n' >"$tree/src/medium/a.cc"
"$check" "$tree" >/dev/null
printf 'namespace birefit::x {\nnamespace {\nint width(int a) {\n}\n}  // namespace\n}\n' >"$tree/src/medium/a.cc"
says 'src/medium/a.cc:3: width hides that of src/medium/a.h'
printf 'namespace birefit::x {\nnamespace {\nconstexpr int kWide = 1;\n}  // namespace\n}\n' >"$tree/src/medium/a.cc"
says 'src/medium/a.cc:3: kWide hides that of src/medium/a.h'
rm "$tree"/src/medium/*

# Circles of files, each named once; a file may include its own header.
echo '#include "medium/b.h"' >"$tree/src/medium/a.h"
echo '#include "medium/a.h"' >"$tree/src/medium/a.cc"
: >"$tree/src/medium/b.h"
"$check" "$tree" >/dev/null
echo '#include "medium/a.h"' >"$tree/src/medium/b.cc"
says 'circle of files: medium/a medium/b'
rm "$tree"/src/medium/*

# Long files and wide lines; what is known may stay, what is known and gone may not.
seq 601 | sed 's|^|// |' >"$tree/src/core/good.cc"
says 'over 600 lines: src/core/good.cc'
mkdir "$tree/tools"
echo 'long src/core/good.cc' >"$tree/tools/check_modules.known"
"$check" "$tree" >/dev/null
printf '// %0120d\n' 1 >"$tree/src/core/good.cc"
says 'over 120 characters: src/core/good.cc'
says 'no longer so.*long src/core/good.cc'
