// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>

#include "emit/config/daemon_config.hpp"
#include "emit/protocol/ip_address.hpp"
#include "rt/token_bucket.hpp"

namespace emit::server {

/// Rate limits of the peers, per second. A peer is an address, with all its connections and
/// datagrams. On this host, where all programs share an address, it is one connection or socket.
/// The kPeers peers that were heard last are remembered. Thread: one owner. Real time: RT-safe.
class PeerLimits {
 public:
  static constexpr std::size_t kPeers = 64;

  explicit PeerLimits(const config::AccessConfig& access) noexcept : access_(access) {}

  /// Returns false when the peer is over its rate. `now_ns` is monotonic.
  [[nodiscard]] bool take_host_frame(const protocol::IpAddress& peer, std::uint16_t port,
                                     std::int64_t now_ns) noexcept {
    return find(peer, port, now_ns).host_frames.take(now_ns);
  }
  [[nodiscard]] bool take_control_record(const protocol::IpAddress& peer, std::uint16_t port,
                                         std::int64_t now_ns) noexcept {
    return find(peer, port, now_ns).control_records.take(now_ns);
  }

 private:
  struct Entry {
    protocol::IpAddress peer;
    std::uint16_t port = 0;  ///< on this host, else 0
    std::int64_t heard_ns = INT64_MIN;
    TokenBucket host_frames;
    TokenBucket control_records;
  };

  Entry& find(const protocol::IpAddress& peer, std::uint16_t source_port,
              std::int64_t now_ns) noexcept {
    const std::uint16_t port = peer.is_loopback() ? source_port : std::uint16_t{0};
    const auto is_peer = [&](const Entry& entry) {
      return entry.heard_ns != INT64_MIN && entry.peer == peer && entry.port == port;
    };
    Entry* found = &entries_[last_];
    if (!is_peer(*found)) {
      found = std::find_if(entries_.begin(), entries_.end(), is_peer);
    }
    if (found == entries_.end()) {
      found =
          std::min_element(entries_.begin(), entries_.end(),
                           [](const Entry& a, const Entry& b) { return a.heard_ns < b.heard_ns; });
      *found = {peer, port, now_ns, TokenBucket(access_.max_host_frames_hz),
                TokenBucket(access_.max_control_records_hz)};
    }
    found->heard_ns = now_ns;
    last_ = static_cast<std::size_t>(found - entries_.begin());
    return *found;
  }

  const config::AccessConfig& access_;
  std::array<Entry, kPeers> entries_;
  std::size_t last_ = 0;
};

}  // namespace emit::server
