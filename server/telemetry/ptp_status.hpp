// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

/// PTP management messages (IEEE 1588-2019, 15; linuxptp's TIME_STATUS_NP), big endian: as much of
/// them as asks ptp4l how its clock is.
namespace emit::server {

enum class PtpState : std::uint8_t {
  unknown = 0,
  initializing = 1,
  faulty = 2,
  disabled = 3,
  listening = 4,
  pre_master = 5,
  master = 6,
  passive = 7,
  uncalibrated = 8,
  slave = 9,
};
[[nodiscard]] std::string_view to_string(PtpState state) noexcept;

/// Last answer of ptp4l.
struct PtpStatus {
  bool up = false;  ///< it answers
  PtpState state = PtpState::unknown;
  std::int64_t offset_ns = 0;        ///< from the master, as measured last
  bool grandmaster_present = false;  ///< false: its own clock is the best it knows
  std::string grandmaster;           ///< clock identity, "aabbcc.ddee.ff0011"
};

inline constexpr std::size_t kPtpGetBytes = 54;
enum class PtpManagementId : std::uint16_t { port_data_set = 0x2004, time_status_np = 0xC000 };

/// A GET to every port.
[[nodiscard]] std::array<std::byte, kPtpGetBytes> encode_ptp_get(PtpManagementId id,
                                                                 std::uint8_t domain,
                                                                 std::uint16_t sequence) noexcept;

/// Takes an answer to a GET of that domain into `status`, which stays as it is when the bytes are
/// none. Of the states of several ports the one nearest to `slave` is kept: that port steers.
/// @return which it was; empty: none of these answers.
enum class PtpAnswer : std::uint8_t { none, time_status, port_data };
[[nodiscard]] PtpAnswer take_ptp_answer(std::span<const std::byte> bytes, std::uint8_t domain,
                                        std::uint16_t sequence, PtpStatus& status);

}  // namespace emit::server
