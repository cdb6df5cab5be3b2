// One picture of every kind of sample, timed when asked for, so that two builds can be timed in lock step:
//   build/release/tools/bench/birefit_kinds                the kinds by name, each with its times
//   build/release/tools/bench/birefit_kinds --serve        for every name on standard input, seconds on standard output
// tools/bench/pair runs two of them against each other.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "birefit/render.h"
#include "every_kind.h"

using namespace birefit;
using birefit::testing::Kind;

namespace {

/// Of one call, the fastest of a few batches of some milliseconds each: what the machine's other work adds is never
/// negative.
double seconds_of(const std::function<void()>& work) {
  using Clock = std::chrono::steady_clock;
  constexpr double kBatch = 0.004;
  constexpr int kBatches = 3;
  work();
  double best = HUGE_VAL;
  for (int batch = 0; batch < kBatches; ++batch) {
    int calls = 0;
    double seconds = 0;
    for (const auto start = Clock::now(); seconds < kBatch;
         seconds = std::chrono::duration<double>(Clock::now() - start).count()) {
      work();
      ++calls;
    }
    best = std::min(best, seconds / calls);
  }
  return best;
}

/// A picture, with four derivatives or none, on one thread: the second core may be somebody else's.
class Timed {
 public:
  Timed(const Kind& kind, bool derivatives)
      : kind_(kind),
        theta_(kind.table.values()),
        plan_(plan(kind.scene, kind.demand, theta_)),
        active_(derivatives ? kind.four : std::vector<int>{}) {}
  double seconds() {
    return seconds_of([&] { render(kind_.scene, plan_, theta_, active_, 1, out_); });
  }

 private:
  const Kind& kind_;
  Theta theta_;
  RenderPlan plan_;
  std::vector<int> active_;
  Rendering out_;
};

}  // namespace

int main(int argc, char** argv) {
  const bool serve = argc > 1 && std::string(argv[1]) == "--serve";
  const std::vector<Kind> all = birefit::testing::every_kind();
  std::map<std::string, Timed> timed;
  std::vector<std::string> names;
  for (const Kind& kind : all)
    for (const bool derivatives : {false, true}) {
      names.push_back(kind.name + (derivatives ? "+4" : ""));
      timed.try_emplace(names.back(), kind, derivatives);
    }
  if (!serve) {
    for (const std::string& name : names)
      std::printf("%-24s %10.4f ms\n", name.c_str(), 1e3 * timed.at(name).seconds());
    return 0;
  }
  for (const std::string& name : names) std::printf("%s\n", name.c_str());
  std::printf("\n");
  std::fflush(stdout);
  for (std::string name; std::getline(std::cin, name);) {
    const auto found = timed.find(name);
    std::printf("%.9g\n", found == timed.end() ? 0.0 : found->second.seconds());
    std::fflush(stdout);
  }
}
