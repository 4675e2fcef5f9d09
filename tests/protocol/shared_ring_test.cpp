// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/shared_ring.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <new>
#include <random>
#include <string>
#include <vector>

#include "protocol/frames.hpp"

namespace emit::protocol {
namespace {

constexpr std::uint64_t kPixelBytes = 16 * 8 * 4;
const std::string kWelcome = "welcome";

/// Zeroed memory of exactly the ring's size, so that a sanitizer sees an access beyond it.
class Memory {
 public:
  explicit Memory(std::size_t bytes)
      : bytes_(bytes), at_(static_cast<std::byte*>(::operator new (bytes, std::align_val_t{64}))) {
    std::memset(at_, 0, bytes);
  }
  ~Memory() { ::operator delete (at_, std::align_val_t{64}); }
  Memory(const Memory&) = delete;
  Memory& operator=(const Memory&) = delete;
  [[nodiscard]] std::span<std::byte> span() const { return {at_, bytes_}; }
  template <class T>
  [[nodiscard]] T get(std::size_t offset) const {
    T value{};
    std::memcpy(&value, at_ + offset, sizeof value);
    return value;
  }

 private:
  std::size_t bytes_;
  std::byte* at_;
};

/// Returns the layout of two channels of one band and a third of another.
RingParams three_channels() {
  RingParams params;
  params.slots = 4;
  params.plane_bytes = {kPixelBytes, kPixelBytes};
  params.plane_of_channel = {0, 0, 1};
  params.welcome = std::as_bytes(std::span(kWelcome));
  params.started_ns = 77;
  return params;
}

void fill(RingWriter& writer, std::uint64_t number) {
  for (std::size_t plane = 0; plane < 2; ++plane) {
    const auto frame = test::make_frame(16, 8, 2 * number + plane);
    std::memcpy(writer.plane(plane).data(), frame.pixels.data(), frame.pixels.size());
    for (std::size_t channel = plane == 0 ? 0 : 2; channel < (plane == 0 ? 2U : 3U); ++channel) {
      std::memcpy(writer.header(channel).data(), frame.header_bytes.data(), kFrameHeaderBytes);
    }
  }
}

void publish(RingWriter& writer, std::uint64_t number) {
  writer.begin();
  fill(writer, number);
  writer.commit();
}

TEST(SharedRing, LiesInMemoryAsDocumented) {
  const RingParams params = three_channels();
  const Memory memory(ring_bytes(params));
  RingWriter writer(memory.span(), params);
  EXPECT_EQ(memory.get<std::uint32_t>(0), 0x534D4645u);
  EXPECT_EQ(std::memcmp(memory.span().data(), "EFMS", 4), 0);
  EXPECT_EQ(memory.get<std::uint16_t>(4), 2u);
  EXPECT_EQ(memory.get<std::uint32_t>(8), 4u);
  EXPECT_EQ(memory.get<std::uint32_t>(12), 3u);
  EXPECT_EQ(memory.get<std::uint64_t>(16), memory.span().size());
  const auto slot_bytes = memory.get<std::uint64_t>(24);
  const auto slots = memory.get<std::uint64_t>(32);
  const auto channels = memory.get<std::uint64_t>(40);
  const auto welcome = memory.get<std::uint64_t>(48);
  EXPECT_EQ(memory.get<std::uint64_t>(56), kWelcome.size());
  EXPECT_EQ(memory.get<std::int64_t>(64), 77);
  EXPECT_EQ(slot_bytes % 4096, 0u);
  EXPECT_EQ(slots % 4096, 0u);
  EXPECT_EQ(std::memcmp(memory.span().data() + welcome, kWelcome.data(), kWelcome.size()), 0);
  EXPECT_EQ(memory.get<std::uint32_t>(132), 1u) << "running";

  publish(writer, 1);
  const std::size_t slot = slots + 1 * slot_bytes;  // publication 1 modulo 4 slots
  EXPECT_EQ(memory.get<std::uint64_t>(slot), 2u);
  EXPECT_EQ(memory.get<std::uint32_t>(128), 1u);
  EXPECT_EQ(memory.get<std::uint64_t>(136), 1u);
  const auto header_offset = memory.get<std::uint64_t>(channels + 2 * 32);
  const auto pixels_offset = memory.get<std::uint64_t>(channels + 2 * 32 + 8);
  EXPECT_EQ(memory.get<std::uint64_t>(channels + 2 * 32 + 16), kPixelBytes);
  EXPECT_EQ(header_offset, 64 + 2 * kFrameHeaderBytes);
  EXPECT_EQ(pixels_offset % 4096, 0u);
  const auto frame = test::make_frame(16, 8, 3);
  EXPECT_EQ(std::memcmp(memory.span().data() + slot + header_offset, frame.header_bytes.data(),
                        kFrameHeaderBytes),
            0)
      << "the header is the wire's";
  EXPECT_EQ(
      std::memcmp(memory.span().data() + slot + pixels_offset, frame.pixels.data(), kPixelBytes),
      0);
  EXPECT_EQ(memory.get<std::uint64_t>(channels + 8), memory.get<std::uint64_t>(channels + 32 + 8))
      << "channels of one band share their pixels";
  writer.end();
  EXPECT_EQ(memory.get<std::uint32_t>(132), 2u);
  EXPECT_EQ(memory.get<std::uint32_t>(128), 2u);
}

TEST(SharedRing, AReaderSeesWholePublicationsOnly) {
  const RingParams params = three_channels();
  const Memory memory(ring_bytes(params));
  RingWriter writer(memory.span(), params);
  const auto reader = RingReader::open(memory.span());
  ASSERT_TRUE(reader.has_value()) << reader.error().text;
  EXPECT_EQ(reader->newest(), 0u);
  EXPECT_FALSE(reader->view(0, 0).has_value()) << "nothing was published yet";
  writer.begin();
  fill(writer, 1);
  EXPECT_EQ(reader->newest(), 0u);
  EXPECT_FALSE(reader->view(1, 0).has_value()) << "not yet complete";
  writer.commit();
  EXPECT_EQ(reader->newest(), 1u);
  for (const std::size_t channel : {0u, 1u, 2u}) {
    const auto view = reader->view(1, channel);
    ASSERT_TRUE(view.has_value());
    const auto header = decode_frame_header(view->header);
    ASSERT_TRUE(header.has_value()) << header.error().text;
    EXPECT_EQ(header->frame_number, channel < 2 ? 2u : 3u);
    EXPECT_EQ(crc32c(view->pixels), header->payload_crc32c);
  }
  EXPECT_TRUE(reader->intact(1));
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(reader->welcome().data()),
                        reader->welcome().size()),
            kWelcome);
}

TEST(SharedRing, AReaderNoticesThatItsFrameIsOverwritten) {
  const RingParams params = three_channels();
  const Memory memory(ring_bytes(params));
  RingWriter writer(memory.span(), params);
  const auto reader = RingReader::open(memory.span());
  ASSERT_TRUE(reader.has_value());
  publish(writer, 1);
  ASSERT_TRUE(reader->view(1, 0).has_value());
  for (std::uint64_t number = 2; number <= 4; ++number) {
    publish(writer, number);
    EXPECT_TRUE(reader->intact(1)) << "as many as there are slots are kept, " << number;
  }
  writer.begin();
  EXPECT_FALSE(reader->intact(1)) << "from the first byte on";
  EXPECT_FALSE(reader->view(1, 0).has_value());
  EXPECT_TRUE(reader->intact(2));
  writer.commit();
  EXPECT_FALSE(reader->intact(1));
  EXPECT_TRUE(reader->view(5, 0).has_value());
}

TEST(SharedRing, AReaderTrustsNothing) {
  const RingParams params = three_channels();
  const std::size_t bytes = ring_bytes(params);
  std::mt19937_64 random(5);
  int opened = 0;
  for (int round = 0; round < 2000; ++round) {
    const Memory memory(bytes);
    RingWriter writer(memory.span(), params);
    publish(writer, 1);
    // One field of the fixed part or of the channel table changes, by a little or completely.
    const std::size_t offset = random() % (192 + 3 * 32) / 4 * 4;
    auto value = memory.get<std::uint32_t>(offset);
    value = random() % 2 == 0 ? value + static_cast<std::uint32_t>(random() % 129) - 64
                              : static_cast<std::uint32_t>(random());
    std::memcpy(memory.span().data() + offset, &value, sizeof value);
    const auto reader = RingReader::open(memory.span());
    if (!reader) continue;
    ++opened;
    for (std::size_t channel = 0; channel < reader->channel_count(); ++channel) {
      for (const std::uint64_t publication : {std::uint64_t{1}, reader->newest(), random()}) {
        if (const auto view = reader->view(publication, channel)) {
          static_cast<void>(crc32c(view->header) + crc32c(view->pixels));
        }
      }
    }
  }
  EXPECT_GT(opened, 50);
  EXPECT_FALSE(RingReader::open({}).has_value());
}

}  // namespace
}  // namespace emit::protocol
