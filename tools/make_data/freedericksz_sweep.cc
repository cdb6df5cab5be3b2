// Makes the table of data/freedericksz_sweep: run from the repository's root,
//   g++ -std=c++20 -O2 -Itests/support tools/make_data/freedericksz_sweep.cc -o make_sweep && ./make_sweep >
//   data/freedericksz_sweep/sweep.csv

#include <cstdio>
#include <random>

#include "independent_field_cell.h"

int main() {
  using namespace birefit::testing;
  IndependentFieldCell cell;  // E7-like: K33/K11 17.1/11.1, eps 19.28/5.21
  cell.pretilt_deg = 2;
  cell.thickness_um = 6.2;
  constexpr double kThreshold = 0.97, kGain = 2.4, kOffset = 0.15, kNoise = 0.01, kWavelengthUm = 0.59;
  std::mt19937_64 random(1907);
  std::normal_distribution<double> noise(0, kNoise);
  std::puts("voltage_v,signal_v");
  for (int i = 0; i < 48; ++i) {
    const double volts = 0.2 + 0.1 * i;
    std::printf("%.2f,%.5f\n", volts,
                kOffset + kGain * cell.crossed(volts / kThreshold, kWavelengthUm) + noise(random));
  }
}
