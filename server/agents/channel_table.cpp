// SPDX-License-Identifier: Apache-2.0
#include "agents/channel_table.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "emit/protocol/frame_header.hpp"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;

std::string_view to_string(scene::ChannelKind kind) noexcept {
  return kind == scene::ChannelKind::projector ? "projector" : "injection";
}

namespace {

/// Takes the memory of an image whose rows do not lie in one piece.
void add_copies(Picture& picture, const SourceInfo& source) {
  const scene::PixelRect& window = picture.window_px;
  if (window.width_px != source.width_px) {
    picture.copies.assign(source.slots,
                          std::vector<float>(std::size_t{window.width_px} * window.height_px));
  }
}

bool fits(const scene::PixelRect& window, const SourceInfo& source) noexcept {
  return window.x_px < source.width_px && window.y_px < source.height_px &&
         window.width_px <= source.width_px - window.x_px &&
         window.height_px <= source.height_px - window.y_px;
}

}  // namespace

physics::Result<ChannelTable> make_channels(const std::optional<scene::ScenarioDesc>& scenario,
                                            const SourceInfo& source) {
  ChannelTable table;
  const auto add = [&](const scene::ChannelDesc& wanted, const scene::SpectralBand& band,
                       std::size_t plane) {
    const scene::PixelRect window = wanted.window_px.empty()
                                        ? scene::PixelRect{0, 0, source.width_px, source.height_px}
                                        : wanted.window_px;
    Channel channel;
    channel.index = static_cast<std::uint16_t>(table.channels.size());
    channel.name = wanted.name;
    channel.kind = wanted.kind;
    channel.sensor = scenario ? scenario->sensor.name : "canned";
    channel.band = band.name;
    channel.band_lo_um = band.lo_um;
    channel.band_hi_um = band.hi_um;
    channel.response = band.response;
    channel.width_px = window.width_px;
    channel.height_px = window.height_px;
    channel.window_x_px = window.x_px;
    channel.window_y_px = window.y_px;
    channel.sensor_width_px = source.width_px;
    channel.sensor_height_px = source.height_px;
    channel.every_nth = wanted.every_nth;
    auto picture = std::find_if(
        table.pictures.begin(), table.pictures.end(),
        [&](const Picture& other) { return other.plane == plane && other.window_px == window; });
    if (picture == table.pictures.end()) {
      picture = table.pictures.insert(picture, {plane, window, 0, {}});
    }
    picture->channels |= ChannelSet{1} << (channel.index % kMaxChannels);
    channel.picture = static_cast<std::size_t>(picture - table.pictures.begin());
    table.channels.push_back(std::move(channel));
  };
  const auto finish = [&]() -> physics::Result<ChannelTable> {
    const std::string where = scenario ? scenario->file.string() : std::string("source");
    if (table.channels.size() > kMaxChannels || table.pictures.size() > kMaxPictures) {
      return make_error(ErrorCode::config,
                        fmt::format("{}: {} channels of {} bands and windows, at most {} of {} can "
                                    "be streamed",
                                    where, table.channels.size(), table.pictures.size(),
                                    kMaxChannels, kMaxPictures));
    }
    for (const Channel& channel : table.channels) {
      if (!fits(table.pictures[channel.picture].window_px, source)) {
        return make_error(ErrorCode::config,
                          fmt::format("{}: window_px of channel '{}' reaches beyond the image of "
                                      "{} x {}",
                                      where, channel.name, source.width_px, source.height_px));
      }
    }
    for (Picture& picture : table.pictures) {
      add_copies(picture, source);
    }
    return std::move(table);
  };

  if (!scenario) {
    add({"canned", scene::ChannelKind::injection, "canned"},
        scene::SpectralBand{"canned", 0.0, 0.0, {}}, 0);
    return finish();
  }
  const auto& bands = scenario->bands;
  if (bands.size() > kMaxPlanes || bands.size() > source.planes) {
    return make_error(ErrorCode::config, fmt::format("{}: {} bands, at most {} can be streamed",
                                                     scenario->file.string(), bands.size(),
                                                     std::min(kMaxPlanes, source.planes)));
  }
  if (scenario->channels.empty()) {
    for (std::size_t i = 0; i < bands.size(); ++i) {
      add({bands[i].name, scene::ChannelKind::injection, bands[i].name}, bands[i], i);
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
    add(wanted, *band, static_cast<std::size_t>(band - bands.begin()));
  }
  if (table.channels.empty()) {
    return make_error(ErrorCode::config, scenario->file.string() + ": no band and no channel");
  }
  return finish();
}

const Channel* find_channel(const std::vector<Channel>& channels, std::string_view name,
                            std::string_view kind, std::string_view sensor,
                            std::string_view band) noexcept {
  const auto found = std::find_if(channels.begin(), channels.end(), [&](const Channel& channel) {
    return (name.empty() || name == channel.name) &&
           (kind.empty() || kind == to_string(channel.kind)) &&
           (sensor.empty() || sensor == channel.sensor) && (band.empty() || band == channel.band);
  });
  return found != channels.end() ? &*found : nullptr;
}

ChannelSet due_channels(const std::vector<Channel>& channels, std::uint64_t frame_number) noexcept {
  ChannelSet due = 0;
  for (const Channel& channel : channels) {
    if (protocol::is_every_nth(frame_number, channel.every_nth)) {
      due |= ChannelSet{1} << channel.index;
    }
  }
  return due;
}

scene::PixelRect window_around(const std::vector<Channel>& channels, ChannelSet of) noexcept {
  scene::PixelRect all;
  for (const Channel& channel : channels) {
    if ((of >> channel.index & 1U) == 0) {
      continue;
    }
    const scene::PixelRect one{channel.window_x_px, channel.window_y_px, channel.width_px,
                               channel.height_px};
    if (all.empty()) {
      all = one;
      continue;
    }
    const std::uint32_t right_px = std::max(all.x_px + all.width_px, one.x_px + one.width_px);
    const std::uint32_t bottom_px = std::max(all.y_px + all.height_px, one.y_px + one.height_px);
    all.x_px = std::min(all.x_px, one.x_px);
    all.y_px = std::min(all.y_px, one.y_px);
    all.width_px = right_px - all.x_px;
    all.height_px = bottom_px - all.y_px;
  }
  return all;
}

std::span<const float> cut_out(Picture& picture, const renderer::FrameView& view,
                               renderer::SlotIndex slot) noexcept {
  const std::span<const float> plane = view.radiance_w_m2_sr[picture.plane];
  const scene::PixelRect& window = picture.window_px;
  const std::size_t first = std::size_t{window.y_px} * view.width_px + window.x_px;
  const std::size_t pixels = std::size_t{window.width_px} * window.height_px;
  if (picture.copies.empty()) {
    return plane.subspan(first, pixels);
  }
  std::vector<float>& copy = picture.copies[slot];
  for (std::size_t row = 0; row < window.height_px; ++row) {
    std::copy_n(plane.begin() + static_cast<std::ptrdiff_t>(first + row * view.width_px),
                window.width_px, copy.begin() + static_cast<std::ptrdiff_t>(row * window.width_px));
  }
  return copy;
}

}  // namespace emit::server
