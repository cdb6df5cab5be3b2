// The time of a config's picture from C++, what a caller pays: plan and render, memory included. For comparison with
// the same call from Python (tools/bench/python).
//   build/release/tools/bench/birefit_render CONFIG CALLS PATH=VALUE..     prints seconds a call, the median
// The first parameter named `sample.material.birefringence` changes from call to call, so that each is planned anew.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "birefit/io.h"
#include "io/results/picture.h"

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const std::vector<std::string> set(argv + 3, argv + argc);
  const birefit::Config config = birefit::load_config(argv[1], birefit::ConfigUse::render, std::nullopt, set);
  const birefit::ParameterRef changed = config.job.parameters.find("sample.material.birefringence");
  birefit::Theta theta = config.job.parameters.values();
  std::vector<double> seconds;
  for (int i = 0; i < std::atoi(argv[2]); ++i) {
    theta[static_cast<std::size_t>(changed.index)] += 1e-9;
    const auto begin = std::chrono::steady_clock::now();
    const auto picture = birefit::render_config(config, birefit::plans_of(config, theta), theta);
    seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  std::nth_element(seconds.begin(), seconds.begin() + seconds.size() / 2, seconds.end());
  std::printf("%.9f\n", seconds[seconds.size() / 2]);
}
