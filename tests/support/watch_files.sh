# A folder that images are written to in every way that programs have, and a `birefit watch` that is ended and killed
# meanwhile. usage: watch_files BIREFIT SOURCE_DIR COUNT, in a folder of its own; sets `failures`.

fail() { echo "FAIL $1"; failures=$((failures + 1)); }

watch_files() {
  local birefit=$1 source_dir=$2 count=$3 i name pid
  failures=0
  . "$source_dir/tests/support/crystal_frames.sh"
  mkdir pool in
  for ((i = 1; i <= 5; ++i)); do expose "pool/$i.tif" 700 "$i"; done
  cat > crystal.yaml << 'YAML'
micrograph: {gain: {fit: auto}, offset: {fit: auto}}
sample:
  crystal:
    half_wave_voltage_v: {value: 1400, fit: [1000, 2500]}
    bias_v: 700
    field_along: y
    electrodes_px: [-0.5, 47.5]
    field_legendre: [{value: 0.3, fit: [0.1, 0.7]}]
microscope:
  light: {wavelength_nm: 1550}
  polarizer_deg: 0
  analyzer_deg: 90
YAML
  start() {
    "$birefit" watch crystal.yaml --folder in --out out --threads 1 --patience 1 "$@" >> log.txt 2>> errors.txt &
    pid=$!
  }
  rows() { cat out/series.csv 2> /dev/null | grep -c '^[a-z].*\.tif,'; }
  # Until there are so many rows; a slow machine takes its time.
  await() {
    local k
    for ((k = 0; k < 1200; ++k)); do
      [ "$(rows)" -ge "$1" ] && return
      sleep 0.1
    done
    fail "$(rows) rows instead of $1"
  }
  cp pool/1.tif in/early.tif
  start
  await 1
  head -c 1500 pool/2.tif > in/cut.tif       # never becomes whole
  head -c 1500 pool/3.tif > in/mended.tif    # later it does
  echo 'no image' > in/notes.txt
  for ((i = 1; i <= count; ++i)); do
    name=$(printf 'f%03d.tif' "$i")
    case $((i % 6)) in
      0) cp "pool/$((i % 5 + 1)).tif" "in/$name" ;;
      1) # in parts, closed in between
        head -c 900 "pool/$((i % 5 + 1)).tif" > "in/$name"
        sleep 0.05
        tail -c +901 "pool/$((i % 5 + 1)).tif" >> "in/$name"
        ;;
      2) # in parts, open all the while
        { head -c 2000 "pool/$((i % 5 + 1)).tif"; sleep 0.05; tail -c +2001 "pool/$((i % 5 + 1)).tif"; } > "in/$name"
        ;;
      3) cp "pool/$((i % 5 + 1)).tif" "in/.$name.part" && mv "in/.$name.part" "in/$name" ;;
      4) cp "pool/$((i % 5 + 1)).tif" elsewhere.tif && mv elsewhere.tif "in/$name" ;;
      5) # renamed after it may have been taken
        cp "pool/$((i % 5 + 1)).tif" "in/live$i.tif"
        sleep 0.05
        mv "in/live$i.tif" "in/$name"
        ;;
    esac
    if ((i == count / 3)); then
      kill -KILL "$pid"
      wait "$pid" 2> /dev/null
      rm -rf before && cp -r out before
    elif ((i == count / 2)); then
      start --resume
      cp pool/3.tif in/mended.tif
    elif ((i == 2 * count / 3)); then
      kill -TERM "$pid"
      wait "$pid"
      start --resume
    fi
  done
  await $((count + 3))
  sleep 0.5  # nothing more comes
  kill -TERM "$pid"
  wait "$pid"
  [ $? -eq 1 ] || fail 'a run with an unreadable image does not end with 1'

  [ "$(rows)" -eq $((count + 3)) ] || fail "$(rows) rows of $((count + 3)) images"
  for ((i = 1; i <= count; ++i)); do
    name=$(printf 'f%03d.tif' "$i")
    [ "$(grep -c "^$name," out/series.csv)" -eq 1 ] || fail "$name is there $(grep -c "^$name," out/series.csv) times"
    [ -f "out/frames/$name/fit.json" ] || fail "$name has no fit.json"
    [ "$(grep -c "^$name: answer" log.txt)" -le 1 ] || fail "$name was fitted twice"
  done
  grep -q '^cut.tif,.*,unreadable,' out/series.csv || fail 'cut.tif is not said to be unreadable'
  grep -q '^mended.tif,.*,answer' out/series.csv || fail 'mended.tif has no answer'
  grep -q 'notes.txt\|live' out/series.csv && fail 'what is no image, or an earlier name, is in the table'
  [ "$(find out/frames -name fit.json | wc -l)" -eq $((count + 2)) ] || fail 'a fit of no image in the table'
  awk -F, '
    NR == 1 { for (i = 1; i <= NF; ++i) at[$i] = i; next }
    $1 == "cut.tif" { next }
    { d = ($(at["sample.crystal.half_wave_voltage_v"]) - 1500) / $(at["sample.crystal.half_wave_voltage_v_stderr"])
      if (d > 5 || d < -5) { print; bad = 1 } }
    END { exit bad }' out/series.csv || fail 'estimates'
  # A whole run goes on without doing anything again.
  find out/frames -name fit.json -exec md5sum {} + | sort > before.txt
  : > log.txt
  start --resume
  sleep 1
  kill -TERM "$pid"
  wait "$pid"
  grep -q ': answer' log.txt && fail 'a resumed run fits again'
  find out/frames -name fit.json -exec md5sum {} + | sort | cmp -s - before.txt || fail 'a resumed run changed something'
}
