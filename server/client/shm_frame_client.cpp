// SPDX-License-Identifier: Apache-2.0
#include "client/shm_frame_client.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "client/client_connection.hpp"
#include "client/frame_account.hpp"
#include "emit/physics/check.hpp"
#include "emit/protocol/shared_ring.hpp"
#include "emit/protocol/version.hpp"
#include "emit/v1/control.pb.h"
#include "net/shm_object.hpp"
#include "rt/clock.hpp"
#include "rt/futex.hpp"

namespace emit::client {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Longest time until readers notice that the daemon is gone: a crash wakes nobody.
constexpr std::int64_t kAliveCheckNs = 100'000'000;

class ShmFrameClient final : public FrameClient {
 public:
  ShmFrameClient(std::string name, server::ShmObject object, protocol::RingReader ring,
                 ServerInfo info)
      : name_(std::move(name)),
        object_(std::move(object)),
        ring_(std::move(ring)),
        info_(std::move(info)) {}

  const ServerInfo& server() const noexcept override { return info_; }
  physics::Result<ChannelDescription> subscribe(const SubscribeOptions& options) override;
  physics::Result<const ReceivedFrame*> receive(std::int64_t timeout_ns) override;
  bool intact() const noexcept override {
    return !options_.in_place || publication_ == 0 || ring_.intact(publication_);
  }
  const StreamTerms& terms() const noexcept override {
    EMIT_CHECK(subscribed_);
    return terms_;
  }
  const ReceiveCounters& counters() const noexcept override { return account_.counters; }
  std::vector<ServerStatus> take_statuses() override { return {}; }
  std::uint64_t receive_buffer_bytes() const noexcept override { return 0; }
  std::string receive_buffer_advice() const override { return {}; }

 private:
  enum class Taken : std::uint8_t { frame, left_out, overwritten };
  physics::Result<Taken> take(std::uint64_t publication);
  physics::Result<void> skip_to(std::uint64_t publication);

  std::string name_;
  server::ShmObject object_;
  protocol::RingReader ring_;
  ServerInfo info_;
  SubscribeOptions options_;
  bool subscribed_ = false;
  std::size_t channel_ = 0;
  std::uint64_t publication_ = 0;  // of the frame handed out last, or where reading began
  bool gap_ = false;               // frames were overwritten before they were read
  std::int64_t alive_at_ns_ = 0;
  std::vector<float> pixels_;  // unless in place
  StreamTerms terms_;
  FrameAccount account_;
  server::SystemClock clock_;
  ReceivedFrame frame_;
};

physics::Result<ChannelDescription> ShmFrameClient::subscribe(const SubscribeOptions& options) {
  if (subscribed_) {
    return make_error(ErrorCode::invalid_argument, "already subscribed");
  }
  if (options.every_nth < 1 || options.every_nth > protocol::kMaxEveryNth) {
    return make_error(ErrorCode::invalid_argument, every_nth_error(options.every_nth));
  }
  const auto fits = [](const std::string& wanted, const std::string& have) {
    return wanted.empty() || wanted == have;
  };
  const auto found = std::find_if(
      info_.channels.begin(), info_.channels.end(), [&](const ChannelDescription& channel) {
        return fits(options.channel_name, channel.name) &&
               fits(options.channel_kind, channel.kind) && fits(options.sensor, channel.sensor) &&
               fits(options.band, channel.band);
      });
  if (found == info_.channels.end()) {
    return make_error(
        ErrorCode::protocol,
        fmt::format("shm://{}: no channel name '{}' kind '{}' sensor '{}' band '{}'", name_,
                    options.channel_name, options.channel_kind, options.sensor, options.band));
  }
  options_ = options;
  channel_ = static_cast<std::size_t>(found - info_.channels.begin());
  if (!options_.in_place) {
    pixels_.resize(static_cast<std::size_t>(ring_.pixel_bytes(channel_) / sizeof(float)));
  }
  publication_ = ring_.newest();
  if (found->every_nth > protocol::kMaxEveryNth) {
    return make_error(ErrorCode::protocol, every_nth_error(found->every_nth));
  }
  terms_.every_nth = options.every_nth * found->every_nth;
  account_.set_every_nth(terms_.every_nth);
  subscribed_ = true;
  return *found;
}

physics::Result<const ReceivedFrame*> ShmFrameClient::receive(std::int64_t timeout_ns) {
  if (!subscribed_) {
    return make_error(ErrorCode::invalid_argument, "subscribe comes before receive");
  }
  const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
  for (;;) {
    // Before the look at the newest: what comes after this look changes it.
    const std::uint32_t seen = ring_.signal().load(std::memory_order_acquire);
    const bool ended = ring_.ended();
    const std::uint64_t newest = ring_.newest();
    if (newest > publication_) {
      // The slot behind the newest is being written; the one after it is next.
      const bool overrun = newest - publication_ >= ring_.slot_count();
      if (overrun) {
        if (auto skipped = skip_to(newest - 1); !skipped) {
          return tl::unexpected<physics::Error>(std::move(skipped.error()));
        }
      }
      const auto taken = take(publication_ + 1);
      if (!taken) {
        return tl::unexpected<physics::Error>(physics::Error(taken.error()));
      }
      if (*taken == Taken::frame) {
        return &frame_;
      }
      if (*taken == Taken::left_out) {
        continue;
      }
      if (auto skipped = skip_to(ring_.newest() - 1); !skipped) {
        return tl::unexpected<physics::Error>(std::move(skipped.error()));
      }
      if (monotonic_now_ns() >= end_ns) {
        return nullptr;
      }
      continue;
    }
    if (ended) {
      return make_error(ErrorCode::io, fmt::format("shm://{}: closed by the daemon", name_));
    }
    const std::int64_t now_ns = monotonic_now_ns();
    if (now_ns - alive_at_ns_ >= kAliveCheckNs) {
      if (!object_.alive()) {
        return make_error(ErrorCode::io,
                          fmt::format("shm://{}: the daemon is gone without closing it", name_));
      }
      alive_at_ns_ = now_ns;
    }
    if (now_ns >= end_ns) {
      return nullptr;
    }
    server::futex_wait(ring_.signal(), seen, std::min(end_ns - now_ns, kAliveCheckNs));
  }
}

/// Everything up to `frame` is passed over.
physics::Result<void> ShmFrameClient::skip_to(std::uint64_t publication) {
  if (options_.every_frame) {
    return make_error(ErrorCode::io,
                      fmt::format("shm://{}: fell behind by more than the {} frames it holds",
                                  name_, ring_.slot_count()));
  }
  gap_ = gap_ || publication > publication_;
  publication_ = std::max(publication_, publication);
  return {};
}

physics::Result<ShmFrameClient::Taken> ShmFrameClient::take(std::uint64_t publication) {
  const auto view = ring_.view(publication, channel_);
  if (!view) {
    return Taken::overwritten;
  }
  frame_.first_byte_ns = clock_.tai_ns();
  std::array<std::byte, protocol::kFrameHeaderBytes> head;
  std::copy(view->header.begin(), view->header.end(), head.begin());
  if (!ring_.intact(publication)) {
    return Taken::overwritten;
  }
  constexpr std::array<std::byte, protocol::kFrameHeaderBytes> kNone{};
  if (head == kNone) {  // nothing for this channel
    publication_ = publication;
    return Taken::left_out;
  }
  auto header = protocol::decode_frame_header(head);
  if (!header) {
    return tl::unexpected<physics::Error>(std::move(header.error()));
  }
  // A frame that was late for its number comes under another one.
  if (options_.every_nth != 1 && !protocol::is_every_nth(header->frame_number, terms_.every_nth)) {
    publication_ = publication;
    return Taken::left_out;
  }
  std::span<const std::byte> pixels = view->pixels;
  if (!options_.in_place) {
    std::memcpy(pixels_.data(), pixels.data(), pixels.size());
    pixels = std::as_bytes(std::span<const float>(pixels_));
  }
  frame_.last_byte_ns = clock_.tai_ns();
  const std::uint32_t crc32c = protocol::crc32c(pixels);
  if (!ring_.intact(publication)) {
    return Taken::overwritten;
  }
  if (header->payload_bytes != pixels.size()) {
    return make_error(ErrorCode::protocol, "a frame of another size than its channel");
  }
  publication_ = publication;
  frame_.header = *header;
  frame_.header.flags &= ~protocol::kReceiverFlags;
  // Among the frames that were overwritten there may be none that this reader wanted. Nothing
  // is lost on the way: what is missing was not ready for its channel.
  if ((std::exchange(gap_, false) && terms_.every_nth == 1) ||
      account_.missing_before(*header) > 0) {
    frame_.header.flags |= protocol::kFlagGapBefore;
  }
  // The ring keeps pixels aligned.
  frame_.pixels = {reinterpret_cast<const float*>(pixels.data()), pixels.size() / sizeof(float)};
  frame_.missing_px = 0;
  if (crc32c != header->payload_crc32c) {
    ++account_.counters.crc_errors;
    frame_.header.flags |= protocol::kFlagCorrupt;
  }
  ++account_.counters.received;
  account_.take(frame_.header);
  return Taken::frame;
}

}  // namespace

physics::Result<std::unique_ptr<FrameClient>> open_shm_frame_client(const std::string& name) {
  auto object = server::ShmObject::open(name);
  if (!object) {
    return tl::unexpected<physics::Error>(std::move(object.error()));
  }
  auto ring = protocol::RingReader::open(object->bytes());
  if (!ring) {
    return tl::unexpected<physics::Error>(std::move(ring.error()).with_context("shm://" + name));
  }
  v1::Welcome welcome;
  if (!welcome.ParseFromArray(ring->welcome().data(), static_cast<int>(ring->welcome().size())) ||
      static_cast<std::size_t>(welcome.channels_size()) != ring->channel_count()) {
    return make_error(ErrorCode::protocol, "shm://" + name + ": a ring without its welcome");
  }
  if (welcome.protocol_version() != protocol::kProtocolVersion) {
    return make_error(ErrorCode::protocol,
                      fmt::format("shm://{}: speaks protocol version {}, this client {}", name,
                                  welcome.protocol_version(), protocol::kProtocolVersion));
  }
  return std::make_unique<ShmFrameClient>(name, std::move(*object), std::move(*ring),
                                          to_server_info(welcome));
}

}  // namespace emit::client
