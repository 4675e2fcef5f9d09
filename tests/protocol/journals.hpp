// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/mcap_reader.hpp"
#include "emit/v1/control.pb.h"
#include "protocol/host_frames.hpp"

namespace emit::test {

/// Wall time at which the journals of tests begin, ns TAI: 2027-01-15T08:00:00.
inline constexpr std::int64_t kWallNs = 1'800'000'000'000'000'000;

/// Folder of its own for each test, below the build tree.
class LogFolder {
 public:
  LogFolder() {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::path(EMIT_TEST_BINARY_DIR) /
            (std::string("log_folder_") + info->test_suite_name() + "_" + info->name());
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~LogFolder() { std::filesystem::remove_all(path_); }
  LogFolder(const LogFolder&) = delete;
  LogFolder& operator=(const LogFolder&) = delete;
  [[nodiscard]] std::filesystem::path file(const std::string& name) const { return path_ / name; }
  /// Returns the number of files in the folder, temporary ones included.
  [[nodiscard]] std::ptrdiff_t files() const {
    return std::distance(std::filesystem::directory_iterator(path_), {});
  }

 private:
  std::filesystem::path path_;
};

inline std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
inline void set_bytes(const std::filesystem::path& file, std::string_view bytes) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
}

/// Writes a journal as emitd would, one entry a millisecond of wall time.
class JournalMaker {
 public:
  JournalMaker(const std::filesystem::path& file, std::int64_t wall_ns, std::uint64_t sequence = 0)
      : wall_ns_(wall_ns), sequence_(sequence) {
    auto writer = protocol::LogWriter::create(file, {.chunk_bytes = 500, .software = "emitd test"});
    EXPECT_TRUE(writer) << writer.error().text;
    writer_ = std::make_unique<protocol::LogWriter>(std::move(*writer));
  }

  void run_start(std::uint64_t run_id, const std::string& sha256 = "aa") {
    v1::JournalEntry entry;
    auto& start = *entry.mutable_run_start();
    start.set_run_id(run_id);
    start.set_scenario_name("world, \"new\"");
    start.set_scenario_sha256(sha256);
    start.set_software("emitd test");
    start.set_device("llvmpipe");
    start.set_pacing("host-step");
    start.set_first_time_ns(1'500'000'000);
    write(entry);
  }
  void command(v1::Command::Kind kind) {
    v1::JournalEntry entry;
    entry.mutable_command()->set_kind(kind);
    write(entry);
  }
  /// Writes a host frame and the frame made from it, at number * 10 ms.
  void frame(std::uint64_t number, std::uint32_t flags = 0, bool rendered = true) {
    const auto sim_time_ns = static_cast<std::int64_t>(number) * 10'000'000;
    v1::JournalEntry entry;
    auto& host = *entry.mutable_host_frame();
    host.set_frame_number(number);
    host.set_sim_time_ns(sim_time_ns);
    host.set_run_id(77);
    host.mutable_seeker()->mutable_position_m()->set_x(0.1 * static_cast<double>(number));
    host.mutable_seeker()->mutable_world_from_body()->set_w(1.0);
    if (number % 3 == 0) host.mutable_environment()->set_air_k(280.0 + 1.0 / 3.0);
    write(entry);
    entry.Clear();
    auto& decision = *entry.mutable_frame();
    decision.set_frame_number(number);
    decision.set_host_frame_number(number);
    decision.set_sim_time_ns(sim_time_ns);
    decision.set_flags(flags);
    decision.set_rendered(rendered);
    decision.set_radiance_crc32c(static_cast<std::uint32_t>(number * 77));
    decision.mutable_sensor_pose()->mutable_position_m()->set_x(static_cast<double>(number));
    decision.add_entities()->set_entity_id(5);
    write(entry);
  }
  void frames(std::uint64_t first, std::uint64_t last) {
    for (std::uint64_t number = first; number <= last; ++number) frame(number);
  }
  /// Leaves sequence numbers out, as a journal that lost entries does.
  void lose(std::uint64_t entries) { sequence_ += entries; }
  [[nodiscard]] std::uint64_t sequence() const { return sequence_; }
  void flush() { ASSERT_TRUE(writer_->flush()); }
  void close() { ASSERT_TRUE(writer_->close()); }

 private:
  void write(v1::JournalEntry& entry) {
    entry.set_sequence(++sequence_);
    entry.set_wall_time_ns(wall_ns_);
    wall_ns_ += 1'000'000;
    ASSERT_TRUE(writer_->write_journal(entry));
  }

  std::unique_ptr<protocol::LogWriter> writer_;
  std::int64_t wall_ns_;
  std::uint64_t sequence_;
};

/// Messages of a file as "topic:bytes", in the order of the file.
inline std::vector<std::string> messages_of(const std::filesystem::path& file) {
  std::vector<std::string> out;
  auto reader = protocol::McapReader::open(file);
  EXPECT_TRUE(reader) << reader.error().text;
  if (!reader) return out;
  while (true) {
    const auto more = reader->next();
    EXPECT_TRUE(more) << more.error().text;
    if (!more || !*more) return out;
    const auto data = reader->message().data;
    out.push_back(reader->channel(reader->message().channel_id)->topic + ":" +
                  std::string(reinterpret_cast<const char*>(data.data()), data.size()));
  }
}

}  // namespace emit::test
