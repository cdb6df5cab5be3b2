#pragma once
// A folder of its own for what a config names, and the mistakes that load_config finds in it.

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "birefit/io.h"

namespace birefit::testing {

class ConfigFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("birefit-config-" + std::to_string(::getpid()));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  birefit::Config load(const std::string& text, ConfigUse use = ConfigUse::render) {
    return load_config(write("config.yaml", text), use);
  }
  /// All messages without the folder; "" when the config is sound.
  std::string mistakes(const std::string& text, ConfigUse use = ConfigUse::render) {
    try {
      load(text, use);
    } catch (const UserError& error) {
      std::string what = error.what();
      const std::string prefix = folder_.string() + "/";
      for (std::size_t at; (at = what.find(prefix)) != std::string::npos;) what.erase(at, prefix.size());
      return what;
    }
    return {};
  }
  static std::string replaced(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
  }
  /// A smooth image with contrast and some reproducible noise, in whole counts.
  static Image counts(double level, unsigned seed, int width = 32, int height = 32) {
    Image image(width, height);
    for (double& value : image.values()) {
      seed = seed * 1664525u + 1013904223u;
      value = std::round(level + (seed >> 24) / 16.0);
    }
    return image;
  }
  /// An image file; float TIFF, so that values come back as they are.
  void save(const std::string& name, const Image& image) { save_image(image, folder_ / name); }

  std::filesystem::path folder_;
};

}  // namespace birefit::testing
