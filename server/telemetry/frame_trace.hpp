// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "emit/protocol/frame_header.hpp"

namespace emit::server {

/// Stage instants of the frames sent last, one entry per frame and client, for /trace. One writer
/// (the sender), any reader; an entry that is being replaced is left out by readers.
/// Real time: add() is RT-safe.
class FrameTrace {
 public:
  static constexpr std::size_t kEntries = 1024;

  struct Entry {
    std::uint64_t run_id = 0;
    std::uint64_t frame_number = 0;
    std::uint64_t host_frame_number = 0;
    std::uint64_t client = 0;  ///< key of the connection; kSharedMemory: the ring of stream.shm
    std::uint64_t flags = 0;   ///< protocol::FrameFlags
    // Wall instants, ns; 0 = did not happen.
    std::int64_t host_received_ns = 0;
    std::int64_t slot_begin_ns = 0;
    std::int64_t render_start_ns = 0;
    std::int64_t render_end_ns = 0;
    std::int64_t readback_end_ns = 0;
    std::int64_t send_start_ns = 0;
    std::int64_t last_byte_ns = 0;
  };
  static constexpr std::uint64_t kSharedMemory = ~std::uint64_t{0};

  void add(const protocol::FrameHeader& header, std::uint64_t client,
           std::int64_t last_byte_ns) noexcept;

  /// Oldest first. Allocates.
  [[nodiscard]] std::vector<Entry> entries() const;

 private:
  static constexpr std::size_t kWords = sizeof(Entry) / sizeof(std::uint64_t);
  static_assert(kWords * sizeof(std::uint64_t) == sizeof(Entry));
  struct Place {
    std::atomic<std::uint64_t> sequence{0};  ///< 2 n + 1 while entry n is written, 2 n + 2 after
    std::array<std::atomic<std::uint64_t>, kWords> words{};
  };
  std::array<Place, kEntries> places_{};
  std::atomic<std::uint64_t> added_{0};
};

/// The entries in Chrome's trace event format (JSON object format, times in microseconds), for
/// Perfetto and chrome://tracing: one track for what is done once per frame, one per client for
/// sending. Events of a track either follow one another or nest.
[[nodiscard]] std::string chrome_trace(const std::vector<FrameTrace::Entry>& entries);

}  // namespace emit::server
