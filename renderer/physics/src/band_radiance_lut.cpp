// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/band_radiance_lut.hpp"

#include <cmath>

namespace emit::physics {

Result<BandRadianceLut> BandRadianceLut::build(const Band& band, const Options& options) {
  if (auto valid = validate(band); !valid) {
    return tl::unexpected(valid.error());
  }
  if (!(options.min_k > 0.0) || !(options.max_k > options.min_k) || !std::isfinite(options.max_k) ||
      options.nodes < 2 || options.nodes > (1U << 20)) {
    return make_error(ErrorCode::invalid_argument,
                      "radiance table needs 0 < min_k < max_k and 2..1048576 nodes");
  }
  BandRadianceLut lut;
  const auto last = static_cast<double>(options.nodes - 1);
  lut.min_k_ = static_cast<float>(options.min_k);
  lut.nodes_per_k_ = static_cast<float>(last / (options.max_k - options.min_k));
  lut.last_node_ = static_cast<float>(last);
  lut.nodes_.reserve(options.nodes);
  for (std::uint32_t i = 0; i < options.nodes; ++i) {
    // Evaluate the radiance at the place that float32 arithmetic gives the node, not at the exact
    // one.
    const double t = static_cast<double>(lut.min_k_) + i / static_cast<double>(lut.nodes_per_k_);
    lut.nodes_.push_back(static_cast<float>(t * band_radiance(band, Kelvin(t)).log_radiance));
  }
  return lut;
}

BandRadianceLut::Lookup BandRadianceLut::lookup(float temperature_k) const noexcept {
  Lookup result;
  float place = (temperature_k - min_k_) * nodes_per_k_;
  float t = temperature_k;
  if (!(place >= 0.0F)) {
    result.clamped = true;
    place = 0.0F;
    t = min_k_;
  } else if (place > last_node_) {
    result.clamped = true;
    place = last_node_;
    t = min_k_ + last_node_ / nodes_per_k_;
  }
  const float node = std::fmin(std::floor(place), last_node_ - 1.0F);
  const auto first = static_cast<std::size_t>(node);
  const float fraction = place - node;
  const float y = nodes_[first] * (1.0F - fraction) + nodes_[first + 1] * fraction;
  result.radiance_w_m2_sr = std::exp(y / t);
  return result;
}

}  // namespace emit::physics
