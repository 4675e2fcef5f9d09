// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <span>
#include <variant>
#include <vector>

#include "emit/protocol/cigi.hpp"
#include "protocol/cigi/cigi_samples.hpp"

/// Bytes of single packets, which can only be written and read behind the first packet of a side.
namespace emit::test {

namespace cigi = protocol::cigi;

inline cigi::Sender sender_of(const cigi::Packet& packet) {
  return std::visit([](const auto& each) { return each.kSender; }, packet);
}

inline bool begins_message(const cigi::Packet& packet) {
  return std::holds_alternative<cigi::IgControl>(packet) ||
         std::holds_alternative<cigi::StartOfFrame>(packet);
}

/// Returns the bytes that come before a packet in a message: those of its side's first packet.
inline std::vector<std::byte> head_for(const cigi::Packet& packet, cigi::ByteOrder order,
                                       cigi::Version version = cigi::Version::v3_3) {
  if (begins_message(packet)) return {};
  const cigi::Packet first = sender_of(packet) == cigi::Sender::host
                                 ? cigi::Packet(cigi::IgControl{.database = 1})
                                 : cigi::Packet(cigi::StartOfFrame{.database = 1});
  return cigi_message(std::span(&first, 1), order, version);
}

/// Returns the bytes of one packet alone.
inline std::vector<std::byte> bytes_alone(const cigi::Packet& packet, cigi::ByteOrder order,
                                          cigi::Version version = cigi::Version::v3_3) {
  std::array<std::byte, 256> memory;
  cigi::Writer writer(memory, version, order);
  std::size_t before = 0;
  if (!begins_message(packet)) {
    const bool host = sender_of(packet) == cigi::Sender::host;
    EXPECT_FALSE(host ? writer.add(cigi::IgControl{}) : writer.add(cigi::StartOfFrame{}));
    before = writer.message().size();
  }
  const cigi::Fault fault = writer.add(packet);
  EXPECT_FALSE(fault) << fault.field;
  const auto part = writer.message().subspan(before);
  return {part.begin(), part.end()};
}

/// Reads one packet after the first one of its side.
inline cigi::Packet read_alone(std::span<const std::byte> bytes, cigi::Sender sender,
                               const cigi::Packet& like, cigi::ByteOrder order,
                               cigi::Version version = cigi::Version::v3_3) {
  auto message = head_for(like, order, version);
  const bool alone = message.empty();
  message.insert(message.end(), bytes.begin(), bytes.end());
  cigi::Reader reader(message, sender);
  cigi::Packet out;
  EXPECT_EQ(reader.next(out), cigi::Step::packet);
  EXPECT_EQ(reader.byte_order(), order);
  EXPECT_EQ(reader.version(), version);
  if (!alone) {
    EXPECT_EQ(reader.next(out), cigi::Step::packet);
  }
  cigi::Packet none;
  EXPECT_EQ(reader.next(none), cigi::Step::end);
  return out;
}

}  // namespace emit::test
