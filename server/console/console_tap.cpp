// SPDX-License-Identifier: Apache-2.0
#include "console/console_tap.hpp"

#include <algorithm>

#include "emit/physics/check.hpp"

namespace emit::server {
namespace {

/// Number of floats that one turn copies: 64 KiB, as in the brief turn of other clients, because
/// nobody is in a hurry here.
constexpr std::size_t kTurnFloats = (64u << 10) / sizeof(float);

}  // namespace

ConsoleTap::ConsoleTap(Context& context) : context_(context) {
  std::size_t largest = 0;
  for (const Channel& channel : context.channels) {
    largest = std::max(largest, std::size_t{channel.width_px} * channel.height_px);
  }
  pixels_.resize(largest);
}

bool ConsoleTap::ask(std::size_t channel) noexcept {
  EMIT_CHECK_OP(channel, <, context_.channels.size());
  if (state_.load(std::memory_order_acquire) != State::idle) {
    return false;
  }
  channel_ = channel;
  state_.store(State::asked, std::memory_order_release);
  return true;
}

ConsoleTap::Taken ConsoleTap::taken() const noexcept {
  if (state_.load(std::memory_order_acquire) != State::ready) {
    return {};
  }
  return {&taken_, std::span(pixels_).first(copied_)};
}

bool ConsoleTap::wants(const protocol::FrameHeader& /*header*/,
                       ChannelSet channels) const noexcept {
  return state_.load(std::memory_order_acquire) == State::asked && (channels >> channel_ & 1U) != 0;
}

void ConsoleTap::begin(const protocol::FrameHeader& header, const Image& image,
                       std::int64_t now_ns) noexcept {
  state_.store(State::copying, std::memory_order_relaxed);
  start(header, now_ns);
  const Channel& channel = context_.channels[channel_];
  taken_ = header_for(channel, image);
  // Frames that the console did not ask for are no gap.
  taken_.flags &= ~std::uint32_t{protocol::kFlagGapBefore};
  from_ = image.pictures[channel.picture];
  from_ = from_.first(std::min(from_.size(), pixels_.size()));
  copied_ = 0;
}

void ConsoleTap::copy(std::size_t budget_floats) noexcept {
  const std::size_t count = std::min(from_.size() - copied_, budget_floats);
  std::copy_n(from_.begin() + static_cast<std::ptrdiff_t>(copied_), count,
              pixels_.begin() + static_cast<std::ptrdiff_t>(copied_));
  copied_ += count;
}

SenderClient::Progress ConsoleTap::send(UdpBatch& /*batch*/, Context& /*context*/,
                                        Turn /*turn*/) noexcept {
  if (!busy_) {
    return Progress::idle;
  }
  copy(kTurnFloats);
  if (copied_ < from_.size()) {
    return Progress::more;
  }
  state_.store(State::ready, std::memory_order_release);
  context_.bells.console.ring();
  return Progress::finished;
}

void ConsoleTap::spill() noexcept {
  EMIT_CHECK(busy_);
  copy(from_.size());
  spilled_ = true;
}

void ConsoleTap::see(const protocol::FrameHeader& header) noexcept {
  if (!open_.load(std::memory_order_relaxed)) {
    return;
  }
  // A console that is late misses ticks.
  if (FrameTick* tick = ticks_.claim()) {
    *tick = {header.frame_number,     header.flags,
             header.host_received_ns, header.slot_begin_ns,
             header.render_start_ns,  header.render_end_ns,
             header.readback_end_ns,  context_.clock.tai_ns(),
             header.deadline_ns};
    ticks_.commit();
  }
}

}  // namespace emit::server
