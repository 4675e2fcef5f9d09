// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "agents/agent.hpp"
#include "agents/context.hpp"
#include "agents/sender/sender_client.hpp"
#include "emit/protocol/pixel_codec.hpp"

namespace emit::server {

/// Streams published frames to the clients, each at its own pace, straight from the source's
/// memory.
///
/// The newest `queue_frames` frames form the window. A client is a position in it. When a
/// frame leaves the window although a client has not had it yet, that client skips it: the
/// next frame it gets carries kFlagGapBefore (newest-wins), or it is disconnected (every_frame).
/// Frames that a client did not ask for (every_nth) are no gap, and the sender does not wait for
/// them. Images are compressed block by block when no other client has work. The unsent rest of a
/// frame moves to the client's own memory when the frame leaves the window. So the sender retains
/// at most queue_frames + 1 images, whatever clients do, and a source with queue_frames + 3 slots
/// always has one to render into.
class Sender final : public Agent {
 public:
  /// Creates the sender. `keep_last` retains the newest image, because it may have to be sent again
  /// (ig-clock). `residents` are clients that are served from start to end and belong to no
  /// connection.
  Sender(Context& context, std::uint32_t queue_frames, std::size_t max_clients, bool keep_last,
         std::vector<SenderClient*> residents = {});

  /// Takes the memory to compress for clients that want it. The images are fixed by then. Do not
  /// call it while the agent runs.
  void allow_compression();

  [[nodiscard]] std::string_view name() const noexcept override { return "sender"; }
  [[nodiscard]] bool on_start() noexcept override;
  int do_work(std::int64_t now_ns) noexcept override;
  void on_stop() noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override { return wake_at_ns_; }
  [[nodiscard]] int wait_fd() const noexcept override { return epoll_.get(); }

  /// Returns true when every client has everything that the conductor has handed over. Thread: any.
  [[nodiscard]] bool idle() const noexcept {
    return finished_.load(std::memory_order_acquire) ==
           context_.frames_handed_over.load(std::memory_order_acquire);
  }

 private:
  struct Entry {
    Image image;
    protocol::FrameHeader header;
  };
  /// An image of a frame, once for all clients.
  struct EncodedPicture {
    protocol::PixelEncoder encoder;
    bool begun = false;
  };

  int take_commands() noexcept;
  int take_resends() noexcept;
  int take_published() noexcept;
  int take_writable() noexcept;
  int send_all() noexcept;
  bool advance(SenderClient& client) noexcept;
  /// Returns the encoded image of the frame on its way to a client that waits for it.
  [[nodiscard]] EncodedPicture& encoded_for(const SenderClient& client) noexcept;
  /// Hands over the image if it is encoded already. It returns false when the client must wait on.
  bool take_encoded(SenderClient& client) noexcept;
  /// Moves a client on to the next frame that it wants.
  void pass_over_unwanted(SenderClient& client) noexcept;
  [[nodiscard]] ClientCounts* counts_of(const SenderClient& client) const noexcept;
  void account(SenderClient& client) noexcept;
  void count_skipped(const SenderClient& client) noexcept;
  /// Returns whether more than one client gets every frame.
  [[nodiscard]] bool has_several_streams() const noexcept;
  void evict_oldest() noexcept;
  void drop_oldest() noexcept;
  void trim() noexcept;
  void hold(const Image& image) noexcept;
  void let_go(const Image& image) noexcept;
  void block(SenderClient& client) noexcept;
  void remove(std::size_t index, bool failed) noexcept;
  [[nodiscard]] Entry& entry(std::uint64_t sequence) noexcept {
    return window_[sequence % window_.size()];
  }

  Context& context_;
  const std::uint32_t queue_frames_;
  const bool keep_last_;
  const std::vector<SenderClient*> residents_;
  Fd epoll_;
  UdpBatch batch_;
  std::vector<SenderClient*> clients_;  // reserved at start
  std::vector<Entry> window_;
  std::vector<EncodedPicture> encoded_;  // of each place of the window, by image
  std::uint64_t first_ = 1;              // oldest frame in the window
  std::uint64_t end_ = 1;                // one past the newest
  std::array<std::uint32_t, kMaxSlots> holds_{};
  bool have_last_ = false;
  Image last_;
  std::int64_t wake_at_ns_ = kNeverNs;
  std::uint64_t taken_ = 0;  // frames taken so far
  std::atomic<std::uint64_t> finished_{
      0};  // taken_ when nothing was left to send; else the last such
};

}  // namespace emit::server
