// SPDX-License-Identifier: Apache-2.0
#include "tool/support/library_edit.hpp"

#include <gtest/gtest.h>

namespace emit::tool {
namespace {

const char* const kLibrary = R"(# head
[[material]]
# a comment
name = "a"
layers = [
  { thickness_m = 0.1 },
]
modes = [
  { tau_s = 1, weight_frac = 1 },
]
foster_modes = [
  { tau_s = 9, resistance_m2k_w = 1 },
]
foster_fit = { horizon_s = 1, rms_k = 1, max_k = 1 }
source = "s"

[[material]]
name = "b"
base_k = 290
)";

LibraryEntry entry(const std::string& name) {
  LibraryEntry out;
  out.fit.material = name;
  out.fit.network.count = 2;
  out.fit.network.modes[0] = {12.5, 0.25};
  out.fit.network.modes[1] = {800.0, 0.75};
  out.fit.horizon_s = 99000;
  out.fit.rms_k = 0.1234;
  out.fit.max_k = 0.5;
  out.fit.modes = {{33.0, 0.4}, {66.0, 0.6}};
  return out;
}

TEST(LibraryEdit, ReplacesOnlyTheFittedModesOfTheNamedMaterial) {
  const LibraryEntry entries[] = {entry("a")};
  const auto text = with_fitted_modes(kLibrary, entries);
  ASSERT_TRUE(text) << text.error().text;
  EXPECT_EQ(*text, R"(# head
[[material]]
# a comment
name = "a"
layers = [
  { thickness_m = 0.1 },
]
modes = [
  { tau_s = 1, weight_frac = 1 },
]
foster_modes = [
  { tau_s = 12.5, resistance_m2k_w = 0.25 },
  { tau_s = 800, resistance_m2k_w = 0.75 },
]
foster_fit = { horizon_s = 99000, rms_k = 0.123, max_k = 0.500 }
source = "s"

[[material]]
name = "b"
base_k = 290
)");
  // A second edit changes nothing.
  EXPECT_EQ(*with_fitted_modes(*text, entries), *text);
}

TEST(LibraryEdit, AddsModesWhereThereWereNone) {
  const LibraryEntry entries[] = {entry("b")};
  const auto text = with_fitted_modes(kLibrary, entries);
  ASSERT_TRUE(text);
  EXPECT_TRUE(
      text->ends_with("base_k = 290\nfoster_modes = [\n  { tau_s = 12.5, resistance_m2k_w = "
                      "0.25 },\n  { tau_s = 800, resistance_m2k_w = 0.75 },\n]\nfoster_fit = "
                      "{ horizon_s = 99000, rms_k = 0.123, max_k = 0.500 }\n"));
}

TEST(LibraryEdit, WritesTheModesOfThePublishedModelByTheirOwnKey) {
  LibraryEntry one = entry("a");
  one.foster = false;
  const LibraryEntry entries[] = {one};
  const auto text = with_fitted_modes(kLibrary, entries);
  ASSERT_TRUE(text);
  EXPECT_NE(text->find("modes = [\n  { tau_s = 33, weight_frac = 0.4 },"), std::string::npos);
  EXPECT_NE(text->find("{ tau_s = 9, resistance_m2k_w = 1 }"), std::string::npos);
  EXPECT_EQ(text->find("tau_s = 1,"), std::string::npos);
}

TEST(LibraryEdit, NamesAMaterialThatIsMissing) {
  const LibraryEntry entries[] = {entry("c")};
  const auto text = with_fitted_modes(kLibrary, entries);
  ASSERT_FALSE(text);
  EXPECT_NE(text.error().text.find("'c'"), std::string::npos);
}

}  // namespace
}  // namespace emit::tool
