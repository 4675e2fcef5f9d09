// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>

#include "keys.hpp"

/// Keys of a scenario's channels.
namespace emit::config {

using scene::ChannelDesc;
using scene::ChannelKind;

namespace {

void read_window(ChannelDesc& out, const Node& node, Diagnostics& diagnostics) {
  std::array<std::int64_t, 4> values{};
  if (node.kind != Node::Kind::array || node.items.size() != values.size()) {
    diagnostics.add(node.at, "'window_px' must be an array of 4 integers: x, y, width, height");
    return;
  }
  const std::size_t faults = diagnostics.size();
  for (std::size_t i = 0; i < values.size(); ++i) {
    read_integer(node.items[i], "window_px", i < 2 ? 0 : 1, limits::kSensorPx.hi, values[i],
                 diagnostics);
  }
  if (diagnostics.size() == faults) {
    out.window_px = {static_cast<std::uint32_t>(values[0]), static_cast<std::uint32_t>(values[1]),
                     static_cast<std::uint32_t>(values[2]), static_cast<std::uint32_t>(values[3])};
  }
}

}  // namespace

const KeyTable<ChannelDesc>& channel_keys() {
  static const KeyTable<ChannelDesc> keys = {
      required(text<ChannelDesc>("name", EMIT_FIELD(name), "Name that a client subscribes to.")),
      choice<ChannelDesc>(
          "kind",
          std::vector<std::pair<std::string, ChannelKind>>{{"injection", ChannelKind::injection},
                                                           {"projector", ChannelKind::projector}},
          EMIT_FIELD(kind), "Device that the channel feeds."),
      required(text<ChannelDesc>("band", EMIT_FIELD(band),
                                 "Spectral band: `3-5`, `3.4-4.1`, `8-12`, `7.7-9.3` (um, perfect "
                                 "rectangles) or one of `[[band]]`.")),
      custom<ChannelDesc>({"window_px", "array of 4 integers", "px", "within the sensor's image",
                           "Window of the sensor's image: `[x, y, width, height]` from the top "
                           "left. Frames hold only these pixels. Without it they hold all.",
                           false},
                          read_window,
                          [](const ChannelDesc& in) -> std::optional<std::string> {
                            if (in.window_px.empty()) {
                              return std::nullopt;
                            }
                            return fmt::format("[{}, {}, {}, {}]", in.window_px.x_px,
                                               in.window_px.y_px, in.window_px.width_px,
                                               in.window_px.height_px);
                          }),
      written_if<ChannelDesc>(
          [](const ChannelDesc& in) { return in.every_nth != 1; },
          integer<ChannelDesc>("every_nth", "", 1, limits::kMaxEveryNth, EMIT_FIELD(every_nth),
                               "The channel shows frames 1, 1 + n, 1 + 2 n and so on of every run. "
                               "At least one channel shows all.")),
  };
  return keys;
}

}  // namespace emit::config
