#!/usr/bin/env bash
# The trial packages for Debian hold what they should, name no path of this machine, run from where they are unpacked, and lintian has no
# errors. usage: deb.sh BIREFIT SOURCE_DIR
set -u
build=$(dirname "$(realpath "$1")")
source=$(realpath "$2")
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
cached() { sed -n "s/^$1:[A-Z]*=//p" "$build/CMakeCache.txt"; }
command -v dpkg-deb > /dev/null || { echo "skipped: no dpkg-deb"; exit 77; }
[ -z "$(cached BIREFIT_SANITIZE)" ] || { echo "skipped: a build with sanitizers is not packaged"; exit 77; }
[ "$(cached BIREFIT_SIMD_LEVELS)" != ON ] || { echo "skipped: the preset levels is not packaged"; exit 77; }
rm -rf out root dev
"$source/tools/package/deb" --quick "$build" out > deb.log 2>&1 || fail "tools/package/deb: exit code $?"
cat deb.log
main=$(echo out/birefit_*.deb) dev=$(echo out/libbirefit-dev_*.deb)
dpkg-deb -R "$main" root && dpkg-deb -R "$dev" dev || { echo "no packages to look into"; exit 1; }

for file in bin/birefit share/doc/birefit/copyright share/doc/birefit/changelog.gz share/doc/birefit/changelog.Debian.gz \
  share/man/man1/birefit.1.gz share/bash-completion/completions/birefit share/birefit/fit_configs/e12_droplet.yaml; do
  [ -s root/usr/$file ] || fail "the package has no $file"
done
gzip -dc root/usr/share/man/man1/birefit.1.gz | cmp -s - "$source/tools/package/birefit.1" || fail 'another manual page'
grep -q 'FFTW\|kissfft' root/usr/share/doc/birefit/copyright && ! grep -q '^@' root/usr/share/doc/birefit/copyright || fail 'copyright'
[ -z "$(find root/usr dev/usr -type d -empty)" ] || fail 'empty folders'
[ -z "$(find root/usr -name '*.a' -o -name '*.h')" ] || fail 'headers or static libraries in the package of the program'
for file in include/birefit/fit.h libbirefit_model.a libbirefit_io.a birefitConfig.cmake; do
  [ -n "$(find dev/usr -path "*/$file")" ] || fail "the package for development has no $file"
done
grep -rIlF -e "$source" -e "$build" -e "$PWD" root dev && fail 'these files name a path of this machine'
for package in root dev; do
  (cd $package && md5sum -c --quiet DEBIAN/md5sums) || fail "checksums of $package"
done
version=$("$1" --version | awk '{ print $2 }')
[[ $(dpkg-deb -f "$main" Version) == "$version"-* ]] || fail 'another version than the program'
[[ $(dpkg-deb -f "$dev" Depends) == "birefit (= $(dpkg-deb -f "$main" Version)), "*libceres-dev* ]] || fail 'Depends of libbirefit-dev'
! command -v dpkg-shlibdeps > /dev/null || [[ $(dpkg-deb -f "$main" Depends) == *libc6* ]] || fail 'Depends of birefit'

[ "$(root/usr/bin/birefit --version)" = "$("$1" --version)" ] || fail 'the unpacked program does not run'
# Opens the library of images, in a folder that only the program knows.
root/usr/bin/birefit render root/usr/share/birefit/fit_configs/disc.yaml --out rendered.png --quiet || fail 'a shipped config is not rendered'
command -v lintian > /dev/null || echo "not looked at by lintian, which is not installed"
[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
