// SPDX-License-Identifier: Apache-2.0
#include "telemetry/ptp_status.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <concepts>

namespace emit::server {
namespace {

// Offsets of a management message: header (34 bytes), target (14), one TLV.
constexpr std::size_t kVersionAt = 1;
constexpr std::size_t kLengthAt = 2;
constexpr std::size_t kDomainAt = 4;
constexpr std::size_t kSequenceAt = 30;
constexpr std::size_t kControlAt = 32;
constexpr std::size_t kIntervalAt = 33;
constexpr std::size_t kTargetAt = 34;
constexpr std::size_t kTargetBytes = 10;
constexpr std::size_t kActionAt = 46;
constexpr std::size_t kTlvTypeAt = 48;
constexpr std::size_t kTlvLengthAt = 50;
constexpr std::size_t kIdAt = 52;
constexpr std::size_t kDataAt = 54;
static_assert(kDataAt == kPtpGetBytes);

constexpr std::uint8_t kManagement = 0x0D;
constexpr std::uint8_t kVersion2 = 0x02;
constexpr std::uint8_t kResponse = 2;
constexpr std::uint16_t kManagementTlv = 1;

constexpr std::size_t kTimeStatusBytes = 50;
constexpr std::size_t kGmPresentAt = kDataAt + 38;
constexpr std::size_t kGmIdentityAt = kDataAt + 42;
constexpr std::size_t kPortDataBytes = 26;
constexpr std::size_t kPortStateAt = kDataAt + 10;

template <std::unsigned_integral T>
void put(std::span<std::byte> out, std::size_t at, T value) noexcept {
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    out[at + i] = static_cast<std::byte>(std::uint64_t{value} >> (8 * (sizeof(T) - 1 - i)) & 0xFFU);
  }
}

template <std::unsigned_integral T>
T get(std::span<const std::byte> in, std::size_t at) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    value = value << 8U | std::to_integer<std::uint64_t>(in[at + i]);
  }
  return static_cast<T>(value);
}

}  // namespace

std::string_view to_string(PtpState state) noexcept {
  static constexpr std::array<std::string_view, 10> kNames{
      "unknown",    "initializing", "faulty",  "disabled",     "listening",
      "pre_master", "master",       "passive", "uncalibrated", "slave"};
  const auto index = static_cast<std::size_t>(state);
  return index < kNames.size() ? kNames[index] : kNames[0];
}

std::array<std::byte, kPtpGetBytes> encode_ptp_get(PtpManagementId id, std::uint8_t domain,
                                                   std::uint16_t sequence) noexcept {
  std::array<std::byte, kPtpGetBytes> out{};
  const std::span<std::byte> to(out);
  put(to, 0, kManagement);
  put(to, kVersionAt, kVersion2);
  put(to, kLengthAt, static_cast<std::uint16_t>(kPtpGetBytes));
  put(to, kDomainAt, domain);
  put(to, kSequenceAt, sequence);
  put(to, kControlAt, std::uint8_t{4});
  put(to, kIntervalAt, std::uint8_t{0x7F});
  std::ranges::fill(to.subspan(kTargetAt, kTargetBytes), std::byte{0xFF});
  put(to, kTlvTypeAt, kManagementTlv);
  put(to, kTlvLengthAt, std::uint16_t{2});
  put(to, kIdAt, static_cast<std::uint16_t>(id));
  return out;
}

PtpAnswer take_ptp_answer(std::span<const std::byte> bytes, std::uint8_t domain,
                          std::uint16_t sequence, PtpStatus& status) {
  if (bytes.size() < kDataAt || (get<std::uint8_t>(bytes, 0) & 0x0FU) != kManagement ||
      (get<std::uint8_t>(bytes, kVersionAt) & 0x0FU) != kVersion2 ||
      get<std::uint16_t>(bytes, kLengthAt) > bytes.size() ||
      get<std::uint8_t>(bytes, kDomainAt) != domain ||
      get<std::uint16_t>(bytes, kSequenceAt) != sequence ||
      (get<std::uint8_t>(bytes, kActionAt) & 0x0FU) != kResponse ||
      get<std::uint16_t>(bytes, kTlvTypeAt) != kManagementTlv) {
    return PtpAnswer::none;
  }
  // The TLV's length counts its identifier; the message's own length bounds both.
  const std::size_t tlv_bytes = get<std::uint16_t>(bytes, kTlvLengthAt);
  const std::size_t message_bytes = get<std::uint16_t>(bytes, kLengthAt);
  if (tlv_bytes < 2 || message_bytes < kIdAt + tlv_bytes) return PtpAnswer::none;
  const std::size_t data_bytes = tlv_bytes - 2;
  switch (static_cast<PtpManagementId>(get<std::uint16_t>(bytes, kIdAt))) {
    case PtpManagementId::time_status_np: {
      if (data_bytes < kTimeStatusBytes) return PtpAnswer::none;
      status.offset_ns = std::bit_cast<std::int64_t>(get<std::uint64_t>(bytes, kDataAt));
      status.grandmaster_present = get<std::uint32_t>(bytes, kGmPresentAt) != 0;
      const auto id = get<std::uint64_t>(bytes, kGmIdentityAt);
      status.grandmaster =
          fmt::format("{:06x}.{:04x}.{:06x}", id >> 40U, id >> 24U & 0xFFFFU, id & 0xFFFFFFU);
      return PtpAnswer::time_status;
    }
    case PtpManagementId::port_data_set: {
      if (data_bytes < kPortDataBytes) return PtpAnswer::none;
      const auto state = get<std::uint8_t>(bytes, kPortStateAt);
      if (state > static_cast<std::uint8_t>(PtpState::slave)) return PtpAnswer::none;
      status.state =
          static_cast<PtpState>(std::max(state, static_cast<std::uint8_t>(status.state)));
      return PtpAnswer::port_data;
    }
  }
  return PtpAnswer::none;
}

}  // namespace emit::server
