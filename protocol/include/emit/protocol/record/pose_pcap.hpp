// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "emit/physics/error.hpp"
#include "emit/protocol/host_frame.hpp"

namespace emit::protocol {

/// Port of host datagrams unless the daemon's configuration says otherwise.
inline constexpr std::uint16_t kDefaultHostPort = 7001;

/// Host frames from a network capture (pcap or pcapng): the UDP datagrams to one port, in the order
/// of the file (docs/wire.md, section 6).
/// Thread: one owner.  Not RT-safe.
class PosePcapReader {
 public:
  /// True when the file starts like a capture.
  [[nodiscard]] static bool is_capture(const std::filesystem::path& path);
  /// Errors: not_found, io, parse (no capture file), unsupported (a patched format).
  [[nodiscard]] static physics::Result<PosePcapReader> open(const std::filesystem::path& path,
                                                            std::uint16_t udp_port);
  PosePcapReader(PosePcapReader&&) noexcept;
  PosePcapReader& operator=(PosePcapReader&&) noexcept;
  ~PosePcapReader();

  /// Moves to the next host frame; false at the end. Datagrams that are no host frames, and those
  /// that the capture holds twice in a row, are passed over and counted. Errors name file and
  /// packet: parse (lengths that contradict), unsupported (link layer; a datagram in IP fragments
  /// or not captured whole). An error is final.
  [[nodiscard]] physics::Result<bool> next();
  [[nodiscard]] const HostFrameData& host() const noexcept;

  /// What was passed over or is missing at the end, for the user; absent when nothing was.
  [[nodiscard]] std::optional<std::string> notes() const;

 private:
  struct Impl;
  explicit PosePcapReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
