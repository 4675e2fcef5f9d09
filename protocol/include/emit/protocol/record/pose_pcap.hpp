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

/// UDP port of host datagrams, unless the daemon's configuration names another one.
inline constexpr std::uint16_t kDefaultHostPort = 7001;

/// Reads host frames from a network capture (pcap or pcapng): the UDP datagrams to one port, in the
/// order of the file (docs/wire.md section 6).
/// Thread: one owner.  Real time: not RT-safe.
class PosePcapReader {
 public:
  /// Returns true when the file begins like a capture.
  [[nodiscard]] static bool is_capture(const std::filesystem::path& path);
  /// Opens a capture. Errors: not_found, io, parse (no capture file), unsupported (a patched
  /// format).
  [[nodiscard]] static physics::Result<PosePcapReader> open(const std::filesystem::path& path,
                                                            std::uint16_t udp_port);
  PosePcapReader(PosePcapReader&&) noexcept;
  PosePcapReader& operator=(PosePcapReader&&) noexcept;
  ~PosePcapReader();

  /// Moves to the next host frame. Returns false at the end. Datagrams that are no host frames, and
  /// those that the capture holds twice in a row, are skipped and counted. Errors name file and
  /// packet: parse (lengths that contradict each other), unsupported (link layer; a datagram in IP
  /// fragments or not captured whole). An error is final.
  [[nodiscard]] physics::Result<bool> next();
  /// Returns the host frame that next() moved to.
  [[nodiscard]] const HostFrameData& host() const noexcept;

  /// Returns a text for the user about datagrams that were skipped or are missing at the end;
  /// nothing when there are none.
  [[nodiscard]] std::optional<std::string> notes() const;

 private:
  struct Impl;
  explicit PosePcapReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
