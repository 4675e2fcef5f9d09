// SPDX-License-Identifier: Apache-2.0
#include "console/console_message.hpp"

#include <bit>
#include <cstring>

namespace emit::server {
namespace {

static_assert(std::endian::native == std::endian::little, "messages are written as they lie");

template <class T>
void put(std::array<std::byte, kConsoleHeaderBytes>& out, std::size_t at, T value) noexcept {
  std::memcpy(out.data() + at, &value, sizeof(value));
}

}  // namespace

std::array<std::byte, kConsoleHeaderBytes> console_header(const protocol::FrameHeader& header,
                                                          std::uint64_t sequence) noexcept {
  std::array<std::byte, kConsoleHeaderBytes> out{};
  put(out, 0, kConsoleMagic);
  put(out, 4, kConsoleVersion);
  put(out, 6, static_cast<std::uint16_t>(kConsoleHeaderBytes));
  put(out, 8, sequence);
  put(out, 16, header.run_id);
  put(out, 24, header.frame_number);
  put(out, 32, header.host_frame_number);
  put(out, 40, header.sim_time_ns);
  put(out, 48, header.width_px);
  put(out, 52, header.height_px);
  put(out, 56, header.channel_index);
  put(out, 58, static_cast<std::uint8_t>(header.quantity));
  put(out, 59, header.quality_rung);
  put(out, 60, header.flags);
  put(out, 64, header.band_lo_um);
  put(out, 68, header.band_hi_um);
  put(out, 72, header.estimated_error_k);
  put(out, 76, header.nonfinite_px);
  put(out, 80, header.clamped_px);
  put(out, 84, static_cast<std::uint8_t>(header.motion_state));
  put(out, 85, header.motion_faults);
  put(out, 86, header.output_steps);
  put(out, 88, header.shift_x_px);
  put(out, 92, header.shift_y_px);
  put(out, 96, header.pointing_error_px);
  put(out, 100, header.fov_h_rad);
  put(out, 104, header.payload_crc32c);
  put(out, 112, header.readback_end_ns);
  return out;
}

std::string json_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else {
      const auto byte = static_cast<unsigned char>(c);
      out += byte < 0x20 || byte >= 0x7F ? '?' : c;
    }
  }
  out += '"';
  return out;
}

}  // namespace emit::server
