#!/usr/bin/env bash
# An installed birefit is found by another CMake project, which links birefit::model and birefit::io, the latter into a
# shared library of its own.
set -euo pipefail
build=$(dirname "$1")
rm -rf prefix consumer
cmake --install "$build" --prefix "$PWD/prefix" >install.log
"$PWD/prefix/bin/birefit" --version
mkdir consumer
cat >consumer/CMakeLists.txt <<'EOF'
cmake_minimum_required(VERSION 3.25)
project(consumer CXX)
find_package(birefit REQUIRED)
add_library(reader SHARED reader.cc)
target_compile_features(reader PRIVATE cxx_std_20)
target_link_libraries(reader PRIVATE birefit::io)
add_executable(consumer consumer.cc)
target_link_libraries(consumer PRIVATE reader birefit::model)
EOF
cat >consumer/reader.cc <<'EOF'
#include <birefit/error.h>
#include <birefit/io.h>
bool refuses(const char* text) {
  try {
    birefit::load_config_text(text, "consumer", birefit::ConfigUse::render);
  } catch (const birefit::UserError&) {
    return true;
  }
  return false;
}
EOF
cat >consumer/consumer.cc <<'EOF'
#include <birefit/error.h>
#include <birefit/fit.h>
bool refuses(const char* text);
int main() {
  birefit::ParameterTable table;
  table.add_constant("answer", 42);
  birefit::Scene scene;
  scene.sample = birefit::Slab{};
  birefit::FitJob job;
  try {
    birefit::fit(job);  // nothing to fit: the mistake is reported, which shows that Ceres was linked
  } catch (const birefit::UserError&) {
  }
  return table.size() == 1 && refuses("sample: nothing\n") ? 0 : 1;
}
EOF
flags=$(sed -n 's/^CMAKE_CXX_FLAGS:[A-Z]*=//p' "$build/CMakeCache.txt")
sanitize=$(sed -n 's/^BIREFIT_SANITIZE:[A-Z]*=//p' "$build/CMakeCache.txt")
cmake -G Ninja -S consumer -B consumer/build -DCMAKE_PREFIX_PATH="$PWD/prefix" -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_CXX_FLAGS="$flags${sanitize:+ -fsanitize=$sanitize}" >configure.log
cmake --build consumer/build >build.log
consumer/build/consumer
