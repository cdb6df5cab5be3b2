# Pictures for the scripts of tests/cli.

# A crystal of half-wave voltage 1500 V between crossed polarizers, its field 40 % stronger at one electrode and weaker at the
# other: sin^2(pi/2 V/1500 (1 + 0.4 t)), 8 bit, gain 200, offset 20, noise 3.
expose() { # FILE VOLTS SEED
  {
    # TIFF, 48 x 48, one strip behind the header
    printf 'II*\0\10\0\0\0\11\0\0\1\4\0\1\0\0\0\60\0\0\0\1\1\4\0\1\0\0\0\60\0\0\0\2\1\3\0\1\0\0\0\10\0\0\0\3\1\3\0\1\0\0\0\1\0\0\0'
    printf '\6\1\3\0\1\0\0\0\1\0\0\0\21\1\4\0\1\0\0\0\172\0\0\0\25\1\3\0\1\0\0\0\1\0\0\0\26\1\4\0\1\0\0\0\60\0\0\0\27\1\4\0\1\0\0\0\0\11\0\0\0\0\0\0'
    printf "$(awk -v volts="$2" -v seed="$3" 'BEGIN {
      srand(seed)
      for (y = 0; y < 48; ++y) for (x = 0; x < 48; ++x) {
        s = sin(1.5707963268 * volts / 1500 * (1 + 0.4 * (2 * (y + 0.5) / 48 - 1)))
        noise = -6
        for (k = 0; k < 12; ++k) noise += rand()
        printf "\\%03o", int(20.5 + 200 * s * s + 3 * noise)
      }
    }')"
  } > "$1"
}
