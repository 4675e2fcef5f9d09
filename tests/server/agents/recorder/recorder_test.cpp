// SPDX-License-Identifier: Apache-2.0
// Journals on full disks, and entries that a late recorder no longer gets.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "agents/journal_ring.hpp"
#include "agents/recorder/recorder.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/v1/control.pb.h"
#include "net/socket.hpp"
#include "support/daemon_process.hpp"
#include "support/fake_clock.hpp"

namespace emit::server {
namespace {

using test::ScratchFolder;

/// Guard while which no file of this process gets longer, as on a full disk.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{bytes, before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FullDisk() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit before_{};
  void (*handler_)(int) = nullptr;
};

/// A recorder and the conductor's end of its ring.
class RecorderRig {
 public:
  explicit RecorderRig(const config::JournalConfig& config)
      : recorder(context, config, 4), writer_(context.journal, context.journal_handed_over) {}

  void start_run() {
    JournalRunStart line;
    line.head = {0, clock.tai_ns(), JournalKind::run_start};
    line.run_id = 7;
    ASSERT_TRUE(writer_.write(line));
    turn();
  }
  /// Writes entries of some 10 kB.
  void write(int count) {
    std::vector<protocol::EntityStateData> entities(protocol::kMaxEntitiesPerFrame);
    for (protocol::EntityStateData& entity : entities) {
      entity.has_pose = true;
      entity.pose.position_world_m = {1.0, 2.0, 3.0};
      entity.pose.world_from_body = {0.5, 0.5, 0.5, 0.5};
    }
    for (int i = 0; i < count; ++i) {
      JournalHostFrame line;
      line.head = {0, clock.tai_ns(), JournalKind::host_frame};
      line.frame_number = static_cast<std::uint64_t>(i + 1);
      line.entity_count = protocol::kMaxEntitiesPerFrame;
      ASSERT_TRUE(writer_.write(line, std::span<const protocol::EntityStateData>(entities)));
      turn();
    }
  }
  void turn() {
    clock.advance(1'000'000);
    recorder.do_work(clock.tai_ns());
  }
  [[nodiscard]] std::uint64_t count(Counter id) const { return context.counters.get(id); }
  [[nodiscard]] std::uint64_t lines() const { return writer_.sequence(); }

  test::FakeClock clock;
  Context context{clock, 4u << 20, 4};
  Recorder recorder;

 private:
  JournalWriter writer_;
};

std::uint64_t entries_in(const std::filesystem::path& file) {
  auto log = protocol::LogReader::open(file);
  EXPECT_TRUE(log.has_value());
  std::uint64_t entries = 0;
  while (log && log->next().value_or(false)) ++entries;
  return entries;
}

TEST(Recorder, CountsOfAJournalWhoseDiskFillsUpAddUpWithTheFile) {
  rlim_t complete_bytes = RLIM_INFINITY;
  // The disk has room, is full within the first chunk, between chunks, and when the end is written.
  for (const double part : {0.0, 0.02, 0.5, 1.0}) {
    SCOPED_TRACE(part);
    ScratchFolder folder;
    config::JournalConfig config;
    config.file = folder.file("journal.mcap");
    RecorderRig rig(config);
    ASSERT_TRUE(rig.recorder.open().has_value());
    ASSERT_TRUE(rig.recorder.on_start());
    {
      const FullDisk disk(
          part == 0.0 ? RLIM_INFINITY
                      : static_cast<rlim_t>(part * static_cast<double>(complete_bytes)) - 100);
      rig.start_run();
      rig.write(100);
      rig.recorder.on_stop();
    }
    const std::uint64_t in_file =
        std::filesystem::exists(config.file) ? entries_in(config.file) : 0;
    if (part == 0.0) {
      complete_bytes = std::filesystem::file_size(config.file);
      EXPECT_EQ(in_file, 101U);
    } else if (part < 1.0) {
      EXPECT_EQ(in_file > 0, part > 0.1);
      EXPECT_LT(in_file, 101U);
    }
    EXPECT_EQ(rig.count(Counter::journal_entries), in_file);
    EXPECT_EQ(rig.count(Counter::journal_entries) + rig.count(Counter::journal_dropped),
              rig.lines());
    EXPECT_EQ(std::filesystem::exists(config.file), in_file > 0) << "an empty log stayed behind";
  }
}

TEST(Recorder, AStartOnAFullDiskSaysSoAndGoesOnUnlessTheJournalIsRequired) {
  ScratchFolder folder;
  std::filesystem::create_symlink("/dev/full", folder.path() / "full.mcap");
  for (const bool over_quota : {false, true}) {
    SCOPED_TRACE(over_quota);
    config::JournalConfig config;
    config.file = folder.file(over_quota ? "journal.mcap" : "full.mcap");
    std::optional<FullDisk> disk;
    if (over_quota) disk.emplace(3000);  // the header fits, the schemas do not
    RecorderRig rig(config);
    const auto opened = rig.recorder.open();
    ASSERT_TRUE(opened.has_value()) << opened.error().text;
    EXPECT_NE(opened->off.find(config.file.string()), std::string::npos) << opened->off;
    EXPECT_NE(opened->off.find(over_quota ? "File too large" : "No space left on device"),
              std::string::npos)
        << opened->off;
    EXPECT_FALSE(std::filesystem::exists(folder.file("journal.mcap")));
    ASSERT_TRUE(rig.recorder.on_start());
    rig.start_run();
    EXPECT_EQ(rig.count(Counter::journal_dropped), 1U);
    EXPECT_EQ(rig.count(Counter::journal_entries), 0U);
    config.required = true;
    RecorderRig strict(config);
    const auto refused = strict.recorder.open();
    ASSERT_FALSE(refused.has_value());
    EXPECT_EQ(refused.error().code, physics::ErrorCode::config);
    EXPECT_FALSE(std::filesystem::exists(folder.file("journal.mcap")));
  }
}

TEST(Recorder, AFolderThatDoesNotExistIsAnErrorWhetherTheJournalIsRequiredOrNot) {
  config::JournalConfig config;
  config.file = "/nowhere/journal.mcap";
  RecorderRig rig(config);
  const auto opened = rig.recorder.open();
  ASSERT_FALSE(opened.has_value());
  EXPECT_NE(opened.error().text.find("/nowhere"), std::string::npos);
}

/// A connected pair of sockets; the recorder writes to one, the test reads the other.
class Peer {
 public:
  Peer() {
    auto listener = TcpListener::open(context_, numeric_address("127.0.0.1", 0));
    EXPECT_TRUE(listener.has_value());
    auto client = TcpSocket::connect(context_, listener->local_address(), 5'000'000'000);
    EXPECT_TRUE(client.has_value());
    client_ = std::move(*client);
    SocketAddress from;
    int error = 0;
    server = listener->accept(from, error);
  }
  /// Turns the recorder until nothing more comes.
  std::vector<v1::ControlRecord> records(RecorderRig& rig) {
    std::vector<v1::ControlRecord> out;
    int idle = 0;
    while (idle < 20) {
      rig.turn();
      const IoResult got = client_.read_some(parser_.writable());
      idle = got.status == IoStatus::done ? 0 : idle + 1;
      if (got.status == IoStatus::done) parser_.commit(got.bytes);
      protocol::Record record;
      while (parser_.next(record) == protocol::ParseStatus::record) {
        EXPECT_TRUE(protocol::parse_control_record(record.body, out.emplace_back()));
      }
    }
    return out;
  }
  TcpSocket server;

 private:
  SocketContext context_;
  TcpSocket client_;
  protocol::RecordParser parser_{protocol::RecordLimits{}};
};

TEST(Recorder, GivesTheJournalOfTheRunToWhoeverAsksForIt) {
  config::JournalConfig config;
  config.memory_mib = 64;
  RecorderRig rig(config);
  JournalTap tap(rig.context.bells.recorder);
  rig.recorder.set_tap(&tap);
  rig.start_run();
  rig.write(3);
  EXPECT_FALSE(tap.is_ready()) << "nobody has asked";
  EXPECT_TRUE(tap.ask());
  EXPECT_FALSE(tap.ask()) << "it is asked already";
  rig.turn();
  ASSERT_TRUE(tap.is_ready());
  protocol::RecordParser parser({});
  protocol::Record record;
  v1::ControlRecord message;
  std::vector<std::uint64_t> sequences;
  const std::vector<std::byte> records = tap.take();
  for (std::size_t at = 0; at < records.size();) {
    const auto space = parser.writable();
    const std::size_t count = std::min(space.size(), records.size() - at);
    std::copy_n(records.begin() + static_cast<std::ptrdiff_t>(at), count, space.begin());
    parser.commit(count);
    at += count;
    while (parser.next(record) == protocol::ParseStatus::record) {
      ASSERT_TRUE(protocol::parse_control_record(record.body, message));
      sequences.push_back(message.journal().sequence());
      EXPECT_EQ(message.journal().has_run_start(), sequences.size() == 1);
    }
  }
  EXPECT_EQ(sequences, (std::vector<std::uint64_t>{1, 2, 3, 4}));
  // Another run begins: what came before is no part of it.
  rig.start_run();
  rig.write(1);
  EXPECT_TRUE(tap.ask());
  rig.turn();
  ASSERT_TRUE(tap.is_ready());
  EXPECT_LT(tap.take().size(), records.size());
}

TEST(Recorder, MemoryIsBoundedAndALateRecorderIsSentWhatItLacks) {
  config::JournalConfig config;
  config.memory_mib = 1;
  RecorderRig rig(config);
  ASSERT_TRUE(rig.recorder.open().has_value());
  ASSERT_TRUE(rig.recorder.on_start());
  rig.start_run();
  rig.write(20);
  EXPECT_GT(rig.context.journal_memory_bytes.load(), 0U);
  EXPECT_EQ(rig.count(Counter::journal_forgotten), 0U);
  rig.write(200);
  EXPECT_LE(rig.context.journal_memory_bytes.load(), 1U << 20);
  const std::uint64_t forgotten = rig.count(Counter::journal_forgotten);
  EXPECT_GT(forgotten, 100U);

  Peer peer;
  ASSERT_TRUE(static_cast<bool>(peer.server));
  ASSERT_TRUE(rig.context.to_recorder.push(
      {ClientCommand::Kind::add, 1, peer.server.fd(), 1, &peer.server}));
  const auto records = peer.records(rig);
  ASSERT_GT(records.size(), 2U);
  ASSERT_TRUE(records[0].has_journal_gap());
  EXPECT_EQ(records[0].journal_gap().first_sequence(), 1U);
  EXPECT_EQ(records[0].journal_gap().last_sequence(), forgotten);
  ASSERT_TRUE(records[1].has_journal());
  EXPECT_EQ(records[1].journal().sequence(), forgotten + 1);
  EXPECT_EQ(records.back().journal().sequence(), rig.lines());

  // A new run begins without a gap, and the rest of the old one is dropped.
  rig.start_run();
  EXPECT_LT(rig.context.journal_memory_bytes.load(), 4096U);
  Peer second;
  ASSERT_TRUE(rig.context.to_recorder.push(
      {ClientCommand::Kind::add, 2, second.server.fd(), 1, &second.server}));
  const auto of_new_run = second.records(rig);
  ASSERT_EQ(of_new_run.size(), 1U);
  EXPECT_TRUE(of_new_run[0].journal().has_run_start());

  rig.recorder.on_stop();
  for (Peer* each : {&peer, &second}) {
    const auto last = each->records(rig);
    ASSERT_FALSE(last.empty());
    EXPECT_TRUE(last.back().has_journal_end());
    EXPECT_EQ(last.back().journal_end().last_sequence(), rig.lines());
  }
}

}  // namespace
}  // namespace emit::server
