// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "agents/context.hpp"
#include "agents/sender/sender_client.hpp"

namespace emit::server {

/// Instants of a published frame, for the strips of the console. Wall, ns; 0: did not happen.
struct FrameTick {
  std::uint64_t frame_number = 0;
  std::uint32_t flags = 0;  ///< protocol::FrameFlags
  std::int64_t host_received_ns = 0;
  std::int64_t slot_begin_ns = 0;
  std::int64_t render_start_ns = 0;
  std::int64_t render_end_ns = 0;
  std::int64_t readback_end_ns = 0;
  std::int64_t published_ns = 0;  ///< the sender has it
  std::int64_t deadline_ns = 0;
};

/// Takes a frame out of the sender's window when the console asks for one. It is a client of the
/// sender like a ring in shared memory, but one frame at a time: the console asks, the sender
/// copies a piece each turn, the console takes the copy. Nobody waits for the other, and a console
/// that does not ask costs a look at an atomic per frame.
///
/// Owner: the daemon. Threads: open(), ask(), taken(), give_back() and ticks() belong to the
/// console's, all else to the sender's. Real time: RT-safe after construction.
class ConsoleTap final : public SenderClient {
 public:
  /// Takes the memory of the largest image. The channels are fixed by then.
  explicit ConsoleTap(Context& context);

  /// Says whether anybody looks. Without, no ticks are noted.
  void open(bool is_open) noexcept { open_.store(is_open, std::memory_order_relaxed); }
  /// Asks for the next frame of a channel. Returns false while an earlier one is asked for or on
  /// its way or not given back.
  [[nodiscard]] bool ask(std::size_t channel) noexcept;
  /// A frame that has been copied.
  struct Taken {
    const protocol::FrameHeader* header = nullptr;  ///< null: there is none
    std::span<const float> pixels;
  };
  [[nodiscard]] Taken taken() const noexcept;
  /// Makes room for the next one.
  /// @pre taken().header is not null
  void give_back() noexcept { state_.store(State::idle, std::memory_order_release); }
  [[nodiscard]] SpscRing<FrameTick>& ticks() noexcept { return ticks_; }

  void begin(const protocol::FrameHeader& header, const Image& image,
             std::int64_t now_ns) noexcept override;
  [[nodiscard]] Progress send(UdpBatch& batch, Context& context, Turn turn) noexcept override;
  void spill() noexcept override;
  [[nodiscard]] std::uint32_t connection() const noexcept override { return 0; }
  [[nodiscard]] bool is_stream() const noexcept override { return false; }
  [[nodiscard]] bool wants(const protocol::FrameHeader& header,
                           ChannelSet channels) const noexcept override;
  void see(const protocol::FrameHeader& header) noexcept override;

 private:
  /// idle -> asked by the console, asked -> copying -> ready by the sender, ready -> idle by the
  /// console.
  enum class State : std::uint8_t { idle, asked, copying, ready };

  void copy(std::size_t budget_floats) noexcept;

  Context& context_;
  std::atomic<State> state_{State::idle};
  std::atomic<bool> open_{false};
  std::size_t channel_ = 0;      ///< the console's while idle, the sender's until ready
  protocol::FrameHeader taken_;  ///< likewise
  std::span<const float> from_;  ///< in the source's memory, until copied
  std::size_t copied_ = 0;       ///< floats
  std::vector<float> pixels_;
  SpscRing<FrameTick> ticks_{2048};  ///< sender -> console
};

}  // namespace emit::server
