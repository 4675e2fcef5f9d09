// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "emit/protocol/fragment.hpp"
#include "emit/protocol/resend.hpp"
#include "net/udp_batch.hpp"

namespace emit::server {

/// The frames that one client got last, as it got them, and the fragments that it requested again.
///
/// Two limits apply to resends. A fragment is sent again at most once on average over a frame. The
/// bytes sent again are at most a share of the bytes sent first; unused share is saved up to one
/// frame. Thread: one owner. Real time: RT-safe after construction.
class ResendWindow {
 public:
  struct Params {
    std::uint32_t frames = 0;
    std::uint32_t most_fragments = 0;  ///< of a frame
    double max_frac = 0.0;
  };
  explicit ResendWindow(const Params& params);

  /// Adds a frame that goes out for the first time. `pixels` live until forget(sequence).
  void add(std::uint64_t sequence, const protocol::Fragmenter::Params& cut,
           std::span<const std::byte, protocol::kFrameHeaderBytes> header,
           std::span<const std::byte> pixels) noexcept;
  void forget(std::uint64_t sequence) noexcept;

  /// The frame that is being sent now, and the number of its fragments that have gone. The others
  /// need no second copy yet.
  struct OnItsWay {
    std::uint32_t frame_id = 0;
    std::uint32_t fragments_sent = 0;
  };
  /// Marks the requested fragments. It returns false when the frame is no longer available, or when
  /// nothing of the request is granted. `on_its_way` is empty while no frame is being sent.
  [[nodiscard]] bool ask(const protocol::ResendRequest& request,
                         const std::optional<OnItsWay>& on_its_way) noexcept;

  [[nodiscard]] bool pending() const noexcept { return pending_ > 0; }
  /// Sends one call's amount of the requested fragments. If the call fails, its first fragment
  /// counts as gone.
  [[nodiscard]] UdpBatch::Result send(int fd, UdpBatch& batch) noexcept;

 private:
  struct Frame {
    bool held = false;
    std::uint64_t sequence = 0;
    protocol::Fragmenter::Params cut;
    std::array<std::byte, protocol::kFrameHeaderBytes> header{};
    std::span<const std::byte> pixels;
    std::uint32_t granted = 0;  // fragments, since it was added
    std::uint32_t pending = 0;  // fragments
    std::vector<std::uint64_t> pending_bits;
    [[nodiscard]] protocol::Fragmenter fragments() const noexcept { return {cut, header, pixels}; }
  };
  void clear(Frame& frame) noexcept;

  double max_frac_;
  double credit_bytes_ = 0.0;
  bool any_ = false;  // a frame was added
  std::uint32_t pending_ = 0;
  std::vector<Frame> frames_;
};

}  // namespace emit::server
