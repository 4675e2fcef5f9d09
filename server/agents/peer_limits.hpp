// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>

#include "emit/config/daemon_config.hpp"
#include "emit/config/network.hpp"
#include "rt/token_bucket.hpp"

namespace emit::server {

/// What one address may send in a second, over all its connections and datagrams. Remembers the
/// kPeers addresses heard last. Thread: one owner. Real time: RT-safe.
class PeerLimits {
 public:
  static constexpr std::size_t kPeers = 64;

  explicit PeerLimits(const config::AccessConfig& access) noexcept : access_(access) {}

  /// `now_ns`: monotonic.
  [[nodiscard]] bool take_host_frame(const config::IpAddress& peer, std::int64_t now_ns) noexcept {
    return find(peer, now_ns).host_frames.take(now_ns);
  }
  [[nodiscard]] bool take_control_record(const config::IpAddress& peer,
                                         std::int64_t now_ns) noexcept {
    return find(peer, now_ns).control_records.take(now_ns);
  }

 private:
  struct Entry {
    config::IpAddress peer;
    std::int64_t heard_ns = INT64_MIN;
    TokenBucket host_frames;
    TokenBucket control_records;
  };

  Entry& find(const config::IpAddress& peer, std::int64_t now_ns) noexcept {
    Entry* found = &entries_[last_];
    if (found->heard_ns == INT64_MIN || found->peer != peer) {
      found = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& entry) {
        return entry.heard_ns != INT64_MIN && entry.peer == peer;
      });
    }
    if (found == entries_.end()) {
      found =
          std::min_element(entries_.begin(), entries_.end(),
                           [](const Entry& a, const Entry& b) { return a.heard_ns < b.heard_ns; });
      *found = {peer, now_ns, TokenBucket(access_.max_host_frames_hz),
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
