// SPDX-License-Identifier: Apache-2.0
#include "output/detector.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "output/noise.hpp"
#include "support/output_files.hpp"

namespace emit::server {
namespace {

using protocol::ImageSize;
using scene::ChannelDetector;

/// Mean and variance of numbers.
struct Moments {
  double mean = 0.0;
  double variance = 0.0;
};
template <class Values>
Moments moments_of(const Values& values) {
  Moments out;
  const auto count = static_cast<double>(values.size());
  for (const float value : values) out.mean += static_cast<double>(value) / count;
  for (const float value : values) {
    const double off = static_cast<double>(value) - out.mean;
    out.variance += off * off / count;
  }
  return out;
}

TEST(Noise, PhiloxGivesTheNumbersOfItsAuthors) {
  // Known answers of the Random123 library, philox4x32 with 10 rounds.
  using Four = std::array<std::uint32_t, 4>;
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (Four{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox({~0U, ~0U, ~0U, ~0U}, {~0U, ~0U}),
            (Four{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Four{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Noise, NormalNumbersAreNormal) {
  std::vector<float> all;
  std::vector<float> row(1000);
  for (std::uint32_t r = 0; r < 1000; ++r) {
    normal_row({7, NoiseStream::temporal, 123456789012ULL, r}, row);
    all.insert(all.end(), row.begin(), row.end());
  }
  const Moments moments = moments_of(all);
  EXPECT_NEAR(moments.mean, 0.0, 4e-3);
  EXPECT_NEAR(moments.variance, 1.0, 6e-3);
  double fourth = 0.0;
  for (const float value : all) fourth += std::pow(static_cast<double>(value), 4) / 1e6;
  EXPECT_NEAR(fourth, 3.0, 0.04);
  // Kolmogorov's distance to the normal distribution.
  std::ranges::sort(all);
  double distance = 0.0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const double expected = 0.5 * std::erfc(-static_cast<double>(all[i]) / std::numbers::sqrt2);
    distance = std::max(distance, std::abs(expected - (static_cast<double>(i) + 0.5) / 1e6));
  }
  EXPECT_LT(distance, 1.95e-3) << "beyond chance, 1 in 1000";
}

TEST(Noise, PlacesAreIndependentAndProcessorsAgree) {
  const NoisePlace place{1, NoiseStream::temporal, 5, 3};
  std::vector<float> row(4001);
  std::vector<float> other(row.size());
  normal_row(place, row);
  normal_row_plain(place, other);
  EXPECT_EQ(row, other);
  std::vector<float> begin(77);
  normal_row(place, begin);
  EXPECT_TRUE(std::equal(begin.begin(), begin.end(), row.begin())) << "the length plays no part";
  for (const NoisePlace& elsewhere :
       {NoisePlace{2, NoiseStream::temporal, 5, 3}, NoisePlace{1, NoiseStream::pixel_gain, 5, 3},
        NoisePlace{1, NoiseStream::temporal, 6, 3},
        NoisePlace{1, NoiseStream::temporal, 5 + (1ULL << 32U), 3},
        NoisePlace{1, NoiseStream::temporal, 5, 4}}) {
    normal_row(elsewhere, other);
    double product = 0.0;
    for (std::size_t i = 0; i < row.size(); ++i) {
      product += static_cast<double>(row[i]) * static_cast<double>(other[i]);
    }
    EXPECT_NEAR(product / static_cast<double>(row.size()), 0.0, 0.06);
  }
}

TEST(Noise, DriftHasASpectrumOfOneOverF) {
  constexpr std::size_t kFrames = 512;
  constexpr std::uint32_t kRows = 40;
  // Add up the power in octaves of frequency, over many rows. 1/f has the same in each.
  std::array<double, 6> power{};
  double variance = 0.0;
  for (std::uint32_t row = 0; row < kRows; ++row) {
    std::vector<float> course(kFrames);
    for (std::size_t n = 0; n < kFrames; ++n) {
      course[n] = drift_at({3, NoiseStream::row_drift, 1000 + n, row});
      variance +=
          static_cast<double>(course[n]) * static_cast<double>(course[n]) / (kFrames * kRows);
    }
    for (std::size_t octave = 0; octave < power.size(); ++octave) {
      const std::size_t first = std::size_t{4} << octave;
      for (std::size_t f = first; f < 2 * first; ++f) {
        std::complex<double> sum;
        for (std::size_t n = 0; n < kFrames; ++n) {
          sum += static_cast<double>(course[n]) *
                 std::polar(1.0, -2.0 * std::numbers::pi * static_cast<double>(f * n) / kFrames);
        }
        power[octave] += std::norm(sum);
      }
    }
  }
  EXPECT_NEAR(variance, 1.0, 0.1);
  double mean = 0.0;
  for (const double value : power) mean += value / static_cast<double>(power.size());
  for (const double value : power) EXPECT_NEAR(value / mean, 1.0, 0.3);
}

constexpr ImageSize kSize{320, 240};
const physics::Band kBand{8.0, 12.0, {}};

Detector made(const ChannelDetector& settings) {
  auto detector = Detector::make(settings, kBand, kSize);
  EXPECT_TRUE(detector.has_value()) << detector.error().text;
  return std::move(*detector);
}

std::vector<float> frame_of(Detector& detector, std::uint64_t number, float radiance,
                            std::uint32_t* clamped = nullptr) {
  std::vector<float> out(std::size_t{kSize.width_px} * kSize.height_px, radiance);
  detector.begin_frame(number);
  for (std::uint32_t row = 0; row < kSize.height_px; ++row) {
    const std::uint32_t of_row =
        detector.apply_line(row, std::span(out).subspan(row * kSize.width_px, kSize.width_px));
    if (clamped != nullptr) *clamped += of_row;
  }
  return out;
}

TEST(Detector, NoiseHasTheStatedTemperatureDifference) {
  const physics::BandRadiance at = physics::band_radiance(kBand, physics::Kelvin(300.0));
  const auto reference = static_cast<float>(at.radiance_w_m2_sr);
  for (const double photon_frac : {0.0, 0.4, 1.0}) {
    Detector detector = made({.netd_k = 0.08, .photon_frac = photon_frac});
    for (const float times : {0.0F, 0.5F, 1.0F, 4.0F}) {
      const Moments moments = moments_of(frame_of(detector, 9, times * reference));
      const double expected = std::pow(0.08 * at.derivative_w_m2_sr_k, 2) *
                              (1.0 - photon_frac + photon_frac * static_cast<double>(times));
      EXPECT_NEAR(moments.mean, times * reference, 0.02 * std::sqrt(expected) + 1e-6);
      EXPECT_NEAR(std::sqrt(moments.variance), std::sqrt(expected),
                  0.02 * std::sqrt(expected) + 1e-6)
          << photon_frac << ' ' << times;
    }
  }
}

TEST(Detector, AFrameHasTheSameBitsAgainAndAnotherFrameHasOthers) {
  const ChannelDetector settings{
      .netd_k = 0.05, .row_noise_k = 0.02, .column_noise_k = 0.02, .gain_spread_frac = 0.01};
  Detector one = made(settings);
  Detector two = made(settings);
  const std::vector<float> fourth = frame_of(one, 4, 30.0F);
  const std::vector<float> fifth = frame_of(one, 5, 30.0F);
  EXPECT_EQ(frame_of(two, 5, 30.0F), fifth);
  EXPECT_EQ(frame_of(two, 4, 30.0F), fourth);
  EXPECT_NE(fourth, fifth);
  ChannelDetector seeded = settings;
  seeded.seed = 2;
  Detector other = made(seeded);
  EXPECT_NE(frame_of(other, 4, 30.0F), fourth);
}

TEST(Detector, TheFixedPatternStaysAndHasItsSpread) {
  const physics::BandRadiance at = physics::band_radiance(kBand, physics::Kelvin(300.0));
  Detector gains = made({.gain_spread_frac = 0.02});
  const std::vector<float> first = frame_of(gains, 1, 20.0F);
  EXPECT_EQ(frame_of(gains, 2, 20.0F), first);
  EXPECT_NEAR(std::sqrt(moments_of(first).variance), 0.4, 0.02 * 0.4);
  Detector offsets = made({.offset_spread_k = 0.5});
  const double expected = 0.5 * at.derivative_w_m2_sr_k;
  EXPECT_NEAR(std::sqrt(moments_of(frame_of(offsets, 1, 0.0F)).variance), expected,
              0.02 * expected);
}

TEST(Detector, RowsAndColumnsDriftTogether) {
  Detector detector = made({.row_noise_k = 0.3});
  const std::vector<float> frame = frame_of(detector, 77, 10.0F);
  for (std::uint32_t row = 0; row < kSize.height_px; ++row) {
    for (std::uint32_t x = 1; x < kSize.width_px; ++x) {
      ASSERT_EQ(frame[row * kSize.width_px + x], frame[row * kSize.width_px]);
    }
  }
  Detector columns = made({.column_noise_k = 0.3});
  const std::vector<float> other = frame_of(columns, 77, 10.0F);
  EXPECT_EQ(other[5], other[7 * kSize.width_px + 5]);
  EXPECT_NE(other[5], other[6]);
}

TEST(Detector, CountsAreWholeAndTheirEndsAreCounted) {
  Detector detector = made({.counts_per_w_m2_sr = 100.0, .counts_offset = 50.0, .counts_bits = 12});
  for (const auto& [radiance, counts, beyond] :
       {std::tuple{0.0F, 50.0F, false}, std::tuple{1.004F, 150.0F, false},
        std::tuple{1.006F, 151.0F, false}, std::tuple{40.45F, 4095.0F, false},
        std::tuple{41.0F, 4095.0F, true}, std::tuple{-0.504F, 0.0F, false},
        std::tuple{-0.506F, 0.0F, true},
        std::tuple{std::numeric_limits<float>::quiet_NaN(), 0.0F, true},
        std::tuple{std::numeric_limits<float>::infinity(), 4095.0F, true}}) {
    std::uint32_t clamped = 0;
    const std::vector<float> frame = frame_of(detector, 1, radiance, &clamped);
    EXPECT_EQ(frame[100], counts) << radiance;
    EXPECT_EQ(clamped, beyond ? frame.size() : 0U) << radiance;
  }
}

TEST(Detector, BadPixelsSeeNothing) {
  Detector detector = made({.bad_px_frac = 0.02, .counts_per_w_m2_sr = 10.0});
  const std::vector<float> one = frame_of(detector, 1, 30.0F);
  const std::vector<float> two = frame_of(detector, 2, 60.0F);
  std::size_t dead = 0;
  std::size_t hot = 0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    dead += one[i] == 0.0F && two[i] == 0.0F ? 1U : 0U;
    hot += one[i] == 16383.0F && two[i] == 16383.0F ? 1U : 0U;
  }
  const double each = 0.01 * static_cast<double>(one.size());
  EXPECT_NEAR(static_cast<double>(dead), each, 5.0 * std::sqrt(each));
  EXPECT_NEAR(static_cast<double>(hot), each, 5.0 * std::sqrt(each));
}

TEST(Detector, KelvinNeedABandWithRadiance) {
  EXPECT_FALSE(Detector::make({.netd_k = 0.1}, std::nullopt, kSize).has_value());
  EXPECT_TRUE(Detector::make({.counts_per_w_m2_sr = 1.0}, std::nullopt, kSize).has_value());
  const physics::Band ultraviolet{0.25, 0.3, {}};
  EXPECT_FALSE(Detector::make({.netd_k = 0.1}, ultraviolet, kSize).has_value());
  EXPECT_TRUE(
      Detector::make({.reference_k = 3000.0, .netd_k = 0.1}, ultraviolet, kSize).has_value());
  EXPECT_FALSE(Detector::make({.bad_px_frac = 0.1}, kBand, kSize).has_value());
}

}  // namespace
}  // namespace emit::server
