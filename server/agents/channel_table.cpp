// SPDX-License-Identifier: Apache-2.0
#include "agents/channel_table.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "agents/messages.hpp"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;

std::string_view to_string(scene::ChannelKind kind) noexcept {
  return kind == scene::ChannelKind::projector ? "projector" : "injection";
}

physics::Result<std::vector<Channel>> make_channels(
    const std::optional<scene::ScenarioDesc>& scenario, const SourceInfo& source) {
  std::vector<Channel> channels;
  const auto add = [&](const std::string& name, scene::ChannelKind kind,
                       const scene::SpectralBand& band, std::size_t plane) {
    Channel channel;
    channel.index = static_cast<std::uint16_t>(channels.size());
    channel.name = name;
    channel.kind = kind;
    channel.sensor = scenario ? scenario->sensor.name : "canned";
    channel.band = band.name;
    channel.band_lo_um = band.lo_um;
    channel.band_hi_um = band.hi_um;
    channel.response = band.response;
    channel.width_px = source.width_px;
    channel.height_px = source.height_px;
    channel.plane = plane;
    channels.push_back(std::move(channel));
  };

  if (!scenario) {
    add("canned", scene::ChannelKind::injection, scene::SpectralBand{"canned", 0.0, 0.0, {}}, 0);
    return channels;
  }
  const auto& bands = scenario->bands;
  if (bands.size() > kMaxPlanes || bands.size() > source.planes) {
    return make_error(ErrorCode::config, fmt::format("{}: {} bands, at most {} can be streamed",
                                                     scenario->file.string(), bands.size(),
                                                     std::min(kMaxPlanes, source.planes)));
  }
  if (scenario->channels.empty()) {
    for (std::size_t i = 0; i < bands.size(); ++i) {
      add(bands[i].name, scene::ChannelKind::injection, bands[i], i);
    }
  }
  for (const auto& wanted : scenario->channels) {
    const auto band = std::find_if(bands.begin(), bands.end(),
                                   [&](const auto& b) { return b.name == wanted.band; });
    if (band == bands.end()) {
      return make_error(ErrorCode::config,
                        fmt::format("{}: channel '{}' names the band '{}', which does not exist",
                                    scenario->file.string(), wanted.name, wanted.band));
    }
    add(wanted.name, wanted.kind, *band, static_cast<std::size_t>(band - bands.begin()));
  }
  if (channels.empty()) {
    return make_error(ErrorCode::config, scenario->file.string() + ": no band and no channel");
  }
  return channels;
}

const Channel* find_channel(const std::vector<Channel>& channels, std::string_view kind,
                            std::string_view sensor, std::string_view band) noexcept {
  const auto found = std::find_if(channels.begin(), channels.end(), [&](const Channel& channel) {
    return (kind.empty() || kind == to_string(channel.kind)) &&
           (sensor.empty() || sensor == channel.sensor) && (band.empty() || band == channel.band);
  });
  return found != channels.end() ? &*found : nullptr;
}

}  // namespace emit::server
