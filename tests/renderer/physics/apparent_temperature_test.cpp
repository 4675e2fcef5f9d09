// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/apparent_temperature.hpp"

#include <gtest/gtest.h>

#include <array>

namespace emit::physics {
namespace {

TEST(ApparentTemperature, undoes_the_blackbody) {
  for (const Band& band : {Band{3.0, 5.0, {}}, Band{8.0, 12.0, {}}}) {
    const ApparentTemperature apparent(band);
    for (double t_k = 150.5; t_k < 2999.0; t_k *= 1.013) {
      const auto radiance = static_cast<float>(band_radiance(band, Kelvin(t_k)).radiance_w_m2_sr);
      EXPECT_NEAR(static_cast<double>(apparent.k(radiance)), t_k, 0.02);
    }
    EXPECT_NEAR(apparent.k(0.0F), 150.0F, 1.0F);
    EXPECT_NEAR(apparent.k(-1.0F), 150.0F, 1.0F);
    EXPECT_NEAR(apparent.k(1e30F), 3000.0F, 1.0F);
  }
}

TEST(ApparentTemperature, tells_the_rms_difference_of_pictures) {
  const Band band{8.0, 12.0, {}};
  const ApparentTemperature apparent(band);
  const auto radiance = [&](double t_k) {
    return static_cast<float>(band_radiance(band, Kelvin(t_k)).radiance_w_m2_sr);
  };
  const std::array<float, 4> a{radiance(300), radiance(300), radiance(500), radiance(250)};
  const std::array<float, 4> b{radiance(300), radiance(302), radiance(500), radiance(250)};
  EXPECT_NEAR(apparent.rms_difference_k(a, b), 1.0, 0.01);
  EXPECT_EQ(apparent.rms_difference_k(a, a), 0.0);
}

}  // namespace
}  // namespace emit::physics
