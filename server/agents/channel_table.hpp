// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "agents/frame_source.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// What clients subscribe to: one entry per channel (kind x band), each with its plane.
struct Channel {
  std::uint16_t index = 0;
  std::string name;
  scene::ChannelKind kind = scene::ChannelKind::injection;
  std::string sensor;
  std::string band;
  double band_lo_um = 0.0;
  double band_hi_um = 0.0;
  std::vector<scene::ResponseSample> response;  ///< of the band; empty: a rectangle
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::size_t plane = 0;  ///< index into FrameView::radiance_w_m2_sr
};

[[nodiscard]] std::string_view to_string(scene::ChannelKind kind) noexcept;

/// Channels of a scenario, or the one channel of canned frames without a scenario. The size is the
/// source's. A scenario without channels gets an injection channel per band.
/// Errors (config): a channel whose band the scenario lacks, more bands than fit.
[[nodiscard]] physics::Result<std::vector<Channel>> make_channels(
    const std::optional<scene::ScenarioDesc>& scenario, const SourceInfo& source);

/// First channel that fits; empty fields fit anything. nullptr: none.
[[nodiscard]] const Channel* find_channel(const std::vector<Channel>& channels,
                                          std::string_view kind, std::string_view sensor,
                                          std::string_view band) noexcept;

}  // namespace emit::server
