// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "emit/physics/error.hpp"

namespace emit::protocol {

/// Reads the UDP datagrams to one port from a network capture (pcap or pcapng), in the order of the
/// file, whatever protocol they have (docs/wire.md section 6).
/// Thread: one owner.  Real time: not RT-safe.
class CaptureReader {
 public:
  /// Returns true when the file begins like a capture.
  [[nodiscard]] static bool is_capture(const std::filesystem::path& path);
  /// Opens a capture. Errors: not_found, io, parse (no capture file), unsupported (a patched
  /// format).
  [[nodiscard]] static physics::Result<CaptureReader> open(const std::filesystem::path& path,
                                                           std::uint16_t udp_port);
  CaptureReader(CaptureReader&&) noexcept;
  CaptureReader& operator=(CaptureReader&&) noexcept;
  ~CaptureReader();

  /// Moves to the next datagram. Returns false at the end. A datagram that the capture holds twice
  /// in a row is given once and counted. Errors name file and packet: parse (lengths that
  /// contradict each other), unsupported (link layer; a datagram in IP fragments or not captured
  /// whole). An error is final.
  [[nodiscard]] physics::Result<bool> next();
  /// Returns the bytes of the datagram that next() moved to. They are valid until the next call.
  [[nodiscard]] std::span<const std::byte> payload() const noexcept;
  /// Returns its instant, ns UTC; none: the capture does not say.
  [[nodiscard]] std::optional<std::int64_t> time_ns() const noexcept;
  /// Returns the number of its packet, from 1, as capture tools count.
  [[nodiscard]] std::uint64_t packet() const noexcept;

  /// Returns a text for the user about packets that were left out or are missing at the end;
  /// nothing when there are none.
  [[nodiscard]] std::optional<std::string> notes() const;

 private:
  struct Impl;
  explicit CaptureReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
