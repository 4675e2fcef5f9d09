// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstring>
#include <random>
#include <vector>

#include "emit/protocol/fragment.hpp"
#include "emit/protocol/frame_header.hpp"

/// Frames and their fragments, for tests.
namespace emit::test {

struct Frame {
  protocol::FrameHeader header;
  std::array<std::byte, protocol::kFrameHeaderBytes> header_bytes{};
  std::vector<std::byte> pixels;
};

inline Frame make_frame(std::uint32_t width_px, std::uint32_t height_px, std::uint64_t number) {
  Frame frame;
  std::mt19937 random(static_cast<std::uint32_t>(number) + 17);
  frame.pixels.resize(std::size_t{width_px} * height_px * 4);
  for (std::size_t i = 0; i < frame.pixels.size(); i += 4) {
    const float value = 1.0F + static_cast<float>(random() % 100000u) * 1e-3F;  // never 0
    std::memcpy(&frame.pixels[i], &value, sizeof value);
  }
  frame.header.width_px = width_px;
  frame.header.height_px = height_px;
  frame.header.frame_number = number;
  frame.header.sim_time_ns = static_cast<std::int64_t>(number) * 5'000'000;
  frame.header.payload_bytes = frame.pixels.size();
  frame.header.payload_crc32c = protocol::crc32c(frame.pixels);
  protocol::encode(frame.header, frame.header_bytes);
  return frame;
}

using Datagram = std::vector<std::byte>;

/// Returns the frame's datagrams in order, each in memory of its exact size.
inline std::vector<Datagram> datagrams_of(const Frame& frame, std::uint32_t max_payload_bytes,
                                          std::uint32_t frame_id, std::uint16_t stream_id = 1) {
  const protocol::Fragmenter fragmenter({.stream_id = stream_id,
                                         .frame_id = frame_id,
                                         .sim_time_ns = frame.header.sim_time_ns,
                                         .row_bytes = frame.header.width_px * 4,
                                         .max_payload_bytes = max_payload_bytes},
                                        frame.header_bytes, frame.pixels);
  std::vector<Datagram> datagrams;
  for (std::uint32_t i = 0; i < fragmenter.fragment_count(); ++i) {
    std::array<std::byte, protocol::kFragmentHeaderBytes> memory{};
    const auto pieces = fragmenter.pieces(i, memory);
    Datagram datagram;
    for (std::uint32_t k = 0; k < pieces.count; ++k) {
      datagram.insert(datagram.end(), pieces.piece[k].begin(), pieces.piece[k].end());
    }
    datagrams.push_back(std::move(datagram));
  }
  return datagrams;
}

}  // namespace emit::test
