// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstring>

#include "client/client_connection.hpp"
#include "client/frame_account.hpp"
#include "client/resend_planner.hpp"
#include "client/shm_frame_client.hpp"
#include "client/udp_frame_receiver.hpp"
#include "emit/physics/check.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/pixel_codec.hpp"
#include "emit/protocol/resend.hpp"
#include "emit/v1/control.pb.h"
#include "rt/clock.hpp"

namespace emit::client {
namespace {

using physics::ErrorCode;
using physics::make_error;

constexpr std::uint64_t kMaxFrameBytes = 1u << 30;

/// Bytes of a channel's frames; more than kMaxFrameBytes where the daemon claims what no frame is.
std::uint64_t frame_bytes_of(const ChannelDescription& channel) {
  const std::uint64_t pixels = std::uint64_t{channel.width_px} * channel.height_px;
  return std::min(pixels, kMaxFrameBytes) * sizeof(float);
}

/// Returns the bytes of the largest channel's frames. Errors: protocol.
physics::Result<std::uint64_t> largest_frame_bytes(const ServerInfo& server) {
  std::uint64_t largest = 0;
  for (const auto& channel : server.channels) {
    largest = std::max(largest, frame_bytes_of(channel));
  }
  if (largest > kMaxFrameBytes) {
    return make_error(ErrorCode::protocol,
                      fmt::format("frames of more than {} bytes are refused", kMaxFrameBytes));
  }
  return largest;
}

/// Returns the request with what does not depend on the transport.
v1::ControlRecord subscribe_request(const SubscribeOptions& options) {
  v1::ControlRecord request;
  v1::Subscribe& subscribe = *request.mutable_subscribe();
  subscribe.set_channel_name(options.channel_name);
  subscribe.set_channel_kind(options.channel_kind);
  subscribe.set_sensor(options.sensor);
  subscribe.set_band(options.band);
  subscribe.set_every_frame(options.every_frame);
  subscribe.set_every_nth(options.every_nth);
  return request;
}

class FrameClientImpl final : public FrameClient {
 public:
  FrameClientImpl(ClientConnection connection, bool udp)
      : connection_(std::move(connection)), udp_(udp) {}

  const ServerInfo& server() const noexcept override { return connection_.server(); }
  physics::Result<ChannelDescription> subscribe(const SubscribeOptions& options) override;
  physics::Result<const ReceivedFrame*> receive(std::int64_t timeout_ns) override;
  bool intact() const noexcept override { return true; }
  const StreamTerms& terms() const noexcept override {
    EMIT_CHECK(subscribed_);
    return terms_;
  }
  const ReceiveCounters& counters() const noexcept override { return account_.counters; }
  std::vector<ServerStatus> take_statuses() override { return std::exchange(statuses_, {}); }
  std::uint64_t receive_buffer_bytes() const noexcept override {
    return receiver_ ? receiver_->buffer_bytes() : 0;
  }
  std::string receive_buffer_advice() const override;

 private:
  // Steps of subscribe().
  /// Opens the receiver of datagrams and adds its terms to the request. Errors: io.
  physics::Result<void> ask_for_datagrams(const SubscribeOptions& options, std::uint64_t largest,
                                          v1::Subscribe& subscribe);
  /// Takes memory for records of frames and adds their terms to the request.
  void ask_for_records(const SubscribeOptions& options, std::uint64_t largest,
                       v1::Subscribe& subscribe);
  /// Returns the daemon's answer. Errors: io (no answer by `end_ns`), protocol (refused).
  physics::Result<v1::Subscribed> wait_for_answer(std::int64_t end_ns);
  /// Takes over what the daemon grants. Errors: protocol, it grants what was not asked for.
  physics::Result<void> take_terms(const SubscribeOptions& options,
                                   const v1::Subscribed& subscribed);
  physics::Result<void> take_error_correction(const SubscribeOptions& options,
                                              const v1::Subscribed& subscribed);

  physics::Result<const ReceivedFrame*> receive_tcp(std::int64_t end_ns);
  physics::Result<const ReceivedFrame*> receive_udp(std::int64_t end_ns);
  const ReceivedFrame* pop_udp();
  void make_reassembler(std::uint64_t frame_bytes);
  physics::Result<void> ask_for_missing(std::int64_t now_ns, std::int64_t& wake_ns);
  std::span<const float> aligned(std::span<const std::byte> pixels);
  physics::Result<void> take_pixels(const protocol::FrameView& view, std::uint32_t sent_crc32c);
  void take_control(std::span<const std::byte> body);

  ClientConnection connection_;
  bool udp_;
  bool subscribed_ = false;
  std::uint16_t stream_id_ = 0;
  ChannelDescription channel_;
  server::SystemClock clock_;
  FrameAccount account_;
  std::vector<ServerStatus> statuses_;
  ReceivedFrame frame_;
  std::vector<float> pixels_;  // tcp: where a record's pixels lie unaligned, or encoded
  protocol::PixelDecoder decoder_;
  std::optional<UdpFrameReceiver> receiver_;
  std::optional<protocol::Reassembler> reassembler_;
  const protocol::ReceivedFrame* held_ = nullptr;
  StreamTerms terms_;
  ResendPlanner planner_;
  std::int64_t burst_begin_ns_ = 0;
  std::int64_t quiet_since_ns_ = 0;
};

physics::Result<ChannelDescription> FrameClientImpl::subscribe(const SubscribeOptions& options) {
  constexpr std::int64_t kTimeoutNs = 5'000'000'000;
  const std::int64_t end_ns = monotonic_now_ns() + kTimeoutNs;
  if (subscribed_) {
    return make_error(ErrorCode::invalid_argument, "already subscribed");
  }
  if (options.every_nth < 1 || options.every_nth > protocol::kMaxEveryNth) {
    return make_error(ErrorCode::invalid_argument, every_nth_error(options.every_nth));
  }
  // Frames may follow the answer at once: the parser must take the largest channel's.
  const auto largest = largest_frame_bytes(connection_.server());
  if (!largest) {
    return tl::unexpected<physics::Error>(largest.error());
  }
  v1::ControlRecord request = subscribe_request(options);
  if (!udp_) {
    ask_for_records(options, *largest, *request.mutable_subscribe());
  } else if (auto asked = ask_for_datagrams(options, *largest, *request.mutable_subscribe());
             !asked) {
    return tl::unexpected<physics::Error>(std::move(asked.error()));
  }
  if (auto sent = connection_.send(request, end_ns); !sent) {
    return tl::unexpected<physics::Error>(std::move(sent.error()));
  }
  auto subscribed = wait_for_answer(end_ns);
  if (!subscribed) {
    return tl::unexpected<physics::Error>(std::move(subscribed.error()));
  }
  if (auto taken = take_terms(options, *subscribed); !taken) {
    return tl::unexpected<physics::Error>(std::move(taken.error()));
  }
  if (udp_) {
    make_reassembler(*largest);
  }
  subscribed_ = true;
  return channel_;
}

physics::Result<void> FrameClientImpl::ask_for_datagrams(const SubscribeOptions& options,
                                                         std::uint64_t largest,
                                                         v1::Subscribe& subscribe) {
  auto receiver = UdpFrameReceiver::open(connection_.context(), connection_.peer(),
                                         connection_.local_address(), options);
  if (!receiver) {
    return tl::unexpected<physics::Error>(std::move(receiver.error()));
  }
  receiver_ = std::move(*receiver);
  receiver_->size_buffer(largest);
  subscribe.set_udp_port(options.announced_udp_port != 0 ? options.announced_udp_port
                                                         : receiver_->port());
  subscribe.set_fragment_payload_bytes(options.fragment_payload_bytes);
  subscribe.set_multicast_group(options.multicast_group);
  terms_.udp_port = receiver_->port();
  subscribe.set_resend(options.resend);
  if (options.fec) {
    v1::ErrorCorrection& wish = *subscribe.mutable_error_correction();
    wish.set_data_fragments(options.fec->data_fragments);
    wish.set_parity_fragments(options.fec->parity_fragments);
  }
  return {};
}

void FrameClientImpl::ask_for_records(const SubscribeOptions& options, std::uint64_t largest,
                                      v1::Subscribe& subscribe) {
  subscribe.set_compression(options.compression ? v1::COMPRESSION_SHUFFLED_LZ4
                                                : v1::COMPRESSION_NONE);
  connection_.allow_frames(static_cast<std::uint32_t>(largest + protocol::kFrameHeaderBytes));
  pixels_.resize(static_cast<std::size_t>(largest / sizeof(float)));
}

physics::Result<v1::Subscribed> FrameClientImpl::wait_for_answer(std::int64_t end_ns) {
  protocol::Record record;
  for (;;) {
    auto received = connection_.receive(record, end_ns);
    if (!received) {
      return tl::unexpected<physics::Error>(std::move(received.error()));
    }
    if (!*received) {
      return make_error(ErrorCode::io, "no answer to the subscription within 5 s");
    }
    v1::ControlRecord answer;
    if (record.kind != protocol::RecordKind::control ||
        !protocol::parse_control_record(record.body, answer)) {
      continue;
    }
    if (answer.has_status()) {
      return make_error(ErrorCode::protocol, "subscription refused: " + answer.status().text());
    }
    if (answer.has_subscribed()) {
      return std::move(*answer.mutable_subscribed());
    }
  }
}

physics::Result<void> FrameClientImpl::take_terms(const SubscribeOptions& options,
                                                  const v1::Subscribed& subscribed) {
  channel_ = describe_channel(subscribed.channel());
  stream_id_ = static_cast<std::uint16_t>(subscribed.stream_id());
  terms_.every_nth = std::max(subscribed.every_nth(), 1U);
  if (terms_.every_nth != std::uint64_t{options.every_nth} * channel_.every_nth) {
    return make_error(ErrorCode::protocol, "this daemon cannot leave frames out (every_nth)");
  }
  if (!options.channel_name.empty() && channel_.name != options.channel_name) {
    return make_error(ErrorCode::protocol,
                      fmt::format("this daemon knows no channels by name: it offers '{}' for '{}'",
                                  channel_.name, options.channel_name));
  }
  account_.set_every_nth(terms_.every_nth);
  terms_.compression = !udp_ && subscribed.compression() != v1::COMPRESSION_NONE;
  terms_.resend = udp_ && subscribed.resend();
  terms_.fragment_payload_bytes = udp_ ? subscribed.fragment_payload_bytes() : 0;
  return take_error_correction(options, subscribed);
}

physics::Result<void> FrameClientImpl::take_error_correction(const SubscribeOptions& options,
                                                             const v1::Subscribed& subscribed) {
  terms_.fec = {subscribed.error_correction().data_fragments(),
                subscribed.error_correction().parity_fragments()};
  if (!udp_ || !terms_.fec.on()) {
    terms_.fec = {};
  } else if (!terms_.fec.valid() ||
             (options.fec ? terms_.fec != *options.fec
                          : terms_.fec.parity_fragments > terms_.fec.data_fragments)) {
    // It decides how much memory is taken here.
    return make_error(ErrorCode::protocol,
                      fmt::format("error correction of {}+{} was not asked for",
                                  terms_.fec.data_fragments, terms_.fec.parity_fragments));
  }
  return {};
}

void FrameClientImpl::make_reassembler(std::uint64_t frame_bytes) {
  receiver_->expect_stream(stream_id_);
  protocol::Reassembler::Params params;
  params.max_payload_bytes = static_cast<std::uint32_t>(frame_bytes);
  params.max_streams = 1;
  params.fec = terms_.fec;
  if (terms_.resend) {
    // Frames wait for an older one while it is asked for.
    params.wait_for_missing = true;
    params.max_open_per_stream = 4;
    params.buffers = 6;
  }
  // A client that was busy elsewhere finds whole frames in the socket, and takes them at once.
  constexpr std::uint64_t kMaxFrames = 256;
  params.buffers += static_cast<std::uint32_t>(std::min(
      kMaxFrames, UdpFrameReceiver::kMaxTakenBytes / std::max<std::uint64_t>(frame_bytes, 1) + 1));
  reassembler_.emplace(params);
}

/// Asks the daemon for what is missing, where it is time to; `wake_ns`: when to look again.
physics::Result<void> FrameClientImpl::ask_for_missing(std::int64_t now_ns, std::int64_t& wake_ns) {
  for (;;) {
    std::array<protocol::Reassembler::OpenFrame, ResendPlanner::kMaxFrames> open;
    const std::size_t count = reassembler_->open_frames(stream_id_, open);
    const auto step = planner_.next(std::span(open).first(count), now_ns);
    wake_ns = step.wake_ns;
    if (step.kind == ResendPlanner::Step::Kind::wait) {
      return {};
    }
    if (step.kind == ResendPlanner::Step::Kind::give_up) {
      reassembler_->give_up(stream_id_, step.frame_id);
      continue;
    }
    protocol::ResendRequest request;
    request.stream_id = stream_id_;
    request.frame_id = step.frame_id;
    request.count = static_cast<std::uint16_t>(
        reassembler_->missing(stream_id_, step.frame_id, step.tail, request.ranges));
    if (request.count == 0) {
      continue;
    }
    std::array<std::byte, protocol::kRecordHeaderBytes + protocol::kMaxResendBytes> bytes;
    const std::span all(bytes);
    const std::size_t length = protocol::encode(
        request, all.subspan<protocol::kRecordHeaderBytes, protocol::kMaxResendBytes>());
    protocol::encode_record_header(protocol::RecordKind::resend, static_cast<std::uint32_t>(length),
                                   all.first<protocol::kRecordHeaderBytes>());
    constexpr std::int64_t kTimeoutNs = 100'000'000;
    ++account_.counters.resend_requests;
    if (auto sent =
            connection_.send(all.first(protocol::kRecordHeaderBytes + length), now_ns + kTimeoutNs);
        !sent) {
      return sent;
    }
  }
}

physics::Result<const ReceivedFrame*> FrameClientImpl::receive(std::int64_t timeout_ns) {
  if (!subscribed_) {
    return make_error(ErrorCode::invalid_argument, "subscribe comes before receive");
  }
  const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
  return udp_ ? receive_udp(end_ns) : receive_tcp(end_ns);
}

physics::Result<const ReceivedFrame*> FrameClientImpl::receive_tcp(std::int64_t end_ns) {
  protocol::Record record;
  for (;;) {
    if (!wait_for(connection_.fd(), POLLIN, monotonic_now_ns())) {
      burst_begin_ns_ = 0;  // nothing of the next frame has arrived yet
    } else if (burst_begin_ns_ == 0) {
      burst_begin_ns_ = clock_.tai_ns();
    }
    auto received = connection_.receive(record, end_ns);
    if (!received) {
      return tl::unexpected<physics::Error>(std::move(received.error()));
    }
    if (!*received) {
      return nullptr;
    }
    if (record.kind == protocol::RecordKind::control) {
      take_control(record.body);
      continue;
    }
    if (record.kind != protocol::RecordKind::frame) {
      continue;
    }
    auto view = protocol::decode_frame_record(record.body);
    if (!view) {
      return tl::unexpected<physics::Error>(std::move(view.error()));
    }
    if (view->header.payload_bytes > pixels_.size() * sizeof(float)) {
      return make_error(ErrorCode::protocol, "a frame larger than its channel");
    }
    frame_.header = view->header;
    // These are this side's to say.
    frame_.header.flags &= ~protocol::kReceiverFlags;
    frame_.last_byte_ns = clock_.tai_ns();
    frame_.first_byte_ns = burst_begin_ns_ != 0 ? burst_begin_ns_ : frame_.last_byte_ns;
    burst_begin_ns_ = 0;
    frame_.missing_px = 0;
    if (auto taken = take_pixels(*view, record.payload_crc32c); !taken) {
      return tl::unexpected<physics::Error>(std::move(taken.error()));
    }
    ++account_.counters.received;
    account_.take(frame_.header);
    return &frame_;
  }
}

physics::Result<const ReceivedFrame*> FrameClientImpl::receive_udp(std::int64_t end_ns) {
  // A frame whose last fragment was lost is handed out when nothing more comes for this long.
  constexpr std::int64_t kQuietNs = 250'000'000;
  if (held_ != nullptr) {
    reassembler_->release(held_);
    held_ = nullptr;
  }
  for (;;) {
    if (const ReceivedFrame* frame = pop_udp()) {
      return frame;
    }
    const int taken = receiver_->take(*reassembler_, account_.counters);
    std::int64_t ask_ns = 0;
    // The socket may still hold the fragments that seem to be missing.
    if (terms_.resend && receiver_->drained()) {
      if (auto asked = ask_for_missing(monotonic_now_ns(), ask_ns); !asked) {
        return tl::unexpected<physics::Error>(std::move(asked.error()));
      }
    }
    if (taken > 0) {
      quiet_since_ns_ = 0;
      if (burst_begin_ns_ == 0) {
        burst_begin_ns_ = clock_.tai_ns();
      }
      if (!receiver_->drained()) {
        continue;
      }
      // An empty socket need not be asked again before it is waited for.
    }
    if (const ReceivedFrame* frame = pop_udp()) {
      return frame;
    }
    const std::int64_t now_ns = monotonic_now_ns();
    if (quiet_since_ns_ == 0) {
      quiet_since_ns_ = now_ns;
    } else if (now_ns - quiet_since_ns_ > kQuietNs) {
      quiet_since_ns_ = now_ns;
      reassembler_->flush();
      if (const ReceivedFrame* frame = pop_udp()) {
        return frame;
      }
    }
    std::int64_t wake_ns = std::min(end_ns, quiet_since_ns_ + kQuietNs + 1'000'000);
    if (ask_ns != 0) {
      wake_ns = std::min(wake_ns, ask_ns);
    }
    const std::int64_t wait_ns = wake_ns - now_ns;
    std::array<pollfd, 2> fds{{{receiver_->fd(), POLLIN, 0}, {connection_.fd(), POLLIN, 0}}};
    const timespec timeout{static_cast<time_t>(std::max<std::int64_t>(wait_ns, 0) / 1'000'000'000),
                           static_cast<long>(std::max<std::int64_t>(wait_ns, 0) % 1'000'000'000)};
    ::ppoll(fds.data(), fds.size(), &timeout, nullptr);
    if (fds[1].revents != 0) {
      protocol::Record record;
      auto received = connection_.receive(record, monotonic_now_ns());
      if (!received) {
        // The daemon went away: what is still in the socket comes first.
        if (receiver_->take(*reassembler_, account_.counters) > 0) {
          continue;
        }
        reassembler_->flush();
        if (const ReceivedFrame* frame = pop_udp()) {
          return frame;
        }
        return tl::unexpected<physics::Error>(std::move(received.error()));
      }
      if (*received && record.kind == protocol::RecordKind::control) {
        take_control(record.body);
      }
    }
    if (fds[0].revents == 0 && monotonic_now_ns() >= end_ns) {
      return nullptr;
    }
  }
}

const ReceivedFrame* FrameClientImpl::pop_udp() {
  held_ = reassembler_->pop();
  if (held_ == nullptr) {
    return nullptr;
  }
  frame_.header = held_->header;
  frame_.pixels = held_->pixels;
  frame_.missing_px = held_->missing_px;
  frame_.validity = held_->validity;
  frame_.header_known = held_->header_known;
  frame_.repaired_fragments = held_->repaired_fragments;
  frame_.resent_fragments = held_->resent_fragments;
  frame_.frames_lost_before = held_->frames_lost_before;
  frame_.last_byte_ns = clock_.tai_ns();
  frame_.first_byte_ns = burst_begin_ns_ != 0 ? burst_begin_ns_ : frame_.last_byte_ns;
  burst_begin_ns_ = 0;
  account_.counters.received += held_->complete ? 1 : 0;
  account_.counters.partial += held_->complete ? 0 : 1;
  if (held_->complete && !held_->crc_ok) {
    ++account_.counters.crc_errors;
    frame_.header.flags |= protocol::kFlagCorrupt;
  }
  const auto& work = reassembler_->counters();
  account_.counters.repaired = work.fragments_repaired;
  account_.counters.repaired_frames = work.frames_repaired;
  account_.counters.unrepairable = work.groups_unrepairable;
  account_.counters.resent = work.fragments_resent;
  if (held_->header_known) {
    account_.take(frame_.header, frame_.frames_lost_before);
  } else {
    account_.take_unknown(frame_.frames_lost_before);
  }
  return &frame_;
}

/// `sent_crc32c`: of the bytes as they came.
physics::Result<void> FrameClientImpl::take_pixels(const protocol::FrameView& view,
                                                   std::uint32_t sent_crc32c) {
  frame_.encoded_bytes = view.header.encoded_bytes;
  std::uint32_t crc32c = sent_crc32c;
  if (view.header.encoding == protocol::PixelEncoding::raw) {
    frame_.encoded_bytes = 0;
    frame_.pixels = aligned(view.pixels);
  } else {
    const auto pixels = std::span(pixels_).first(
        static_cast<std::size_t>(view.header.payload_bytes / sizeof(float)));
    if (!decoder_.decode(view.pixels, std::as_writable_bytes(pixels))) {
      return make_error(
          ErrorCode::protocol,
          fmt::format("frame {}: {} encoded bytes do not make its {} bytes of pixels",
                      view.header.frame_number, view.pixels.size(), view.header.payload_bytes));
    }
    crc32c = protocol::crc32c(std::as_bytes(pixels));
    frame_.pixels = pixels;
  }
  if (crc32c != view.header.payload_crc32c) {
    ++account_.counters.crc_errors;
    frame_.header.flags |= protocol::kFlagCorrupt;
  }
  return {};
}

std::span<const float> FrameClientImpl::aligned(std::span<const std::byte> pixels) {
  const std::size_t count = pixels.size() / sizeof(float);
  // Only records other than frames can bring them out of step.
  if (reinterpret_cast<std::uintptr_t>(pixels.data()) % alignof(float) == 0) {
    return {reinterpret_cast<const float*>(pixels.data()), count};
  }
  std::memcpy(pixels_.data(), pixels.data(), pixels.size());
  return std::span<const float>(pixels_).first(count);
}

void FrameClientImpl::take_control(std::span<const std::byte> body) {
  v1::ControlRecord message;
  if (protocol::parse_control_record(body, message) && message.has_status()) {
    statuses_.push_back(to_status(message.status()));
  }
}

std::string FrameClientImpl::receive_buffer_advice() const {
  if (!receiver_ || !subscribed_) {
    return {};
  }
  constexpr std::uint64_t kFrames = 4;
  const std::uint64_t frame_bytes = frame_bytes_of(channel_);
  if (receiver_->buffer_bytes() >= kFrames * frame_bytes) {
    return {};
  }
  return fmt::format(
      "the UDP receive buffer holds {} bytes, less than {} frames of {} bytes; allow more with: "
      "sudo sysctl -w net.core.rmem_max={}",
      receiver_->buffer_bytes(), kFrames, frame_bytes, std::bit_ceil(2 * kFrames * frame_bytes));
}

}  // namespace

ReceiveCounters& ReceiveCounters::operator+=(const ReceiveCounters& other) noexcept {
  received += other.received;
  partial += other.partial;
  lost += other.lost;
  gaps += other.gaps;
  skipped += other.skipped;
  crc_errors += other.crc_errors;
  os_drops += other.os_drops;
  bad_datagrams += other.bad_datagrams;
  foreign_datagrams += other.foreign_datagrams;
  late += other.late;
  repeated += other.repeated;
  repaired += other.repaired;
  repaired_frames += other.repaired_frames;
  unrepairable += other.unrepairable;
  resend_requests += other.resend_requests;
  resent += other.resent;
  return *this;
}

std::unique_ptr<FrameClient> make_frame_client(ClientConnection connection, bool udp) {
  return std::make_unique<FrameClientImpl>(std::move(connection), udp);
}

physics::Result<std::unique_ptr<FrameClient>> FrameClient::connect(const std::string& url,
                                                                   std::int64_t timeout_ns,
                                                                   const Security& security) {
  const auto parsed = parse_frame_url(url);
  if (!parsed) {
    return tl::unexpected<physics::Error>(physics::Error(parsed.error()));
  }
  if (parsed->scheme == Url::Scheme::shm) {
    return open_shm_frame_client(parsed->host);
  }
  auto connection =
      ClientConnection::open(*parsed, protocol::PeerRole::client, timeout_ns, security);
  if (!connection) {
    return tl::unexpected<physics::Error>(std::move(connection.error()));
  }
  return make_frame_client(std::move(*connection), parsed->scheme == Url::Scheme::udp);
}

}  // namespace emit::client
