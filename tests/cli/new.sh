#!/usr/bin/env bash
# Every kind of `birefit new` has a demonstration that runs as printed and gives back what its picture was made with; of a picture of one's own the
# config is filled in, and what is missing is said. usage: new.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
failures=0
fail() { echo "FAIL $1"; failures=$((failures + 1)); }
says() { grep -q -- "$2" "$1" || { fail "$1 does not say: $2"; cat "$1"; }; }

# holds KIND: every number of truth.csv within five standard errors, "name = value +/- error ..".
holds() {
  awk -F, -v kind="$1" '
    NR == FNR { if (FNR > 1) truth[$1] = $2; next }
    { split($0, word, " ")
      if (word[1] in truth && word[2] == "=" && word[4] == "+/-") {
        off = word[3] - truth[word[1]]
        if (off * off < 25 * word[5] * word[5]) delete truth[word[1]] } }
    END { for (name in truth) { print kind ": " name " is not " truth[name]; bad = 1 } exit bad }' "$1/truth.csv" "$1.txt" || { fail "$1"; cat "$1.txt"; }
}
"$birefit" new > kinds.txt || fail 'new without a kind'
for kind in $(awk '/^  [a-z]/ { print $1 }' kinds.txt); do
  "$birefit" new "$kind" --demo "$kind" > "$kind.said" 2>&1 || { fail "new $kind --demo"; cat "$kind.said"; continue; }
  "$birefit" new "$kind" | cmp -s - "$kind/$kind.yaml" || fail "new $kind prints another config than its demonstration has"
  command=$(sed -n 's/^  birefit //p' "$kind.said")
  # shellcheck disable=SC2086
  "$birefit" $command > "$kind.txt" 2>&1 || { fail "$kind: exit code $? of birefit $command"; cat "$kind.txt"; continue; }
  case $kind in
    slab) [ "$(wc -l < slab/jones.csv)" = 3 ] || fail 'slab: no two matrices' ;;
    series) [ "$(grep -c ',answer' series/out/series.csv)" = 3 ] || { fail 'series: not three answers'; cat series.txt; } ;;
    *) holds "$kind" ;;
  esac
done
[ -f volume/truth.csv ] || fail 'the list of kinds ends early'
"$birefit" new droplet --demo droplet > again.txt 2>&1 && fail 'a demonstration is written over'
says again.txt 'is there already'

# What could not be finished is begun again.
mkdir half && mkdir half/truth.csv
"$birefit" new droplet --demo half > half.txt 2>&1 && fail 'a demonstration without its truth'
rmdir half/truth.csv && "$birefit" new droplet --demo half > half.txt 2>&1 || { fail 'a demonstration that failed stays'; cat half.txt; }

# Words that people use.
"$birefit" new conoscopy > word.txt 2>&1 && fail 'conoscopy is a kind'
says word.txt 'did you mean plate?'
"$birefit" new nonsense > word.txt 2>&1 && fail 'nonsense is a kind'
says word.txt 'known: droplet, shell'

# A picture of one's own: what the file tells is filled in; what is missing is asked for, and stated it fits.
"$birefit" new droplet --image droplet/droplet.png > own.yaml 2> own.txt || fail 'new droplet --image'
says own.txt 'found: 240 x 240 pixels of 16 bit'
says own.txt 'found: a disc of 1[89][0-9.]* px around (119'
says own.txt 'missing: micrograph.pixel_size_um'
says own.txt 'assumed, as no image tells it: .*index 1.43'
"$birefit" fit own.yaml --out own > unsaid.txt 2>&1 && fail 'a fit without a pixel size'
says unsaid.txt 'needs pixel_size_um'
"$birefit" fit own.yaml --set micrograph.pixel_size_um=0.05 --out own > own_fit.txt 2>&1 || { fail 'new --image, with its pixel size'; cat own_fit.txt; }

# A colour photograph: white light and sRGB are asked about.
cp "$source/data/real/photoelastic_disk/single_disk/DSC_0010.png" photo.png
"$birefit" new disc --image photo.png > photo.yaml 2> photo.txt || fail 'new disc --image'
says photo.txt 'missing: was there a filter or a laser?'
says photo.txt 'missing: are the codes sRGB?'
grep -q '^  transfer: srgb' photo.yaml || fail 'photo.yaml has no transfer'
"$birefit" new crystal --image crystal/300V.png > list.yaml 2> list.txt || fail 'new crystal --image'
grep -q 'image: "crystal/300V.png", set' list.yaml || fail 'list.yaml does not list the image'
says list.txt 'missing: micrographs: more images'
for kind in slab freedericksz; do
  "$birefit" new $kind --image photo.png > none.txt 2>&1
  [ $? -eq 2 ] || fail "a $kind of an image"
  says none.txt 'reads no image'
done
# Whatever a file is called.
cp crystal/300V.png 'cost$1 of.png'
"$birefit" new crystal --image 'cost$1 of.png' > named.yaml 2> named.txt || fail 'a name with a dollar'
grep -qF 'image: "cost$1 of.png", set' named.yaml || fail "named.yaml: $(grep image: named.yaml)"
"$birefit" new disc --demo 'a folder' > spaces.txt 2>&1 || fail 'a demonstration in a folder with a blank'
says spaces.txt "fit 'a folder/disc.yaml' --out 'a folder/out'"
# Results do not replace what the config reads.
mkdir own_name && cp droplet/droplet.png own_name/fitted.tif && sed 's/droplet.png/fitted.tif/' droplet/droplet.yaml > own_name/droplet.yaml
"$birefit" fit own_name/droplet.yaml --out own_name > replaced.txt 2>&1
[ $? -eq 2 ] || fail 'a fit over its own image'
says replaced.txt 'which the config reads and the results would replace'
cmp -s droplet/droplet.png own_name/fitted.tif || fail 'the image was replaced'
# Nor the config itself, where --set makes another of it.
mkdir own_config && cp droplet/droplet.png own_config && cp droplet/droplet.yaml own_config/config.yaml
"$birefit" fit own_config/config.yaml --out own_config --set sample.droplet.diameter_um.value=9 > replaced.txt 2>&1
[ $? -eq 2 ] || fail 'a fit over its own config'
says replaced.txt 'this very config, which the results would replace'
cmp -s droplet/droplet.yaml own_config/config.yaml || fail 'the config was replaced'
"$birefit" render droplet/droplet.yaml --out droplet/droplet.png > replaced.txt 2>&1
[ $? -eq 2 ] || fail 'a picture over the image of its config'
"$birefit" new droplet --image nothing.png > none.txt 2>&1
[ $? -eq 2 ] || fail 'an image that is missing'
[ $failures -eq 0 ] && echo "all as required" || echo "$failures failures"
exit $((failures > 0))
