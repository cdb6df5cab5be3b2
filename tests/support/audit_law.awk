# The law of misfit over audit.csv: of the answers' 95 % intervals, three standard deviations below, every picture
# counting once, since what is wrong with it moves all of its parameters; refusals at most 1 in 20, 1 in 8, 1 in 3 by
# size, and as many deviations more (-v refusals=0: however many). usage: awk -f audit_law.awk audit.csv
NR > 1 && !/^"none"/ {
  n = split($0, f, ",")  # names hold commas: from the end
  size = f[n - 10]; problems[size] += f[n - 9]; answers[size] += f[n - 8]; all += f[n - 8]
  intervals += f[n - 5]; held += f[n - 4]
  if (size == 1 && f[n - 3] != "") widths[++count] = f[n - 3] + 0
}
END {
  least = 0.95 - 3 * sqrt(0.95 * 0.05 / all)
  if (least < least_held) least = least_held
  printf "%d answers, %d of %d intervals hold (%.1f %%)", all, held, intervals, 100 * held / intervals
  if (held < intervals * least) { printf " FAIL: too few"; bad = 1 }
  split("0.05 0.125 0.33333", most, " ")
  for (s = 1; s <= 3; ++s) {
    refused = problems[s] - answers[s]
    printf "; size %d: %d of %d refused", s, refused, problems[s]
    if (refusals != "0" && refused > problems[s] * (most[s] + 3 * sqrt(most[s] * (1 - most[s]) / problems[s]))) { printf " FAIL: too many"; bad = 1 }
  }
  asort_n(widths, count)
  printf "; half-widths at the smallest size %.2g of the clean one's\n", widths[int((count + 1) / 2)]
  if (widths[int((count + 1) / 2)] > 2) { print "FAIL: too wide"; bad = 1 }
  exit bad
}
function asort_n(a, n,   i, j, t) {
  for (i = 2; i <= n; ++i) for (j = i; j > 1 && a[j] < a[j - 1]; --j) { t = a[j]; a[j] = a[j - 1]; a[j - 1] = t }
}
