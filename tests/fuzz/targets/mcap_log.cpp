// SPDX-License-Identifier: Apache-2.0
// Fuzz target: logs and journals (MCAP), as records, as messages and as images.
#include <cstdlib>

#include "emit/protocol/record/frame_log.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/log_outline.hpp"
#include "emit/protocol/record/mcap_reader.hpp"
#include "emit/protocol/record/mcap_summary.hpp"
#include "emit/v1/control.pb.h"
#include "emit/v1/frame.pb.h"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"
#include "fuzz/sound_pose.hpp"

namespace {

using namespace emit;

void read_records(const std::filesystem::path& file) {
  auto reader = protocol::McapReader::open(file);
  if (!reader) return;
  for (;;) {
    const auto more = reader->next();
    if (!more || !*more) break;
    const auto& message = reader->message();
    if (const auto* channel = reader->channel(message.channel_id)) {
      static_cast<void>(reader->schema(channel->schema_id));
    }
  }
}

void read_messages(const std::filesystem::path& file) {
  auto reader = protocol::LogReader::open(file);
  if (!reader) return;
  for (;;) {
    const auto more = reader->next();
    if (!more || !*more) break;
    if (reader->topic() == protocol::LogTopic::host) {
      fuzz::require_sound(reader->host());
    } else {
      static_cast<void>(reader->journal().body_case());
    }
  }
}

void read_images(const std::filesystem::path& file) {
  auto reader = protocol::FrameLogReader::open(file);
  if (!reader) return;
  for (;;) {
    const auto more = reader->next();
    if (!more || !*more) break;
    const v1::RecordedFrame& frame = reader->frame();
    const std::size_t wanted = std::size_t{frame.width_px()} * frame.height_px();
    if (reader->pixels().size() != wanted) std::abort();
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto& file = fuzz::file_of(fuzz::as_bytes(data, size));
  read_records(file);
  read_messages(file);
  read_images(file);
  static_cast<void>(protocol::outline_log(file));
  static_cast<void>(protocol::read_mcap_summary(file));
  return 0;
}
