// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/protocol/reassembler.hpp"

namespace emit::client {

/// When a receiver asks for what it is missing. A frame is asked for once nothing more came of it
/// for a moment, which is short when its end or a newer frame has been seen and longer when not:
/// then first for the holes alone, because a sender that had to wait goes on. Again when the answer
/// does not come; and is given up after some requests on which nothing came.
/// The caller says what time it is. One owner; allocates nothing.
class ResendPlanner {
 public:
  struct Params {
    std::int64_t settle_ns = 500'000;  ///< reordered fragments and parity may still come
    std::int64_t quiet_ns = 3'000'000;
    std::int64_t answer_ns = 20'000'000;  ///< from a request to the next
    std::uint32_t requests = 4;           ///< per frame at most, without an answer
  };
  static constexpr std::size_t kMaxFrames = 8;

  struct Step {
    enum class Kind : std::uint8_t { wait, ask, give_up };
    Kind kind = Kind::wait;
    std::uint32_t frame_id = 0;  ///< of ask and give_up
    std::int64_t wake_ns = 0;    ///< of wait: when to look again; 0: no frame is open
    bool tail = false;           ///< of ask: what is behind the last byte that came, too
  };

  ResendPlanner() = default;
  explicit ResendPlanner(const Params& params) : params_(params) {}

  /// Returns the next step for the frames in work, oldest first. A request that it returns counts
  /// as sent.
  [[nodiscard]] Step next(std::span<const protocol::Reassembler::OpenFrame> frames,
                          std::int64_t now_ns) noexcept;

 private:
  struct Watched {
    bool used = false;
    std::uint32_t frame_id = 0;
    std::uint64_t arrivals = 0;
    std::int64_t changed_ns = 0;
    std::int64_t asked_ns = 0;
    std::uint32_t asked = 0;  // since anything came of it
  };
  Params params_;
  std::array<Watched, kMaxFrames> watched_{};
};

}  // namespace emit::client
