// SPDX-License-Identifier: Apache-2.0
#include "agents/sender/socket_client.hpp"

#include <algorithm>
#include <cstring>

#include "emit/physics/check.hpp"

namespace emit::server {
namespace {

/// Largest number of bytes that one turn hands to the kernel, so that several clients advance side
/// by side.
constexpr std::size_t kTcpTurnBytes = 512u << 10;
constexpr std::size_t kTcpBriefBytes = 64u << 10;
constexpr int kUdpTurnCalls = 6;
/// Bytes of a frame that one turn reads to make its parity.
constexpr std::size_t kParityTurnBytes = 256u << 10;

}  // namespace

SocketClient::SocketClient(Params params) : params_(std::move(params)) {
  const auto& channel = *params_.channel;
  spill_.resize(std::size_t{channel.width_px} * channel.height_px * sizeof(float));
  segmentation_ = params_.udp && udp_segmentation_supported(params_.udp_socket.fd());
  if (params_.udp) {
    pixels_ = spill_;
    make_fragments(0);  // the cut is the same for every frame
    if (params_.fec.on()) {
      parity_.emplace(params_.fec, *fragments_);
    }
    if (params_.resend_frames > 0) {
      resend_.emplace(ResendWindow::Params{params_.resend_frames, fragments_->fragment_count(),
                                           params_.resend_max_frac});
    }
  }
}

void SocketClient::begin(const protocol::FrameHeader& header, const Image& image,
                         std::int64_t now_ns) noexcept {
  start(header, now_ns);
  const Channel& channel = *params_.channel;
  pixels_ = std::as_bytes(image.pictures[channel.picture]);
  out_ = header_for(channel, image);
  sim_time_ns_ = out_.sim_time_ns;
  const std::span head(head_);
  if (params_.udp) {
    protocol::encode(out_,
                     head.subspan<protocol::kRecordHeaderBytes, protocol::kFrameHeaderBytes>());
    make_fragments(frame_id_++);
    fragment_ = 0;
    parity_sent_ = 0;
    if (parity_) {
      parity_->begin();
    }
    if (resend_) {
      resend_->add(in_transit, fragments_->params(),
                   head.subspan<protocol::kRecordHeaderBytes, protocol::kFrameHeaderBytes>(),
                   pixels_);
    }
  } else {
    waits_ = params_.compression;
    offset_ = 0;
    if (!waits_) {
      make_record();
    }
  }
}

void SocketClient::take_encoded(std::span<const std::byte> bytes) noexcept {
  EMIT_CHECK(waits_);
  waits_ = false;
  if (!bytes.empty()) {
    pixels_ = bytes;
    out_.encoding = protocol::PixelEncoding::shuffled_lz4;
    out_.encoded_bytes = static_cast<std::uint32_t>(bytes.size());
  }
  make_record();
}

void SocketClient::make_record() noexcept {
  const std::span head(head_);
  protocol::encode(out_, head.subspan<protocol::kRecordHeaderBytes, protocol::kFrameHeaderBytes>());
  protocol::encode_record_header(
      protocol::RecordKind::frame,
      static_cast<std::uint32_t>(protocol::kFrameHeaderBytes + pixels_.size()),
      head.first<protocol::kRecordHeaderBytes>());
}

void SocketClient::make_fragments(std::uint32_t frame_id) noexcept {
  fragments_.emplace(
      protocol::Fragmenter::Params{
          params_.stream_id, frame_id, sim_time_ns_,
          params_.channel->width_px * static_cast<std::uint32_t>(sizeof(float)),
          params_.fragment_payload_bytes},
      std::span(head_).subspan<protocol::kRecordHeaderBytes, protocol::kFrameHeaderBytes>(),
      pixels_);
}

SocketClient::Progress SocketClient::send(UdpBatch& batch, Context& context, Turn turn) noexcept {
  return params_.udp ? send_udp(batch, context, turn) : send_tcp(context, turn);
}

SocketClient::Progress SocketClient::send_tcp(Context& context, Turn turn) noexcept {
  std::array<std::span<const std::byte>, 3> pieces;
  std::size_t count = 0;
  const std::size_t turn_bytes = turn == Turn::brief ? kTcpBriefBytes : kTcpTurnBytes;
  std::size_t budget = turn_bytes;
  const auto add = [&](std::span<const std::byte> bytes, std::size_t from) {
    if (from < bytes.size() && budget > 0) {
      const std::size_t length = std::min(bytes.size() - from, budget);
      pieces[count++] = bytes.subspan(from, length);
      budget -= length;
    }
  };
  add(params_.first_bytes, first_sent_);
  if (busy_) {
    add(head_, static_cast<std::size_t>(offset_));
    add(pixels_, static_cast<std::size_t>(offset_ > head_.size() ? offset_ - head_.size()
                                                                 : std::uint64_t{0}));
  }
  if (count == 0) {
    return Progress::idle;
  }
  const IoResult sent = params_.tcp_socket->write_some(std::span(pieces).first(count));
  if (sent.status == IoStatus::would_block) {
    return Progress::blocked;
  }
  if (sent.status == IoStatus::busy) {
    return Progress::retry_soon;
  }
  if (sent.status != IoStatus::done) {
    error_ = sent.error;
    return Progress::failed;
  }
  std::size_t rest = sent.bytes;
  context.counters.add(Counter::bytes_sent, rest);
  const std::size_t first = std::min(rest, params_.first_bytes.size() - first_sent_);
  first_sent_ += first;
  rest -= first;
  offset_ += rest;
  if (busy_ && offset_ == head_.size() + pixels_.size()) {
    return Progress::finished;
  }
  // A plain socket takes less than it is handed only when it is full: asking it again would say so.
  const bool full = sent.bytes < turn_bytes - budget && params_.tcp_socket->tls() == nullptr;
  return full ? Progress::blocked : Progress::more;
}

SocketClient::Progress SocketClient::send_udp(UdpBatch& batch, Context& context,
                                              Turn turn) noexcept {
  const int fd = params_.udp_socket.fd();
  const int calls = turn == Turn::brief ? 1 : kUdpTurnCalls;
  for (int call = 0; call < calls; ++call) {
    // Send fragments that somebody waits for first, then the frame, then its parity.
    const bool again = resend_ && resend_->pending();
    if (!again && !busy_) {
      return call == 0 ? Progress::idle : Progress::more;
    }
    std::uint32_t datagrams = 0;
    const bool parity = !again && fragment_ == fragments_->fragment_count();
    if (parity && !parity_->encode_some(*fragments_, kParityTurnBytes)) {
      return Progress::more;
    }
    const auto result =
        again ? resend_->send(fd, batch)
        : parity
            ? batch.send_datagrams(
                  fd, parity_->datagrams(parity_sent_, parity_->datagram_count() - parity_sent_),
                  parity_->datagram_bytes(), segmentation_)
            : batch.send(fd, *fragments_, fragment_, segmentation_);
    switch (result.status) {
      case UdpBatch::Status::sent:
        datagrams = result.fragments;
        context.counters.add(Counter::bytes_sent, result.bytes);
        break;
      case UdpBatch::Status::would_block:
        return Progress::blocked;
      case UdpBatch::Status::no_buffers:
        return Progress::retry_soon;
      case UdpBatch::Status::no_segmentation:
        segmentation_ = false;
        context.sender_events.push(EventKind::no_segmentation_offload, params_.connection,
                                   static_cast<std::uint64_t>(result.error));
        break;
      case UdpBatch::Status::failed:
        // Nobody listens, no route: the client's control connection decides whether it is gone.
        // The datagram counts as lost on the way.
        context.counters.add(Counter::send_errors);
        datagrams = 1;
        break;
    }
    if (again) {
      context.counters.add(Counter::fragments_resent, result.fragments);
      continue;
    }
    (parity ? parity_sent_ : fragment_) += datagrams;
    if (parity) {
      context.counters.add(Counter::parity_sent, result.fragments);
    }
    if (fragment_ == fragments_->fragment_count() &&
        (!parity_ || parity_sent_ == parity_->datagram_count())) {
      return Progress::finished;
    }
  }
  return Progress::more;
}

bool SocketClient::ask_again(const protocol::ResendRequest& request) noexcept {
  if (!resend_) {
    return false;
  }
  std::optional<ResendWindow::OnItsWay> on_its_way;
  if (busy_) {
    on_its_way = {frame_id_ - 1, fragment_};
  }
  return resend_->ask(request, on_its_way);
}

void SocketClient::forget(std::uint64_t sequence) noexcept {
  if (resend_) {
    resend_->forget(sequence);
  }
}

void SocketClient::spill() noexcept {
  EMIT_CHECK(busy_);
  if (waits_) {
    take_encoded({});  // the pixels leave before they are encoded
  }
  const std::size_t length = std::min(pixels_.size(), spill_.size());
  std::memcpy(spill_.data(), pixels_.data(), length);
  const std::span<const std::byte> own(spill_.data(), length);
  pixels_ = own;
  if (params_.udp) {
    make_fragments(frame_id_ - 1);
  }
  spilled_ = true;
}

}  // namespace emit::server
