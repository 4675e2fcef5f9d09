// SPDX-License-Identifier: Apache-2.0
#include "agents/sender/shm_client.hpp"

#include <algorithm>
#include <cstring>

#include "emit/physics/check.hpp"
#include "rt/futex.hpp"

namespace emit::server {
namespace {

/// Largest number of bytes that one turn copies, so that the other clients advance beside it. It is
/// more than a socket takes in a turn, because a copy to memory is the quickest, and serving the
/// quickest client first keeps waits short.
constexpr std::size_t kTurnBytes = 2u << 20;
constexpr std::size_t kBriefBytes = 64u << 10;

}  // namespace

physics::Result<std::unique_ptr<ShmClient>> ShmClient::create(const config::StreamConfig& config,
                                                              const std::vector<Channel>& channels,
                                                              std::span<const std::byte> welcome,
                                                              std::int64_t now_ns) {
  protocol::RingParams params;
  params.slots = config.shm_slots;
  params.welcome = welcome;
  params.started_ns = now_ns;
  std::vector<std::size_t> pictures;
  for (const Channel& channel : channels) {
    const auto known = std::find(pictures.begin(), pictures.end(), channel.picture);
    params.plane_of_channel.push_back(static_cast<std::uint32_t>(known - pictures.begin()));
    if (known == pictures.end()) {
      pictures.push_back(channel.picture);
      params.plane_bytes.push_back(std::uint64_t{channel.width_px} * channel.height_px *
                                   sizeof(float));
    }
  }
  auto object = ShmObject::create(protocol::ring_bytes(params), config.shm_mode);
  if (!object) {
    return tl::unexpected<physics::Error>(std::move(object.error()));
  }
  std::unique_ptr<ShmClient> out(
      new ShmClient(std::move(*object), params, channels, std::move(pictures)));
  if (auto named = out->object_.publish(config.shm); !named) {
    return tl::unexpected<physics::Error>(std::move(named.error()));
  }
  return out;
}

ShmClient::ShmClient(ShmObject object, const protocol::RingParams& params,
                     const std::vector<Channel>& channels, std::vector<std::size_t> pictures)
    : object_(std::move(object)),
      ring_(object_.writable(), params),
      channels_(channels),
      pictures_(std::move(pictures)) {}

ShmClient::~ShmClient() {
  ring_.end();
  futex_wake_all(ring_.signal());
}

void ShmClient::begin(const protocol::FrameHeader& header, const Image& image,
                      std::int64_t now_ns) noexcept {
  start(header, now_ns);
  image_ = image;
  plane_ = 0;
  offset_ = 0;
  ring_.begin();
  for (const Channel& channel : channels_) {
    const auto head = ring_.header(channel.index);
    if ((image.channels >> channel.index & 1U) != 0) {
      protocol::encode(header_for(channel, image), head);
    } else {
      std::ranges::fill(head, std::byte{0});  // nothing for this channel
    }
  }
}

void ShmClient::copy(std::size_t budget_bytes) noexcept {
  while (plane_ < pictures_.size() && budget_bytes > 0) {
    const std::span<std::byte> to = ring_.plane(plane_);
    const std::span<const std::byte> from = std::as_bytes(image_.pictures[pictures_[plane_]]);
    const std::size_t whole = std::min(to.size(), from.size());
    const std::size_t bytes = std::min(whole - offset_, budget_bytes);
    std::memcpy(to.data() + offset_, from.data() + offset_, bytes);
    budget_bytes -= bytes;
    offset_ += bytes;
    if (offset_ == whole) {
      offset_ = 0;
      ++plane_;
    }
  }
}

SenderClient::Progress ShmClient::send(UdpBatch& /*batch*/, Context& context, Turn turn) noexcept {
  if (!busy_) {
    return Progress::idle;
  }
  copy(turn == Turn::brief ? kBriefBytes : kTurnBytes);
  if (plane_ < pictures_.size()) {
    return Progress::more;
  }
  ring_.commit();
  futex_wake_all(ring_.signal());
  context.counters.add(Counter::frames_shared);
  return Progress::finished;
}

void ShmClient::spill() noexcept {
  EMIT_CHECK(busy_);
  copy(SIZE_MAX);
  spilled_ = true;
}

}  // namespace emit::server
