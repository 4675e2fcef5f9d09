// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "agents/messages.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/output_geometry.hpp"
#include "emit/scene/scene_desc.hpp"
#include "output/output_chain.hpp"

namespace emit::server {

/// A channel that clients subscribe to, with the image that it shows.
struct Channel {
  std::uint16_t index = 0;
  std::string name;
  scene::ChannelKind kind = scene::ChannelKind::injection;
  std::string sensor;
  std::string band;
  double band_lo_um = 0.0;
  double band_hi_um = 0.0;
  std::vector<scene::ResponseSample> response;  ///< response of the band; empty: a rectangle
  std::uint32_t width_px = 0;                   ///< width of its frames
  std::uint32_t height_px = 0;
  scene::PixelRect window_px;      ///< part of the sensor's image that its frames show
  scene::PixelRect source_px;      ///< part that they are made of: the window and what is around it
  std::uint16_t output_steps = 0;  ///< protocol::OutputSteps
  protocol::PixelQuantity quantity = protocol::PixelQuantity::radiance_w_m2_sr;
  std::uint32_t sensor_width_px = 0;
  std::uint32_t sensor_height_px = 0;
  std::uint32_t every_nth = 1;          ///< shows frames 1, 1 + n, 1 + 2 n, ... of every run
  std::uint32_t look_ahead_frames = 0;  ///< its frames show the instant of later ones
  std::size_t picture = 0;              ///< index into Image::pictures
  std::size_t camera = 0;               ///< index into ChannelTable::cameras
};

/// A camera renders the images of channels that look alike. The cameras of a frame show one scene
/// at one instant, each in an image of its own; those that look ahead share a later instant.
struct Camera {
  scene::ChannelCamera mount;
  bool along_projector = false;  ///< it looks along the projector of a motion simulator
  [[nodiscard]] bool looks_ahead() const noexcept { return mount.look_ahead_frames > 0; }
  ChannelSet channels = kAllChannels;
};

/// Pixels that channels of one camera, band, window and output share.
struct Picture {
  std::size_t camera = 0;                  ///< index into ChannelTable::cameras
  std::size_t plane = 0;                   ///< index into FrameView::radiance_w_m2_sr
  scene::PixelRect window_px;              ///< part of the sensor's image
  scene::ChannelOutput output;             ///< settings of the chain
  ChannelSet channels = 0;                 ///< channels that show it
  protocol::ImageSize size;                ///< size of the frames
  std::optional<OutputChain> chain;        ///< empty: the pixels of the window as they are
  std::vector<std::vector<float>> copies;  ///< by slot; empty where the rows lie in one piece

  [[nodiscard]] std::size_t pixels() const noexcept {
    return std::size_t{size.width_px} * size.height_px;
  }
  /// Returns whether the shift of a motion simulator moves it.
  [[nodiscard]] bool shifts() const noexcept { return output.apply_shift; }
};

struct ChannelTable {
  std::vector<Channel> channels;
  std::vector<Picture> pictures;
  std::vector<Camera> cameras;
};

[[nodiscard]] std::string_view to_string(scene::ChannelKind kind) noexcept;

/// Returns the cameras of a scenario's channels, in the order of their first channels, with those
/// that look ahead behind all others. Without channels it is one.
/// @param motion  with a motion simulator projector channels have a camera of their own
[[nodiscard]] std::vector<Camera> cameras_of(const std::optional<scene::ScenarioDesc>& scenario,
                                             bool motion);

/// Returns true where hosts cannot set the field of view: the optics of a projector do not zoom.
[[nodiscard]] bool is_view_fixed(const std::vector<Camera>& cameras) noexcept;

/// Channels of a scenario, or the one channel of canned frames without a scenario, with all memory
/// that their images take. The sensor's size is the source's. A scenario without channels gets an
/// injection channel per band.
/// Errors (config): the scenario lacks the band of a channel, a window does not fit the image, or
/// there are more bands, channels or images than fit. Errors of OutputChain::make() name the
/// channel.
[[nodiscard]] physics::Result<ChannelTable> make_channels(
    const std::optional<scene::ScenarioDesc>& scenario, const SourceInfo& source,
    bool motion = false);

/// Returns the first channel that fits; empty fields fit anything; nullptr: none.
[[nodiscard]] const Channel* find_channel(const std::vector<Channel>& channels,
                                          std::string_view name, std::string_view kind,
                                          std::string_view sensor, std::string_view band) noexcept;

/// Returns the channels that show the frame of that number. RT-safe.
[[nodiscard]] ChannelSet due_channels(const std::vector<Channel>& channels,
                                      std::uint64_t frame_number) noexcept;

/// Loads the files that the outputs of a scenario's channels name, for its sensor, and lets go of
/// them. So a fault shows before a scene is warmed up. Errors: those of make_channels().
[[nodiscard]] physics::Result<void> check_outputs(const scene::ScenarioDesc& scenario);

/// Refuses channels that look ahead where no next frame is known or poses are not predicted that
/// far. Errors (config): the text names the daemon's file and the channel.
[[nodiscard]] physics::Result<void> check_look_ahead(const scene::ScenarioDesc& scenario,
                                                     const config::DaemonConfig& config);

/// Returns the smallest part of the image that some channels are made of. RT-safe.
[[nodiscard]] scene::PixelRect window_around(const std::vector<Channel>& channels,
                                             ChannelSet of) noexcept;

/// The pixels of an image, row by row.
struct TakenPicture {
  std::span<const float> pixels;
  std::uint32_t clamped_px = 0;  ///< by its output
  bool cut = false;              ///< its shift is larger than the room around its window
};
/// Returns the pixels of an image. They lie in the source's memory where they are in one piece
/// there and nothing is done to them; else they are written to the image's memory for `slot`.
/// `moment` has the shift of the pictures that shift, and the number that noise depends on.
/// RT-safe.
[[nodiscard]] TakenPicture take_picture(Picture& picture, const renderer::FrameView& view,
                                        renderer::SlotIndex slot,
                                        const OutputChain::Moment& moment) noexcept;

}  // namespace emit::server
