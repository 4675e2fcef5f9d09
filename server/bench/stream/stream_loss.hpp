// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "emit/client/client.hpp"
#include "emit/physics/error.hpp"
#include "emit/protocol/parity.hpp"
#include "net/fault_injector.hpp"
#include "tool/support/json.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {

/// Measurement of frames over UDP through a bad network (FaultRelay). Every pixel is compared with
/// the canned pattern. Poses are sent in step with the frames, so that no buffer of this machine
/// overflows and only the relay loses datagrams.
class LossyStream {
 public:
  struct Options {
    std::uint32_t width_px = 640;
    std::uint32_t height_px = 512;
    std::uint64_t frames = 1000;
    std::uint32_t payload_bytes = 1400;
    server::NetworkFaults faults;
    protocol::FecParams fec;
    bool resend = false;
  };
  struct Result {
    std::string device;
    std::uint64_t frames = 0;     ///< requested
    std::uint64_t whole = 0;      ///< came with every pixel and the right checksum
    std::uint64_t lost = 0;       ///< never came, not even in part
    std::uint64_t late = 0;       ///< flagged late
    std::uint64_t unflagged = 0;  ///< arrived incomplete or corrupt without a flag
    std::uint64_t wrong_px = 0;   ///< marked as valid, in frames not flagged corrupt, and wrong
    std::uint64_t corrupt = 0;    ///< flagged corrupt
    client::ReceiveCounters counters;
    server::FaultInjector::Counts network;
    std::uint64_t relay_drops = 0;  ///< losses of the measurement itself
    double seconds = 0.0;
    double cpu_s = 0.0;  ///< CPU time of the daemon
    Samples ready_to_received_ms;
  };
  /// Measures one network. Errors: those of the daemon's start; io (no frame came).
  [[nodiscard]] static physics::Result<Result> measure(const Options& options,
                                                       const std::filesystem::path& directory);
};

/// Returns the keys of a row beside the common ones.
[[nodiscard]] Json loss_json(const LossyStream::Options& options,
                             const LossyStream::Result& result);

}  // namespace emit::tool
