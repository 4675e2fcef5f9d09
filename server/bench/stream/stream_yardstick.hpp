// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>

#include "emit/physics/error.hpp"
#include "tool/support/statistics.hpp"

/// Throughput of the machine over loopback without any service in between, to compare emitd's
/// streams with. Each call is one measurement; sender and receiver have a thread each. Unless a
/// function states otherwise, nothing is checked, summed or assembled: bytes are sent and received.
namespace emit::tool {

struct YardstickOptions {
  std::size_t frame_bytes = 0;
  std::uint64_t frames = 0;
  /// Number of frames that may be under way at once where the transport itself does not limit the
  /// sender.
  std::uint32_t window = 4;
  std::uint32_t datagram_bytes = 8932;  ///< UDP
};

/// Returns the CPU time of this process, all threads, system time included.
[[nodiscard]] double process_cpu_s() noexcept;

struct YardstickResult {
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;
  double seconds = 0.0;
  double cpu_s = 0.0;  ///< of sender and receiver, system time included
};

/// Measures send() and recv() of whole frames from and into memory as emitd has it: 16 images in
/// turn, one buffer. With `sum` a frame's CRC-32C goes before it and is compared, as emitd and its
/// client do. Errors: io.
[[nodiscard]] physics::Result<YardstickResult> measure_bare_tcp(const YardstickOptions& options,
                                                                bool sum);
/// Measures sendmsg() with UDP_SEGMENT and recvmmsg() with UDP_GRO of datagrams as large and as
/// many as emitd's. Errors: io.
[[nodiscard]] physics::Result<YardstickResult> measure_bare_udp(const YardstickOptions& options);
/// Delays from the moment a frame is ready.
struct BareDelays {
  Samples own_us;    ///< to each client's first byte given away
  Samples delay_us;  ///< to the last byte at each client
};
/// Measures one thread that has a frame ready at a fixed rate and wakes another, which sends it to
/// each of `clients` TCP connections, whose receivers sum it. This is the smallest delay of any
/// daemon with a thread for sending on this machine, with equal other work. Errors: io.
[[nodiscard]] physics::Result<BareDelays> measure_bare_delays(const YardstickOptions& options,
                                                              std::uint32_t clients,
                                                              double rate_hz);
/// Measures Gbit/s of `iperf3` over loopback TCP for `seconds`. Errors: not_found (no such
/// program), io.
[[nodiscard]] physics::Result<double> measure_iperf3_gbit_s(const std::filesystem::path& directory,
                                                            int seconds);
/// Measures ZeroMQ PUB and SUB over loopback TCP with a context each, zero-copy messages of a
/// frame, and at most `window` queued. With `sum` a frame's CRC-32C goes before it and is compared,
/// as emitd and its client do. Errors: unsupported (built without the library), io.
[[nodiscard]] physics::Result<YardstickResult> measure_zeromq(const YardstickOptions& options,
                                                              bool sum);
/// Measures an iceoryx publisher and subscriber. A frame is copied into a chunk. The subscriber,
/// which sleeps in between, reads it in place; at most `window` are queued. With `sum` a frame has
/// its CRC-32C, as emitd's ring and its reader have it. The library's daemon is started and runs
/// until this process ends; its log goes to `directory`. Errors: unsupported (built without the
/// library, no chunks of that size, another daemon runs), not_found (no daemon), io.
[[nodiscard]] physics::Result<YardstickResult> measure_iceoryx(
    const YardstickOptions& options, const std::filesystem::path& directory, bool sum);

}  // namespace emit::tool
