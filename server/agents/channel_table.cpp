// SPDX-License-Identifier: Apache-2.0
#include "agents/channel_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emit/protocol/frame_header.hpp"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;

std::string_view to_string(scene::ChannelKind kind) noexcept {
  return kind == scene::ChannelKind::projector ? "projector" : "injection";
}

namespace {

/// Takes the memory of an image whose pixels are not used where they lie in the source's memory.
void add_copies(Picture& picture, const SourceInfo& source) {
  if (picture.chain || picture.window_px.width_px != source.width_px) {
    picture.copies.assign(source.slots, std::vector<float>(picture.pixels()));
  }
}

/// Returns the focal length of a camera's image, px; 0 without a scenario.
double focal_px_of(const std::optional<scene::ScenarioDesc>& scenario, const Camera& camera) {
  if (!scenario) return 0.0;
  const double fov_h_rad =
      camera.mount.fov_h_rad > 0.0 ? camera.mount.fov_h_rad : scenario->sensor.fov_h_rad;
  if (fov_h_rad <= 0.0) return 0.0;
  return 0.5 * scenario->sensor.width_px / std::tan(0.5 * fov_h_rad);
}

/// Makes the output of an image, where it has one, and its size.
physics::Result<void> make_output(Picture& picture, const protocol::ImageSize& image,
                                  double focal_px, const std::optional<scene::SpectralBand>& band) {
  picture.size = {picture.window_px.width_px, picture.window_px.height_px};
  if (picture.output == scene::ChannelOutput{}) return {};
  auto chain = OutputChain::make(picture.output, {image, picture.window_px, focal_px, band});
  if (!chain) return tl::unexpected(std::move(chain.error()));
  picture.chain = std::move(*chain);
  picture.size = picture.chain->frame();
  return {};
}

bool fits(const scene::PixelRect& window, const SourceInfo& source) noexcept {
  return window.x_px < source.width_px && window.y_px < source.height_px &&
         window.width_px <= source.width_px - window.x_px &&
         window.height_px <= source.height_px - window.y_px;
}

}  // namespace

std::vector<Camera> cameras_of(const std::optional<scene::ScenarioDesc>& scenario, bool motion) {
  std::vector<Camera> cameras;
  const std::size_t count = scenario ? scenario->channels.size() : 0;
  for (std::size_t i = 0; i < count; ++i) {
    const scene::ChannelDesc& channel = scenario->channels[i];
    const bool along = motion && channel.kind == scene::ChannelKind::projector;
    auto found = std::ranges::find_if(cameras, [&](const Camera& camera) {
      return camera.along_projector == along && camera.mount == channel.camera;
    });
    if (found == cameras.end()) {
      found = cameras.insert(found, Camera{channel.camera, along, 0});
    }
    found->channels |= ChannelSet{1} << (i % kMaxChannels);
  }
  if (cameras.empty()) cameras.emplace_back();
  // Images of the frame's own instant must not show entities where they are foreseen.
  std::ranges::stable_partition(cameras,
                                [](const Camera& camera) { return !camera.looks_ahead(); });
  return cameras;
}

bool is_view_fixed(const std::vector<Camera>& cameras) noexcept {
  return std::ranges::any_of(cameras, [](const Camera& camera) {
    return camera.along_projector && camera.mount.fov_h_rad == 0.0;
  });
}

physics::Result<ChannelTable> make_channels(const std::optional<scene::ScenarioDesc>& scenario,
                                            const SourceInfo& source, bool motion) {
  ChannelTable table;
  // Images that are stored already have no camera.
  table.cameras = source.canned ? std::vector<Camera>(1) : cameras_of(scenario, motion);
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
    channel.response.clear();
    for (const physics::ResponsePoint& point : scene::spectral_band(band).response) {
      channel.response.push_back({point.wavelength_um, point.response_frac});
    }
    channel.window_px = window;
    channel.sensor_width_px = source.width_px;
    channel.sensor_height_px = source.height_px;
    channel.every_nth = wanted.every_nth;
    channel.look_ahead_frames = source.canned ? 0 : wanted.camera.look_ahead_frames;
    const auto camera = std::ranges::find_if(table.cameras, [&](const Camera& one) {
      return (one.channels >> (channel.index % kMaxChannels) & 1U) != 0;
    });
    channel.camera = static_cast<std::size_t>(camera - table.cameras.begin());
    auto picture =
        std::find_if(table.pictures.begin(), table.pictures.end(), [&](const Picture& other) {
          return other.camera == channel.camera && other.plane == plane &&
                 other.window_px == window && other.output == wanted.output;
        });
    if (picture == table.pictures.end()) {
      Picture made;
      made.camera = channel.camera;
      made.plane = plane;
      made.window_px = window;
      made.output = wanted.output;
      picture = table.pictures.insert(picture, std::move(made));
    }
    picture->channels |= ChannelSet{1} << (channel.index % kMaxChannels);
    channel.picture = static_cast<std::size_t>(picture - table.pictures.begin());
    table.channels.push_back(std::move(channel));
  };
  const auto finish = [&]() -> physics::Result<ChannelTable> {
    const std::string where = scenario ? scenario->file.string() : std::string("source");
    if (table.channels.size() > kMaxChannels || table.pictures.size() > kMaxPictures) {
      return make_error(ErrorCode::config,
                        fmt::format("{}: {} channels of {} bands, windows and outputs, at most {} "
                                    "of {} can be streamed",
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
    if (table.cameras.size() > kMaxCameras) {
      return make_error(ErrorCode::config,
                        fmt::format("{}: the channels have {} cameras (fields of view, places and "
                                    "directions), at most {} can be rendered",
                                    where, table.cameras.size(), kMaxCameras));
    }
    for (Channel& channel : table.channels) {
      Picture& picture = table.pictures[channel.picture];
      if (picture.pixels() == 0) {
        const double focal_px = focal_px_of(scenario, table.cameras[picture.camera]);
        std::optional<scene::SpectralBand> band;
        if (scenario) band = scenario->bands[picture.plane];
        if (auto made = make_output(picture, {source.width_px, source.height_px}, focal_px, band);
            !made) {
          return tl::unexpected(
              std::move(made.error())
                  .with_context(fmt::format("{}: channel '{}'", where, channel.name)));
        }
        add_copies(picture, source);
      }
      channel.width_px = picture.size.width_px;
      channel.height_px = picture.size.height_px;
      channel.source_px = picture.chain ? picture.chain->source_px() : picture.window_px;
      if (picture.chain) channel.quantity = picture.chain->quantity();
      channel.output_steps = picture.chain ? picture.chain->steps() : std::uint16_t{0};
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
    const scene::PixelRect& one = channel.source_px;
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

physics::Result<void> check_outputs(const scene::ScenarioDesc& scenario) {
  SourceInfo source;
  source.width_px = scenario.sensor.width_px;
  source.height_px = scenario.sensor.height_px;
  source.planes = scenario.bands.size();
  const auto table = make_channels(scenario, source);
  if (!table) return tl::unexpected(table.error());
  return {};
}

TakenPicture take_picture(Picture& picture, const renderer::FrameView& view,
                          renderer::SlotIndex slot, const OutputChain::Moment& moment) noexcept {
  const std::span<const float> plane = view.radiance_w_m2_sr[picture.plane];
  if (picture.chain) {
    std::vector<float>& made = picture.copies[slot];
    const std::uint32_t clamped_px = picture.chain->apply(plane, moment, made);
    return {made, clamped_px, picture.chain->cuts(moment)};
  }
  const scene::PixelRect& window = picture.window_px;
  const std::size_t first = std::size_t{window.y_px} * view.width_px + window.x_px;
  const std::size_t pixels = std::size_t{window.width_px} * window.height_px;
  if (picture.copies.empty()) {
    return {plane.subspan(first, pixels)};
  }
  std::vector<float>& copy = picture.copies[slot];
  for (std::size_t row = 0; row < window.height_px; ++row) {
    std::copy_n(plane.begin() + static_cast<std::ptrdiff_t>(first + row * view.width_px),
                window.width_px, copy.begin() + static_cast<std::ptrdiff_t>(row * window.width_px));
  }
  return {copy};
}

physics::Result<void> check_look_ahead(const scene::ScenarioDesc& scenario,
                                       const config::DaemonConfig& config) {
  const auto ahead = std::ranges::find_if(scenario.channels, [](const scene::ChannelDesc& channel) {
    return channel.camera.look_ahead_frames > 0;
  });
  if (ahead == scenario.channels.end()) {
    return {};
  }
  const auto refuse = [&](const std::string& why) {
    return make_error(ErrorCode::config,
                      fmt::format("{}: channel '{}' of the scenario has 'look_ahead_frames', {}",
                                  config.file.string(), ahead->name, why));
  };
  const config::PacingConfig& pacing = config.pacing;
  if (pacing.mode == config::PacingMode::host_step) {
    return refuse("which needs pacing.mode = \"ig-clock\" or \"trigger\"");
  }
  const double ahead_ms = 1e3 * ahead->camera.look_ahead_frames / pacing.rate_hz;
  const double needed_ms = ahead_ms + static_cast<double>(pacing.display_delay_ns) * 1e-6;
  if (static_cast<double>(pacing.horizon_ns) * 1e-6 < needed_ms) {
    return refuse(
        fmt::format("which needs pacing.horizon_ms of at least {:g}: {:g} ms to the "
                    "display and {:g} ms ahead",
                    needed_ms, needed_ms - ahead_ms, ahead_ms));
  }
  return {};
}

}  // namespace emit::server
