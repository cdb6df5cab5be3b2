// Whole renders: what a config describes is planned and drawn, as far as the picture is small.
#include "birefit/render.h"
#include "birefit/io.h"
#include "fuzz_target.h"

using namespace birefit;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::expect_an_answer([&] {
    Config config =
        load_config_text(fuzz::text_of(data, size), BIREFIT_FUZZ_BESIDE "/fit_configs/fuzzed.yaml", ConfigUse::render);
    Scene& scene = config.scene;
    // Propagated waves take seconds, and large pictures no other path than small ones.
    constexpr int kSide = 48;
    if (config.job.demand.ceiling == Ceiling::wave) return;
    if (scene.view.width > kSide || scene.view.height > kSide) scene.view.width = scene.view.height = kSide;
    const Theta theta = config.job.parameters.values();
    const RenderPlan planned = plan(scene, config.job.demand, theta, config.observable);
    if (config.observable.quantity == Quantity::intensity) render(scene, planned, theta, {}, 1);
  });
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed) {
  return fuzz::mutate_config(data, size, most, seed);
}
