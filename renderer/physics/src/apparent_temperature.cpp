// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/apparent_temperature.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "emit/physics/check.hpp"

namespace emit::physics {
namespace {

constexpr double kLowestK = 150.0;
constexpr double kHighestK = 3000.0;
/// Factor on a temperature that is more than a node away.
constexpr double kBeyond = 1.05;
/// Number of low bits that are zero in the radiance of every node. It leaves 64 nodes to every
/// doubling of radiance.
constexpr unsigned kDroppedBits = 17;

std::size_t index_of(float radiance_w_m2_sr) noexcept {
  return std::bit_cast<std::uint32_t>(radiance_w_m2_sr) >> kDroppedBits;
}

float radiance_at(std::size_t index) noexcept {
  return std::bit_cast<float>(static_cast<std::uint32_t>(index << kDroppedBits));
}

}  // namespace

ApparentTemperature::ApparentTemperature(const Band& band) {
  EMIT_CHECK(validate(band).has_value());
  const auto radiance = [&](double at_k) {
    return band_radiance(band, Kelvin(at_k)).radiance_w_m2_sr;
  };
  first_ = index_of(static_cast<float>(radiance(kLowestK)));
  const std::size_t last = index_of(static_cast<float>(radiance(kHighestK))) + 1;
  // The outermost nodes lie beyond the range, so that the table is right up to its ends.
  double low_k = kLowestK / kBeyond;
  // Find the temperature of every node by bisection, starting at the temperature of the node
  // before.
  for (std::size_t i = first_; i <= last; ++i) {
    const auto wanted = static_cast<double>(radiance_at(i));
    double high_k = kHighestK * kBeyond;
    for (int round = 0; round < 40; ++round) {
      const double middle_k = 0.5 * (low_k + high_k);
      (radiance(middle_k) < wanted ? low_k : high_k) = middle_k;
    }
    node_k_.push_back(static_cast<float>(low_k));
  }
}

float ApparentTemperature::k(float radiance_w_m2_sr) const noexcept {
  // Take the leading bits as the index. NaN and radiances that are not positive count as below the
  // table.
  const std::size_t index = radiance_w_m2_sr > 0.0F ? index_of(radiance_w_m2_sr) : 0;
  if (index < first_) return static_cast<float>(kLowestK);
  const std::size_t i = index - first_;
  if (i + 1 >= node_k_.size()) return static_cast<float>(kHighestK);
  const float low = radiance_at(index);
  const float part = (radiance_w_m2_sr - low) / (radiance_at(index + 1) - low);
  return std::clamp(std::lerp(node_k_[i], node_k_[i + 1], part), static_cast<float>(kLowestK),
                    static_cast<float>(kHighestK));
}

double ApparentTemperature::rms_difference_k(std::span<const float> a_w_m2_sr,
                                             std::span<const float> b_w_m2_sr) const noexcept {
  EMIT_CHECK_OP(a_w_m2_sr.size(), ==, b_w_m2_sr.size());
  EMIT_CHECK(!a_w_m2_sr.empty());
  double sum = 0.0;
  for (std::size_t i = 0; i < a_w_m2_sr.size(); ++i) {
    if (a_w_m2_sr[i] == b_w_m2_sr[i]) continue;
    const auto difference = static_cast<double>(k(a_w_m2_sr[i]) - k(b_w_m2_sr[i]));
    sum += difference * difference;
  }
  return std::sqrt(sum / static_cast<double>(a_w_m2_sr.size()));
}

}  // namespace emit::physics
