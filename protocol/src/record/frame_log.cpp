// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/frame_log.hpp"

#include <fmt/format.h>

#include <cstring>
#include <limits>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/mcap_reader.hpp"
#include "emit/v1/frame.pb.h"
#include "quiet_protobuf.hpp"

namespace emit::protocol {
namespace {

using physics::ErrorCode;
using physics::Result;

constexpr std::string_view kFrameMessage = "emit.v1.RecordedFrame";

}  // namespace

void set_pixels(v1::RecordedFrame& frame, std::span<const float> pixels, PixelEncoder& encoder) {
  const std::span<const std::byte> raw = std::as_bytes(pixels);
  encoder.begin(raw);
  while (!encoder.done()) encoder.encode_block();
  const std::span<const std::byte> encoded = encoder.bytes();
  const bool smaller = !encoded.empty();
  const std::span<const std::byte> kept = smaller ? encoded : raw;
  frame.set_compression(smaller ? v1::COMPRESSION_SHUFFLED_LZ4 : v1::COMPRESSION_NONE);
  frame.set_pixels(kept.data(), kept.size());
  frame.set_crc32c(crc32c(raw));
}

struct FrameLogReader::Impl {
  explicit Impl(McapReader reader) : mcap(std::move(reader)) {}

  McapReader mcap;
  v1::RecordedFrame frame;
  std::vector<float> pixels;
  PixelDecoder decoder;

  tl::unexpected<physics::Error> fail(std::string_view text) const {
    return physics::make_error(
        ErrorCode::parse,
        fmt::format("{}: offset {}: {}", mcap.path().string(), mcap.message().file_offset, text));
  }

  Result<void> take() {
    const McapMessage& message = mcap.message();
    const McapSchema* schema = mcap.schema(mcap.channel(message.channel_id)->schema_id);
    if (schema == nullptr || schema->name != kFrameMessage ||
        message.data.size() > std::numeric_limits<int>::max() ||
        !frame.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
      return fail(fmt::format("image {}: not an {}", message.sequence, kFrameMessage));
    }
    return decode();
  }

  Result<void> decode() {
    // The largest image that the wire carries, px.
    constexpr std::uint64_t kMaxPixels = std::uint64_t{1} << 28;
    const std::uint64_t count = std::uint64_t{frame.width_px()} * frame.height_px();
    const auto named = [&](std::string_view text) {
      return fail(fmt::format("image of frame {}: {}", frame.frame_number(), text));
    };
    if (count == 0 || count > kMaxPixels) {
      return named(fmt::format("{} x {} px", frame.width_px(), frame.height_px()));
    }
    const std::span<const std::byte> stored = std::as_bytes(std::span(frame.pixels()));
    // A block of LZ4 shrinks to no less than a 255th, so that a short message cannot claim a large
    // image.
    constexpr std::uint64_t kMaxRatio = 256;
    if (count * sizeof(float) > stored.size() * kMaxRatio) {
      return named(fmt::format("{} bytes for {} pixels", stored.size(), count));
    }
    pixels.resize(count);
    const std::span<std::byte> raw = std::as_writable_bytes(std::span(pixels));
    if (frame.compression() == v1::COMPRESSION_SHUFFLED_LZ4) {
      if (!decoder.decode(stored, raw)) return named("the pixels do not decompress");
    } else if (frame.compression() == v1::COMPRESSION_NONE && stored.size() == raw.size()) {
      std::memcpy(raw.data(), stored.data(), raw.size());
    } else {
      return named(fmt::format("{} bytes for {} pixels, compression {}", stored.size(), count,
                               static_cast<int>(frame.compression())));
    }
    if (const std::uint32_t crc = crc32c(raw); crc != frame.crc32c()) {
      return named(fmt::format("CRC {:08x}, recorded {:08x}", crc, frame.crc32c()));
    }
    return {};
  }
};

FrameLogReader::FrameLogReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FrameLogReader::FrameLogReader(FrameLogReader&&) noexcept = default;
FrameLogReader& FrameLogReader::operator=(FrameLogReader&&) noexcept = default;
FrameLogReader::~FrameLogReader() = default;

Result<FrameLogReader> FrameLogReader::open(const std::filesystem::path& path) {
  quiet_protobuf();
  auto mcap = McapReader::open(path);
  if (!mcap) return tl::unexpected(mcap.error());
  return FrameLogReader(std::make_unique<Impl>(std::move(*mcap)));
}

Result<bool> FrameLogReader::next() {
  for (;;) {
    auto more = impl_->mcap.next();
    if (!more || !*more) return more;
    const McapChannel* channel = impl_->mcap.channel(impl_->mcap.message().channel_id);
    if (channel->topic != kFrameTopic) continue;
    if (auto taken = impl_->take(); !taken) return tl::unexpected(taken.error());
    return true;
  }
}

const v1::RecordedFrame& FrameLogReader::frame() const noexcept {
  return impl_->frame;
}
std::span<const float> FrameLogReader::pixels() const noexcept {
  return impl_->pixels;
}
const std::optional<std::string>& FrameLogReader::truncation() const noexcept {
  return impl_->mcap.truncation();
}

}  // namespace emit::protocol
