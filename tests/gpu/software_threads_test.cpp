// SPDX-License-Identifier: Apache-2.0
// The driver names its threads as threads/software_threads expects.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdlib>

#include "gl/egl_context.hpp"
#include "threads/core_set.hpp"

namespace emit::threads {
namespace {

TEST(SoftwareThreads, AreThoseOfTheDriver) {
  const auto context = gl::EglContext::create(-1, false);
  ASSERT_TRUE(context) << context.error().text;
  if (!context->software()) {
    EXPECT_TRUE(context->threads().raster().empty());
    EXPECT_TRUE(context->threads().compute().empty());
    return;
  }
  constexpr int kMostOfMesa = 16;
  const int cores = CoreSet::of(0).count();
  if (cores < 2 || cores > kMostOfMesa || std::getenv("LP_NUM_THREADS") != nullptr) {
    GTEST_SKIP() << "not one thread per core";
  }
  EXPECT_EQ(context->threads().raster().size(), static_cast<std::size_t>(cores));
  EXPECT_EQ(context->threads().compute().size(), static_cast<std::size_t>(cores));
}

}  // namespace
}  // namespace emit::threads
