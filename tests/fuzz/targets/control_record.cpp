// SPDX-License-Identifier: Apache-2.0
// Fuzz target: the body of a control record, and the conversion of its parts at either end.
#include <memory>
#include <string>
#include <vector>

#include "client/client_connection.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/v1/control.pb.h"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/sound_pose.hpp"

namespace {

using namespace emit;

void take_host_frame(const v1::HostFrame& in) {
  static const auto frame = std::make_unique<protocol::HostFrameData>();
  if (protocol::from_proto(in, *frame) == protocol::DecodeStatus::ok) fuzz::require_sound(*frame);
}

void take_channel(const v1::ChannelInfo& in) {
  const client::ChannelDescription channel = client::describe_channel(in);
  if (const auto band = channel.spectral_band()) {
    fuzz::require(band->lo_um < band->hi_um, "a band has a lower and an upper limit");
  }
}

void take_journal(const v1::JournalEntry& entry) {
  if (entry.has_host_frame()) take_host_frame(entry.host_frame());
  if (!entry.has_frame()) return;
  physics::Pose pose;
  std::optional<protocol::PoseRates> rates;
  if (protocol::from_proto(entry.frame().sensor_pose(), pose, rates) ==
      protocol::DecodeStatus::ok) {
    fuzz::require_sound(pose);
  }
  for (const v1::EntityState& in : entry.frame().entities()) {
    protocol::EntityStateData entity;
    if (protocol::from_proto(in, entity) == protocol::DecodeStatus::ok && entity.has_pose) {
      fuzz::require_sound(entity.pose);
    }
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto body = fuzz::as_bytes(data, size);
  v1::ControlRecord record;
  if (!protocol::parse_control_record(body, record)) return 0;
  fuzz::require(record.body_case() != v1::ControlRecord::BODY_NOT_SET, "a record has a body");
  if (record.has_host_frame()) take_host_frame(record.host_frame());
  if (record.has_welcome()) {
    for (const v1::ChannelInfo& channel : record.welcome().channels()) take_channel(channel);
  }
  if (record.has_subscribed()) take_channel(record.subscribed().channel());
  if (record.has_status()) static_cast<void>(client::to_status(record.status()));
  if (record.has_journal()) take_journal(record.journal());

  std::vector<std::byte> wire;
  protocol::append_control_record(record, wire);
  fuzz::require(wire.size() > protocol::kRecordHeaderBytes, "a record can be said again");
  v1::ControlRecord again;
  fuzz::require(protocol::parse_control_record(
                    std::span(wire).subspan(protocol::kRecordHeaderBytes), again) &&
                    again.SerializeAsString() == record.SerializeAsString(),
                "and then reads the same");
  return 0;
}
