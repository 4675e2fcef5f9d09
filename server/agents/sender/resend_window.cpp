// SPDX-License-Identifier: Apache-2.0
#include "agents/sender/resend_window.hpp"

#include <algorithm>
#include <bit>

namespace emit::server {

ResendWindow::ResendWindow(const Params& params)
    : max_frac_(params.max_frac), frames_(std::max(params.frames, 1U)) {
  for (Frame& frame : frames_) {
    frame.pending_bits.resize(params.most_fragments / 64 + 1);
  }
}

void ResendWindow::clear(Frame& frame) noexcept {
  pending_ -= frame.pending;
  frame.pending = 0;
  std::ranges::fill(frame.pending_bits, std::uint64_t{0});
}

void ResendWindow::add(std::uint64_t sequence, const protocol::Fragmenter::Params& cut,
                       std::span<const std::byte, protocol::kFrameHeaderBytes> header,
                       std::span<const std::byte> pixels) noexcept {
  Frame& frame = frames_[cut.frame_id % frames_.size()];
  clear(frame);
  frame.held = true;
  frame.sequence = sequence;
  frame.cut = cut;
  std::ranges::copy(header, frame.header.begin());
  frame.pixels = pixels;
  frame.granted = 0;
  const double bytes = static_cast<double>(pixels.size());
  // The first loss may come with the first frame.
  credit_bytes_ = any_ ? std::min(credit_bytes_ + max_frac_ * bytes, bytes) : bytes;
  any_ = true;
}

void ResendWindow::forget(std::uint64_t sequence) noexcept {
  for (Frame& frame : frames_) {
    if (frame.held && frame.sequence == sequence) {
      clear(frame);
      frame.held = false;
    }
  }
}

bool ResendWindow::ask(const protocol::ResendRequest& request,
                       const std::optional<OnItsWay>& on_its_way) noexcept {
  Frame& frame = frames_[request.frame_id % frames_.size()];
  if (!frame.held || frame.cut.frame_id != request.frame_id ||
      frame.cut.stream_id != request.stream_id) {
    return false;
  }
  const protocol::Fragmenter fragments = frame.fragments();
  const std::uint32_t payload = fragments.payload_bytes();
  std::uint32_t sent = fragments.fragment_count();
  if (on_its_way && on_its_way->frame_id == request.frame_id) {
    sent = on_its_way->fragments_sent;
  }
  bool any = false;
  for (std::size_t i = 0; i < request.count; ++i) {
    const protocol::ByteRange& range = request.ranges[i];
    const std::uint32_t end = std::min((range.begin + range.bytes - 1) / payload + 1, sent);
    for (std::uint32_t index = range.begin / payload; index < end; ++index) {
      std::uint64_t& bits = frame.pending_bits[index / 64];
      const std::uint64_t bit = std::uint64_t{1} << (index % 64);
      if ((bits & bit) != 0) continue;
      if (frame.granted == fragments.fragment_count() || credit_bytes_ < payload) return any;
      credit_bytes_ -= payload;
      ++frame.granted;
      ++frame.pending;
      ++pending_;
      bits |= bit;
      any = true;
    }
  }
  return any;
}

UdpBatch::Result ResendWindow::send(int fd, UdpBatch& batch) noexcept {
  Frame* oldest = nullptr;
  for (Frame& frame : frames_) {
    if (frame.pending > 0 && (oldest == nullptr || frame.sequence < oldest->sequence)) {
      oldest = &frame;
    }
  }
  if (oldest == nullptr) {
    return {};
  }
  std::array<std::uint32_t, UdpBatch::kMaxBatch> indices;
  std::size_t count = 0;
  for (std::size_t word = 0; word < oldest->pending_bits.size(); ++word) {
    for (std::uint64_t bits = oldest->pending_bits[word]; bits != 0 && count < indices.size();
         bits &= bits - 1) {
      indices[count++] =
          static_cast<std::uint32_t>(word * 64 + static_cast<std::size_t>(std::countr_zero(bits)));
    }
  }
  const auto result = batch.send_some(fd, oldest->fragments(), std::span(indices).first(count),
                                      protocol::kFragmentResent);
  const std::uint32_t gone = result.status == UdpBatch::Status::failed ? 1 : result.fragments;
  for (std::uint32_t i = 0; i < gone; ++i) {
    oldest->pending_bits[indices[i] / 64] &= ~(std::uint64_t{1} << (indices[i] % 64));
  }
  oldest->pending -= gone;
  pending_ -= gone;
  return result;
}

}  // namespace emit::server
