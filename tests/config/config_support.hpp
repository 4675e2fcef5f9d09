// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "emit/config/load.hpp"

namespace emit::config::testing {

/// A folder of its own per test, with a small material library; the environment is empty and glTF
/// files need not exist unless a test says otherwise.
class ConfigTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(info->test_suite_name()) + "." + info->name();
    for (char& c : name) {
      c = c == '/' ? '_' : c;
    }
    folder_ = std::filesystem::path(EMIT_TEST_BINARY_DIR) / "tests" / "config" / name;
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
    options_.require_scene_files = false;
    options_.environment.emplace();
    write("m.toml",
          "[[material]]\n"
          "name = \"concrete\"\n"
          "solar_absorptance_frac = 0.6\n"
          "emissivity_frac = 0.88\n"
          "base_k = 293.15\n"
          "layers = [{ thickness_m = 0.1, conductivity_w_m_k = 1.28, density_kg_m3 = 2300, "
          "specific_heat_j_kg_k = 878 }]\n");
  }

  std::filesystem::path write(const std::string& name, std::string_view text) {
    const std::filesystem::path file = folder_ / name;
    std::ofstream(file, std::ios::binary) << text;
    return file;
  }

  /// Loads `text` as s.toml, below a first line that names the small library.
  physics::Result<scene::ScenarioDesc> scenario(const std::string& text,
                                                const std::vector<std::string>& overrides = {}) {
    return load_scenario(write("s.toml", "materials = [\"m.toml\"]\n" + text), overrides, options_);
  }
  physics::Result<DaemonConfig> daemon(const std::string& text,
                                       const std::vector<std::string>& overrides = {}) {
    return load_daemon(write("d.toml", text), overrides, options_);
  }

  /// Error text with the test's folder cut out: "s.toml:2:1: ...".
  std::string scenario_error(const std::string& text,
                             const std::vector<std::string>& overrides = {}) {
    const auto loaded = scenario(text, overrides);
    if (loaded) {
      return "(loaded)";
    }
    EXPECT_EQ(loaded.error().code, physics::ErrorCode::config);
    return without_folder(loaded.error().text);
  }
  std::string daemon_error(const std::string& text,
                           const std::vector<std::string>& overrides = {}) {
    const auto loaded = daemon(text, overrides);
    if (loaded) {
      return "(loaded)";
    }
    EXPECT_EQ(loaded.error().code, physics::ErrorCode::config);
    return without_folder(loaded.error().text);
  }
  std::string without_folder(std::string text) const {
    const std::string prefix = folder_.string() + "/";
    for (std::size_t at = text.find(prefix); at != std::string::npos; at = text.find(prefix)) {
      text.erase(at, prefix.size());
    }
    return text;
  }

  std::filesystem::path folder_;
  LoadOptions options_;
};

}  // namespace emit::config::testing
