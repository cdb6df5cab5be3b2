// What physics remembers (Memo) changes no picture, whatever was asked before.

#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "birefit/memo.h"
#include "birefit/render.h"
#include "every_kind.h"
#include "medium/families/axial_equilibrium.h"
#include "medium/families/equilibrium.h"

namespace birefit {
namespace {

using testing::Kind;

std::vector<double> picture(const Kind& kind, const Theta& theta, std::shared_ptr<Memo> memo) {
  Demand demand = kind.demand;
  demand.memo = std::move(memo);
  const Rendering r = render(kind.scene, plan(kind.scene, demand, theta), theta, kind.four, 1);
  std::vector<double> all = r.intensity.values();
  for (const Image& d : r.derivatives) all.insert(all.end(), d.values().begin(), d.values().end());
  return all;
}

TEST(Memo, ChangesNoPictureOfAnyKind) {
  const auto shared = std::make_shared<Memo>();
  for (const Kind& kind : testing::every_kind_small()) {
    const Theta theta = kind.table.values();
    const std::vector<double> alone = picture(kind, theta, nullptr);
    EXPECT_EQ(picture(kind, theta, shared), alone) << kind.name << ": worked out for the memo";
    EXPECT_EQ(picture(kind, theta, shared), alone) << kind.name << ": from the memo";
  }
}

TEST(Memo, EquilibriaDoNotDependOnWhatWasAskedBefore) {
  // Each is reached from the nearest of a ladder of others: the way there must not matter.
  const auto change = [](double e, double ring, Memo* memo) {
    return known_axial_equilibrium(e, ring, true, memo)->change;
  };
  Memo memo;
  for (const double e : {25.0, 3.0, 9.7, 3.2, 0.4}) change(e, 0.0, &memo), change(e, 0.7, &memo);
  for (const double e : {9.6, 3.1})
    for (const double ring : {0.0, 0.71})
      EXPECT_EQ(change(e, ring, &memo), change(e, ring, nullptr)) << e << " " << ring;
}

TEST(Memo, SolvesOnce) {
  CellForces<double> forces;
  forces.drive = 30, forces.gamma = 1;
  Memo memo;
  const auto first = known_director(forces, &memo), again = known_director(forces, &memo);
  EXPECT_EQ(first, again);  // the very same
  EXPECT_NE(first, known_director(forces, nullptr));
  EXPECT_EQ(first->tilt, known_director(forces, nullptr)->tilt);
}

TEST(Memo, ForgetsTheOldestAndServesThreads) {
  Recent<int, int> recent(3);
  for (int i = 0; i < 5; ++i) recent.keep(i, std::make_shared<int>(10 * i));
  EXPECT_FALSE(recent.find(0));
  EXPECT_FALSE(recent.find(1));
  EXPECT_EQ(*recent.find(4), 40);
  EXPECT_EQ(*recent.keep(4, std::make_shared<int>(-1)), 40) << "of two that worked out the same the first one's";

  struct Store : Recent<int, int> {
    Store() : Recent(64) {}
  };
  Memo memo;
  std::vector<std::thread> threads;
  std::vector<int> wrong(4, 0);
  for (std::size_t t = 0; t < wrong.size(); ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 2000; ++i) {
        const int key = (i * 7 + static_cast<int>(t)) % 100;
        wrong[t] += *remembered<Store>(&memo, key, [&] { return std::make_shared<int>(key * key); }) != key * key;
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, std::vector<int>(4, 0));
}

}  // namespace
}  // namespace birefit
