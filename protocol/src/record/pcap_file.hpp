// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::protocol {

/// One packet of a capture file.
struct CapturedPacket {
  std::uint64_t number = 0;             ///< number of the packet from 1, as capture tools count
  std::uint32_t link_type = 0;          ///< LINKTYPE_ value of the tcpdump group's registry
  std::optional<std::int64_t> time_ns;  ///< UTC; absent in a simple packet block
  std::uint64_t wire_bytes = 0;  ///< length of the packet on the network, before the capture cut it
  std::span<const std::byte> data;  ///< valid until the next call of next()
};

/// Reads the packets of a capture file: classic pcap (micro- and nanoseconds) and pcapng, in either
/// byte order. It checks every length before use. Errors name file and offset.
/// Thread: one owner.  Real time: not RT-safe.
class PcapFile {
 public:
  /// Returns true when the first four bytes are those of a capture.
  [[nodiscard]] static bool is_capture(const std::filesystem::path& path);
  /// Opens a capture. Errors: not_found, io, parse (no capture file), unsupported (a patched
  /// format).
  [[nodiscard]] static physics::Result<PcapFile> open(const std::filesystem::path& path);

  /// Moves to the next packet. Returns false at the end. An error is final.
  [[nodiscard]] physics::Result<bool> next();
  /// Returns the packet that next() moved to.
  [[nodiscard]] const CapturedPacket& packet() const noexcept { return packet_; }
  /// Returns a description of the missing part at the end of a file that ends within a packet or
  /// block.
  [[nodiscard]] const std::optional<std::string>& truncation() const noexcept {
    return truncation_;
  }

 private:
  struct Interface {
    std::uint32_t link_type = 0;
    std::uint64_t ticks_per_s = 1'000'000;
    std::int64_t offset_s = 0;
  };

  tl::unexpected<physics::Error> fail(physics::ErrorCode code, std::string_view text);
  /// Reads `bytes` bytes into `out`. Returns false at the end of the file; a part of `bytes` then
  /// counts as truncation.
  bool read(std::size_t bytes, std::vector<std::byte>& out, std::string_view what);
  [[nodiscard]] std::uint16_t u16(std::size_t at) const noexcept;
  [[nodiscard]] std::uint32_t u32(std::size_t at) const noexcept;
  [[nodiscard]] std::uint64_t u64(std::size_t at) const noexcept;

  physics::Result<void> read_classic_header();
  physics::Result<bool> next_classic();
  physics::Result<bool> next_block();
  physics::Result<void> take_section();
  physics::Result<void> take_interface();
  physics::Result<bool> take_packet_block(std::uint32_t type);
  physics::Result<void> set_time(const Interface& interface, std::uint64_t ticks);

  std::filesystem::path path_;
  std::ifstream file_;
  std::uint64_t offset_ = 0;  ///< offset of the record or block in work
  std::uint64_t next_offset_ = 0;
  bool next_generation_ = false;
  bool big_endian_ = false;
  bool nanoseconds_ = false;
  std::uint32_t link_type_ = 0;
  std::vector<Interface> interfaces_;
  std::vector<std::byte> head_;
  std::vector<std::byte> body_;
  std::span<const std::byte> view_;  ///< bytes that u16() and u32() read from
  CapturedPacket packet_;
  std::optional<physics::Error> failure_;
  std::optional<std::string> truncation_;
  bool ended_ = false;
};

}  // namespace emit::protocol
