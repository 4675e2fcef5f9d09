// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/log.hpp"

#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "../../protocol/src/crc.hpp"
#include "../../protocol/src/wire_bytes.hpp"
#include "emit/protocol/record/mcap_reader.hpp"
#include "emit/protocol/record/mcap_writer.hpp"
#include "emit/v1/control.pb.h"
#include "protocol/host_frames.hpp"

namespace emit::protocol {
namespace {

using ::testing::HasSubstr;

class LogFile : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::path(EMIT_TEST_BINARY_DIR) /
            (std::string("log_test_") + info->name() + ".mcap");
    std::filesystem::remove(path_);
  }
  void TearDown() override { std::filesystem::remove(path_); }

  [[nodiscard]] std::string content() const {
    std::ifstream file(path_, std::ios::binary);
    std::string bytes(std::filesystem::file_size(path_), '\0');
    file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return bytes;
  }
  void set_content(std::string_view bytes) const {
    std::ofstream file(path_, std::ios::binary | std::ios::trunc);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }

  /// Writes host frames 1..count, 5 ms apart, each followed by a journal entry.
  static void write_messages(LogWriter& writer, std::uint64_t count) {
    auto frame = test::make_host_frame(2);
    for (std::uint64_t i = 1; i <= count; ++i) {
      frame->frame_number = i;
      frame->sim_time_ns = static_cast<std::int64_t>(i) * 5'000'000;
      ASSERT_TRUE(writer.write_host(*frame, frame->sim_time_ns));
      v1::JournalEntry entry;
      entry.set_sequence(i);
      entry.set_wall_time_ns(frame->sim_time_ns);
      entry.mutable_frame()->set_frame_number(i);
      entry.mutable_frame()->set_radiance_crc32c(static_cast<std::uint32_t>(i * 77));
      ASSERT_TRUE(writer.write_journal(entry));
    }
  }

  struct Counts {
    std::uint64_t host = 0;
    std::uint64_t journal = 0;
    std::string error;
    std::string truncation;
  };
  /// Reads the whole log and checks order and values.
  [[nodiscard]] Counts read_all() const {
    Counts counts;
    auto reader = LogReader::open(path_);
    if (!reader) {
      counts.error = reader.error().text;
      return counts;
    }
    while (true) {
      const auto more = reader->next();
      if (!more) {
        counts.error = more.error().text;
        break;
      }
      if (!*more) break;
      if (reader->topic() == LogTopic::host) {
        EXPECT_EQ(reader->host().frame_number, ++counts.host);
        EXPECT_EQ(reader->host().entity_count, 2u);
        EXPECT_EQ(reader->log_time_ns(), reader->host().sim_time_ns);
      } else {
        EXPECT_EQ(reader->journal().sequence(), ++counts.journal);
        EXPECT_EQ(reader->journal().frame().radiance_crc32c(), counts.journal * 77);
      }
    }
    counts.truncation = reader->truncation().value_or("");
    return counts;
  }

  std::filesystem::path path_;
};

TEST_F(LogFile, AMessageIsReadAsWhatItsTopicSays) {
  {
    auto writer = LogWriter::create(path_);
    ASSERT_TRUE(writer) << writer.error().text;
    write_messages(*writer, 1);
  }
  auto reader = LogReader::open(path_);
  ASSERT_TRUE(reader) << reader.error().text;
  ASSERT_TRUE(reader->next().value());
  ASSERT_EQ(reader->topic(), LogTopic::host);
  EXPECT_DEATH(static_cast<void>(reader->journal()), "topic == LogTopic::journal");
  ASSERT_TRUE(reader->next().value());
  EXPECT_DEATH(static_cast<void>(reader->host()), "topic == LogTopic::host");
}

TEST_F(LogFile, RoundTripsBothTopicsChunkedAndPlain) {
  for (const std::uint32_t chunk_bytes : {0u, 1u, 5000u, 1u << 20}) {
    auto writer = LogWriter::create(path_, {.chunk_bytes = chunk_bytes, .software = "test 1"});
    ASSERT_TRUE(writer) << writer.error().text;
    write_messages(*writer, 100);
    ASSERT_TRUE(writer->close());
    EXPECT_TRUE(writer->close());
    EXPECT_FALSE(writer->flush());
    const Counts counts = read_all();
    EXPECT_EQ(counts.error, "");
    EXPECT_EQ(counts.truncation, "");
    EXPECT_EQ(counts.host, 100u);
    EXPECT_EQ(counts.journal, 100u);
  }
}

TEST_F(LogFile, AKilledWriterLeavesAllButTheLastFlushInterval) {
  auto writer = LogWriter::create(path_, {.flush_interval_ns = 100'000'000});
  ASSERT_TRUE(writer);
  write_messages(*writer, 110);
  // The writer is still open, so the file is as a killed process leaves it.
  const Counts counts = read_all();
  EXPECT_EQ(counts.error, "");
  EXPECT_THAT(counts.truncation, HasSubstr("ends without a footer"));
  EXPECT_GE(counts.host, 90u);
  EXPECT_LT(counts.host, 110u);
  ASSERT_TRUE(writer->flush());
  EXPECT_EQ(read_all().journal, 110u);
}

TEST_F(LogFile, EveryCutOffTailIsReadableUpToTheCut) {
  {
    auto writer = LogWriter::create(path_, {.chunk_bytes = 900});
    ASSERT_TRUE(writer);
    write_messages(*writer, 6);
  }
  const std::string whole = content();
  EXPECT_EQ(read_all().truncation, "");
  std::uint64_t before = 0;
  std::mt19937 random(2);
  for (std::size_t size = 8; size < whole.size(); size += 1 + random() % 41) {
    set_content(std::string_view(whole).substr(0, size));
    const Counts counts = read_all();
    ASSERT_EQ(counts.error, "") << size;
    ASSERT_THAT(counts.truncation, HasSubstr("offset ")) << size;
    ASSERT_GE(counts.host + counts.journal, before) << size;
    before = counts.host + counts.journal;
  }
  EXPECT_EQ(before, 12u);
}

TEST_F(LogFile, ADamagedByteIsAnErrorOrChangesNothingThatIsRead) {
  {
    auto writer = LogWriter::create(path_, {.chunk_bytes = 900});
    ASSERT_TRUE(writer);
    write_messages(*writer, 4);
  }
  const std::string whole = content();
  std::mt19937 random(3);
  int errors = 0;
  for (int i = 0; i < 1000; ++i) {
    std::string bytes = whole;
    bytes[random() % bytes.size()] ^= static_cast<char>(1 + random() % 255);
    set_content(bytes);
    auto reader = LogReader::open(path_);
    if (!reader) {
      ++errors;
      continue;
    }
    while (true) {
      const auto more = reader->next();
      if (!more) {
        EXPECT_THAT(more.error().text, HasSubstr(path_.string() + ": offset "));
        ++errors;
        break;
      }
      if (!*more) break;
    }
  }
  // Most bytes are schemas, whose damage this reader does not see.
  EXPECT_GT(errors, 70);
}

TEST_F(LogFile, AFlippedBitInAChunkIsFoundByItsCrc) {
  {
    auto writer = LogWriter::create(path_);
    ASSERT_TRUE(writer);
    write_messages(*writer, 4);
  }
  std::string bytes = content();
  std::size_t offset = 8;  // offset of a record, on the way to the chunk
  auto length_at = [&](std::size_t at) {
    std::uint64_t length = 0;
    for (std::size_t i = 0; i < 8; ++i) {
      length |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[at + 1 + i]))
                << (8 * i);
    }
    return length;
  };
  while (bytes[offset] != 6) offset += 9 + length_at(offset);
  bytes[offset + 300] ^= 1;
  set_content(bytes);
  const Counts counts = read_all();
  EXPECT_THAT(counts.error, HasSubstr("offset " + std::to_string(offset) + ": chunk CRC"));
  EXPECT_EQ(counts.host, 0u);
}

/// The number of chunks is large enough for their index to leave memory. The end of the file must
/// point at each of them.
TEST_F(LogFile, TheIndexOfThousandsOfChunksPointsAtEachOfThem) {
  constexpr std::uint32_t kMessages = 4000;
  {
    auto mcap = McapWriter::create(path_, {.chunk_bytes = 1});
    ASSERT_TRUE(mcap) << mcap.error().text;
    const auto schema = mcap->add_schema("pkg.Other", "protobuf", "");
    const auto channel = mcap->add_channel(*schema, "camera", "protobuf");
    ASSERT_TRUE(channel);
    for (std::uint32_t i = 0; i < kMessages; ++i) {
      ASSERT_TRUE(mcap->write(*channel, i, i, i, {}));
    }
    ASSERT_TRUE(mcap->close());
  }
  const std::string whole = content();
  const auto bytes = std::as_bytes(std::span(whole));
  const std::size_t footer = whole.size() - 8 - 29;
  ASSERT_EQ(whole[footer], 2);
  const auto summary = wire::get<std::uint64_t>(bytes, footer + 9);
  const auto offsets = wire::get<std::uint64_t>(bytes, footer + 17);
  EXPECT_EQ(wire::get<std::uint32_t>(bytes, footer + 25),
            crc32(bytes.subspan(summary, footer + 25 - summary)));
  const auto length_at = [&](std::size_t at) { return wire::get<std::uint64_t>(bytes, at + 1); };
  std::uint32_t chunks = 0;
  std::size_t first_index = 0;
  for (std::size_t at = summary; at < offsets; at += 9 + length_at(at)) {
    if (whole[at] != 8) continue;
    if (chunks == 0) first_index = at;
    EXPECT_EQ(wire::get<std::uint64_t>(bytes, at + 9), chunks) << "start";
    EXPECT_EQ(wire::get<std::uint64_t>(bytes, at + 17), chunks) << "end";
    const auto chunk = wire::get<std::uint64_t>(bytes, at + 25);
    const auto record_bytes = wire::get<std::uint64_t>(bytes, at + 33);
    ASSERT_LT(chunk + record_bytes, summary);
    ASSERT_EQ(whole[chunk], 6);
    EXPECT_EQ(9 + length_at(chunk), record_bytes);
    EXPECT_EQ(wire::get<std::uint64_t>(bytes, chunk + 9), chunks);
    ASSERT_EQ(wire::get<std::uint32_t>(bytes, at + 41), 10u) << "one channel";
    const auto message_index = wire::get<std::uint64_t>(bytes, at + 45 + 2);
    ASSERT_EQ(message_index, chunk + record_bytes);
    ASSERT_EQ(whole[message_index], 7);
    EXPECT_EQ(wire::get<std::uint64_t>(bytes, at + 55), 9 + length_at(message_index));
    ++chunks;
  }
  EXPECT_EQ(chunks, kMessages);
  // The last summary offset is that of the chunk indexes.
  std::size_t last = offsets;
  while (last + 9 + length_at(last) < footer) last += 9 + length_at(last);
  EXPECT_EQ(whole[last + 9], 8);
  EXPECT_EQ(wire::get<std::uint64_t>(bytes, last + 10), first_index);
  EXPECT_EQ(wire::get<std::uint64_t>(bytes, last + 18), offsets - first_index);
}

/// Returns the folders of removed files that this process holds open.
std::vector<std::string> folders_of_nameless_files() {
  std::vector<std::string> folders;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;  // set for the descriptor of the iterator itself
    const auto target = std::filesystem::read_symlink(entry.path(), gone);
    if (target.string().ends_with(" (deleted)")) folders.push_back(target.parent_path().string());
  }
  return folders;
}

TEST_F(LogFile, TheIndexWaitsWithoutANameInTheFolderOfTheFileItself) {
  const std::filesystem::path folder = path_.string() + ".folder";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder / "links");
  // The name has the largest allowed length, so that a name beside it cannot be longer.
  const auto target = folder / std::string(255, 'x');
  const auto link = folder / "links" / "log.mcap";
  std::filesystem::create_symlink(target, link);
  for (const auto& path : {target, link}) {  // the first creates the target of the second
    auto writer = LogWriter::create(path);
    ASSERT_TRUE(writer) << writer.error().text;
    EXPECT_THAT(folders_of_nameless_files(),
                ::testing::Contains(std::filesystem::canonical(folder).string()));
    write_messages(*writer, 30);
    ASSERT_TRUE(writer->close());
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 2) << "no other name";
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / "links"), {}), 1);
    std::filesystem::rename(target, path_);
    EXPECT_EQ(read_all().host, 30u);
    std::filesystem::rename(path_, target);
  }
  std::filesystem::remove_all(folder);
}

/// Sets TMPDIR during its lifetime.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const char* folder) {
    if (const char* before = std::getenv("TMPDIR")) before_ = before;
    ::setenv("TMPDIR", folder, 1);
  }
  ~TemporaryFolder() { before_ ? ::setenv("TMPDIR", before_->c_str(), 1) : ::unsetenv("TMPDIR"); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

 private:
  std::optional<std::string> before_;
};

/// A file in memory has no folder that takes another file, whoever runs the test.
TEST_F(LogFile, AFileWhoseFolderTakesNoIndexIsWrittenOrStaysAsItWas) {
  const int fd = ::memfd_create("log", MFD_CLOEXEC);
  ASSERT_GE(fd, 0);
  ASSERT_EQ(::write(fd, "old log", 7), 7);
  path_ = "/proc/self/fd/" + std::to_string(fd);
  {
    const TemporaryFolder missing("/no/such/folder");
    const auto writer = LogWriter::create(path_);
    ASSERT_FALSE(writer);
    EXPECT_EQ(writer.error().code, physics::ErrorCode::io);
    EXPECT_THAT(writer.error().text, HasSubstr(path_.string() + ": no folder takes the index"));
    EXPECT_THAT(writer.error().text, HasSubstr("temporary folder: "));
    EXPECT_EQ(content(), "old log");
  }
  {
    const TemporaryFolder full("/proc");
    const auto writer = LogWriter::create(path_);
    ASSERT_FALSE(writer);
    EXPECT_THAT(writer.error().text, HasSubstr("; /proc: "));
    EXPECT_EQ(content(), "old log");
  }
  const TemporaryFolder takes(EMIT_TEST_BINARY_DIR);
  auto writer = LogWriter::create(path_);
  ASSERT_TRUE(writer) << writer.error().text;
  write_messages(*writer, 30);
  ASSERT_TRUE(writer->close());
  EXPECT_EQ(read_all().host, 30u);
  ::close(fd);
}

TEST_F(LogFile, OtherFilesAreRefusedByName) {
  EXPECT_THAT(read_all().error, HasSubstr("no such file"));
  set_content("t_sim,x,y,z\n");
  EXPECT_THAT(read_all().error, HasSubstr(path_.string() + ": offset 0: not an MCAP file"));
  set_content("");
  EXPECT_THAT(read_all().error, HasSubstr("not an MCAP file"));
  const auto directory = LogReader::open(path_.parent_path());
  ASSERT_FALSE(directory);
  EXPECT_THAT(directory.error().text, HasSubstr("is a directory"));
  const auto writer = LogWriter::create(path_ / "missing" / "a.mcap");
  ASSERT_FALSE(writer);
  EXPECT_EQ(writer.error().code, physics::ErrorCode::io);
}

TEST_F(LogFile, ATopicOfAnotherTypeIsRefusedAndOtherTopicsAreSkipped) {
  {
    auto mcap = McapWriter::create(path_, {});
    ASSERT_TRUE(mcap);
    const auto schema = mcap->add_schema("pkg.Other", "protobuf", "");
    const auto other = mcap->add_channel(*schema, "camera", "protobuf");
    const auto host = mcap->add_channel(*schema, "host", "protobuf");
    ASSERT_TRUE(host);
    ASSERT_TRUE(mcap->write(*other, 1, 0, 0, {}));
    ASSERT_TRUE(mcap->write(*host, 1, 0, 0, {}));
    EXPECT_FALSE(mcap->write(77, 1, 0, 0, {}));
    EXPECT_FALSE(mcap->write(*host, 1, -1, 0, {}));
  }
  EXPECT_THAT(read_all().error, HasSubstr("topic 'host' holds protobuf 'pkg.Other'"));
}

TEST_F(LogFile, InvalidHostFramesAreErrorsThatNameTheFrame) {
  {
    auto writer = LogWriter::create(path_);
    ASSERT_TRUE(writer);
    auto frame = test::make_host_frame(0);
    frame->seeker.world_from_body = {2.0, 0.0, 0.0, 0.0};
    ASSERT_TRUE(writer->write_host(*frame, 1));
  }
  EXPECT_THAT(read_all().error, HasSubstr("(frame 42): invalid pose"));
}

TEST_F(LogFile, WriteErrorsAreReportedAndFinal) {
  auto writer = LogWriter::create("/dev/full");
  ASSERT_FALSE(writer);
  EXPECT_THAT(writer.error().text, HasSubstr("/dev/full: offset 0: cannot write"));
}

/// A disk may fill up at any byte of the file. The writer counts exactly the messages that a reader
/// finds there.
TEST_F(LogFile, CountsTheMessagesThatAFullDiskTook) {
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit old{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &old), 0);
  for (const std::uint32_t chunk_bytes : {0U, 2048U, 6000U}) {
    for (rlim_t limit_bytes = 1000; limit_bytes < 14'000; limit_bytes += 97) {
      std::uint64_t counted = 0;
      const rlimit small{limit_bytes, old.rlim_max};
      ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
      {
        McapWriterOptions options;
        options.chunk_bytes = chunk_bytes;
        auto writer = McapWriter::create(path_, options);
        ASSERT_TRUE(writer);
        const auto schema = writer->add_schema("pkg.Any", "protobuf", "");
        const auto channel = writer->add_channel(*schema, "any", "protobuf");
        ASSERT_TRUE(channel);
        std::vector<std::byte> data;
        for (std::uint32_t i = 0; writer->write(*channel, i, i, i, data); ++i) {
          data.resize((i * 37) % 300);
        }
        counted = writer->messages_in_file();
      }
      ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &old), 0);
      std::uint64_t found = 0;
      if (std::filesystem::exists(path_)) {
        auto reader = McapReader::open(path_);
        ASSERT_TRUE(reader) << reader.error().text;
        for (auto more = reader->next(); more && *more; more = reader->next()) ++found;
      }
      EXPECT_EQ(counted, found) << limit_bytes << " bytes, chunks of " << chunk_bytes;
      std::filesystem::remove(path_);
    }
  }
  std::signal(SIGXFSZ, old_handler);
}

/// The messages decode with nothing but the file's own description.
TEST_F(LogFile, DescribesItselfWithoutTheProtoFiles) {
  {
    auto writer = LogWriter::create(path_);
    ASSERT_TRUE(writer);
    write_messages(*writer, 3);
  }
  auto reader = McapReader::open(path_);
  ASSERT_TRUE(reader);
  int decoded = 0;
  while (true) {
    const auto more = reader->next();
    ASSERT_TRUE(more) << more.error().text;
    if (!*more) break;
    const McapMessage& message = reader->message();
    const McapChannel* channel = reader->channel(message.channel_id);
    ASSERT_NE(channel, nullptr);
    const McapSchema* schema = reader->schema(channel->schema_id);
    ASSERT_NE(schema, nullptr);
    EXPECT_EQ(schema->encoding, "protobuf");

    google::protobuf::FileDescriptorSet files;
    ASSERT_TRUE(files.ParseFromString(schema->data));
    google::protobuf::DescriptorPool pool;
    for (const auto& file : files.file()) ASSERT_NE(pool.BuildFile(file), nullptr) << file.name();
    const auto* type = pool.FindMessageTypeByName(schema->name);
    ASSERT_NE(type, nullptr);
    google::protobuf::DynamicMessageFactory factory(&pool);
    const std::unique_ptr<google::protobuf::Message> dynamic(factory.GetPrototype(type)->New());
    ASSERT_TRUE(
        dynamic->ParseFromArray(message.data.data(), static_cast<int>(message.data.size())));
    const bool is_host = channel->topic == kHostTopic;
    const auto* field = type->FindFieldByName(is_host ? "frame_number" : "sequence");
    ASSERT_NE(field, nullptr);
    EXPECT_EQ(dynamic->GetReflection()->GetUInt64(*dynamic, field), message.sequence);
    ++decoded;
  }
  EXPECT_EQ(decoded, 6);
}

}  // namespace
}  // namespace emit::protocol
