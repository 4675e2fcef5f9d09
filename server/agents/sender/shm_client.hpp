// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <span>
#include <vector>

#include "agents/sender/sender_client.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/protocol/shared_ring.hpp"
#include "net/shm_object.hpp"

namespace emit::server {

/// Writes every frame with all channels into a ring of shared memory, for clients on this host. It
/// writes only while somebody reads. Readers map the memory read-only: no reader, dead or alive,
/// can delay or disturb anybody.
///
/// Owner: the daemon. Thread: the sender's between construction and destruction.
class ShmClient final : public SenderClient {
 public:
  /// Takes the memory and gives it its name. `welcome`: serialised emit.v1.Welcome.
  /// Errors (io): the name is in use, no room.
  [[nodiscard]] static physics::Result<std::unique_ptr<ShmClient>> create(
      const config::StreamConfig& config, const std::vector<Channel>& channels,
      std::span<const std::byte> welcome, std::int64_t now_ns);
  /// Marks the ring as ended for its readers.
  ~ShmClient() override;

  void begin(const protocol::FrameHeader& header, const Image& image,
             std::int64_t now_ns) noexcept override;
  [[nodiscard]] Progress send(UdpBatch& batch, Context& context, Turn turn) noexcept override;
  /// Copies the rest at once, so that the source waits for no more than that.
  void spill() noexcept override;
  [[nodiscard]] std::uint32_t connection() const noexcept override { return 0; }
  [[nodiscard]] Counter counter_of_unwanted() const noexcept override {
    return Counter::frames_unread;
  }
  /// Returns false while nobody reads, so that nothing is copied then.
  [[nodiscard]] bool wants(const protocol::FrameHeader& /*header*/,
                           ChannelSet /*channels*/) const noexcept override {
    return object_.has_readers();
  }

 private:
  ShmClient(ShmObject object, const protocol::RingParams& params,
            const std::vector<Channel>& channels, std::vector<std::size_t> pictures);
  void copy(std::size_t budget_bytes) noexcept;

  ShmObject object_;
  protocol::RingWriter ring_;
  const std::vector<Channel>& channels_;
  std::vector<std::size_t> pictures_;  // of the image, by plane of the ring
  Image image_;                        // being copied
  std::size_t plane_ = 0;              // where copying stands
  std::size_t offset_ = 0;
};

}  // namespace emit::server
