// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>

#include "emit/physics/error.hpp"
#include "tool/support/statistics.hpp"

/// What the machine moves over loopback without any service in between: the measure of what emitd
/// streams. Each call is one measurement; sender and receiver are a thread each. But
/// where said, nothing is checked, summed or put together: bytes go out and come in.
namespace emit::tool {

struct YardstickOptions {
  std::size_t frame_bytes = 0;
  std::uint64_t frames = 0;
  /// Frames that may be under way at once where the transport itself does not hold the sender back.
  std::uint32_t window = 4;
  std::uint32_t datagram_bytes = 8932;  ///< UDP
};

/// CPU time of this process, all threads, system time included.
[[nodiscard]] double process_cpu_s() noexcept;

struct YardstickResult {
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;
  double seconds = 0.0;
  double cpu_s = 0.0;  ///< of sender and receiver, system time included
};

/// send() and recv() of whole frames from and into memory as emitd has it: 16 images in turn, one
/// buffer. `sum`: a frame's CRC-32C goes before it and is compared, as emitd's and its client's is.
/// Errors: io.
[[nodiscard]] physics::Result<YardstickResult> measure_bare_tcp(const YardstickOptions& options,
                                                                bool sum);
/// sendmsg() with UDP_SEGMENT and recvmmsg() with UDP_GRO of datagrams as large and as many as
/// emitd's. Errors: io.
[[nodiscard]] physics::Result<YardstickResult> measure_bare_udp(const YardstickOptions& options);
/// From the moment a frame is ready.
struct BareDelays {
  Samples own_us;    ///< to each client's first byte given away
  Samples delay_us;  ///< to the last byte at each client
};
/// One thread that has a frame ready at a fixed rate and wakes another, which sends it to each of
/// `clients` TCP connections, whose receivers sum it: the least that any daemon with a thread for
/// sending adds on this machine, with as much else to do. Errors: io.
[[nodiscard]] physics::Result<BareDelays> measure_bare_delays(const YardstickOptions& options,
                                                              std::uint32_t clients,
                                                              double rate_hz);
/// Gbit/s of `iperf3` over loopback TCP for `seconds`. Errors: not_found (no such program), io.
[[nodiscard]] physics::Result<double> measure_iperf3_gbit_s(const std::filesystem::path& directory,
                                                            int seconds);
/// ZeroMQ PUB and SUB over loopback TCP, a context each, zero-copy messages of a frame, `window`
/// queued at most. `sum`: a frame's CRC-32C goes before it and is compared, as emitd's and its
/// client's is. Errors: unsupported (built without the library), io.
[[nodiscard]] physics::Result<YardstickResult> measure_zeromq(const YardstickOptions& options,
                                                              bool sum);
/// iceoryx publisher and subscriber: a frame is copied into a chunk that the subscriber, which
/// sleeps in between, reads in place; `window` queued at most. `sum`: with its CRC-32C, as emitd's
/// ring and its reader have it. Starts the library's daemon, until this process ends; its log goes
/// to `directory`. Errors: unsupported (built without the library, no chunks of that size, another
/// daemon runs), not_found (no daemon), io.
[[nodiscard]] physics::Result<YardstickResult> measure_iceoryx(
    const YardstickOptions& options, const std::filesystem::path& directory, bool sum);

}  // namespace emit::tool
