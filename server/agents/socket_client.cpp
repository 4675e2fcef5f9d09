// SPDX-License-Identifier: Apache-2.0
#include "agents/socket_client.hpp"

#include <algorithm>
#include <cstring>

namespace emit::server {
namespace {

/// What one turn hands over at most, so that several clients advance side by side.
constexpr std::size_t kTcpTurnBytes = 512u << 10;
constexpr int kUdpTurnCalls = 6;

}  // namespace

SocketClient::SocketClient(Params params) : params_(std::move(params)) {
  const auto& channel = *params_.channel;
  spill_.resize(std::size_t{channel.width_px} * channel.height_px * sizeof(float));
  segmentation_ = params_.udp && udp_segmentation_supported(params_.udp_socket.fd());
}

void SocketClient::begin(const protocol::FrameHeader& header, const Image& image,
                         std::int64_t now_ns) noexcept {
  start(header, now_ns);
  const Channel& channel = *params_.channel;
  pixels_ = std::as_bytes(image.planes[channel.plane]);
  sim_time_ns_ = header.sim_time_ns;
  const std::span head(head_);
  protocol::encode(header_for(channel, image),
                   head.subspan<protocol::kRecordHeaderBytes, protocol::kFrameHeaderBytes>());
  if (params_.udp) {
    make_fragments(frame_id_++);
    fragment_ = 0;
  } else {
    protocol::encode_record_header(
        protocol::RecordKind::frame,
        static_cast<std::uint32_t>(protocol::kFrameHeaderBytes + pixels_.size()),
        head.first<protocol::kRecordHeaderBytes>());
    offset_ = 0;
  }
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

SocketClient::Progress SocketClient::send(UdpBatch& batch, Context& context) noexcept {
  return params_.udp ? send_udp(batch, context) : send_tcp(context);
}

SocketClient::Progress SocketClient::send_tcp(Context& context) noexcept {
  std::array<std::span<const std::byte>, 3> pieces;
  std::size_t count = 0;
  std::size_t budget = kTcpTurnBytes;
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
  return Progress::more;
}

SocketClient::Progress SocketClient::send_udp(UdpBatch& batch, Context& context) noexcept {
  if (!busy_) {
    return Progress::idle;
  }
  for (int call = 0; call < kUdpTurnCalls; ++call) {
    const auto result = batch.send(params_.udp_socket.fd(), *fragments_, fragment_, segmentation_);
    switch (result.status) {
      case UdpBatch::Status::sent:
        fragment_ += result.fragments;
        context.counters.add(Counter::bytes_sent, result.bytes);
        if (fragment_ == fragments_->fragment_count()) {
          return Progress::finished;
        }
        break;
      case UdpBatch::Status::would_block:
        return Progress::blocked;
      case UdpBatch::Status::no_buffers:
        return Progress::retry_soon;
      case UdpBatch::Status::no_segmentation:
        segmentation_ = false;
        context.sender_events.push(EventKind::no_gso, params_.connection,
                                   static_cast<std::uint64_t>(result.error));
        break;
      case UdpBatch::Status::failed:
        // Nobody listens, no route: the client's control connection decides whether it is gone.
        // The datagram counts as lost on the way.
        context.counters.add(Counter::send_errors);
        if (++fragment_ == fragments_->fragment_count()) {
          return Progress::finished;
        }
        break;
    }
  }
  return Progress::more;
}

void SocketClient::spill() noexcept {
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
