// SPDX-License-Identifier: Apache-2.0
// Exports for Foxglove, read by the MCAP library of its authors with the schemas in the file,
// against the poses that a host sent, the pixels in the log and the place that a pixel shows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <glm/gtc/quaternion.hpp>
#include <map>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "emit/physics/frames.hpp"
#include "emit/physics/geodesy.hpp"
#include "emit/protocol/record/frame_log.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/v1/frame.pb.h"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"
#include "support/peers.hpp"
#include "support/small_world.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;

constexpr std::size_t kFrames = 4;
constexpr std::int64_t kStepNs = 500'000'000;
/// 2020-06-21T10:00:00Z, the epoch of small_world().
constexpr std::int64_t kEpochNs = 1'592'733'600'000'000'000;

/// Message as peers/read_foxglove.js prints it.
struct Seen {
  std::string schema;
  std::int64_t log_time_ns = 0;
  std::int64_t publish_time_ns = 0;
  std::int64_t stamp_ns = 0;
  std::vector<std::string> fields;
  [[nodiscard]] double number(std::size_t index) const { return std::stod(fields.at(index)); }
};
using SeenTopics = std::map<std::string, std::vector<Seen>>;

SeenTopics read_peer(const std::string& modules, const std::string& file) {
  const ProcessResult peer =
      run_process({"env", "NODE_PATH=" + modules, "node",
                   EMIT_TEST_SOURCE_DIR "/server/tool/peers/read_foxglove.js", file});
  EXPECT_EQ(peer.exit_code, 0) << peer.err;
  SeenTopics out;
  std::istringstream text(peer.out);
  for (std::string line; std::getline(text, line);) {
    std::istringstream cells(line);
    std::vector<std::string> row;
    for (std::string cell; std::getline(cells, cell, '\t');) row.push_back(cell);
    Seen one{row.at(1), std::stoll(row.at(2)), std::stoll(row.at(3)), std::stoll(row.at(4)), {}};
    one.fields.assign(row.begin() + 5, row.end());
    out[row[0]].push_back(std::move(one));
  }
  return out;
}

/// The pose from the fields that begin at `first`: position, then x, y, z, w.
physics::Pose pose_at(const Seen& seen, std::size_t first) {
  return {{seen.number(first), seen.number(first + 1), seen.number(first + 2)},
          {seen.number(first + 6), seen.number(first + 3), seen.number(first + 4),
           seen.number(first + 5)}};
}

void expect_same(const physics::Pose& a, const physics::Pose& b) {
  EXPECT_EQ(a.position_world_m, b.position_world_m);
  EXPECT_EQ(a.world_from_body, b.world_from_body);
}

std::string hex(std::span<const std::byte> bytes) {
  std::string out;
  for (const std::byte one : bytes) out += fmt::format("{:02x}", static_cast<unsigned>(one));
  return out;
}

/// Poses that a host sends: the first is that of the scenario's own sensor at time 0.
protocol::HostFrameData sent(std::size_t index) {
  protocol::HostFrameData out;
  const auto i = static_cast<double>(index);
  out.frame_number = index + 1;
  out.sim_time_ns = static_cast<std::int64_t>(index) * kStepNs;
  out.run_id = 5;
  out.seeker.position_world_m = {-16.0 + 0.25 * i, -15.0, 15.0 + 0.1 * i};
  out.seeker.world_from_body =
      physics::world_from_body_look_at(out.seeker.position_world_m, {0.3 * i, 0.0, 0.0});
  out.entity_count = 1;
  out.entities[0].entity_id = 1;
  out.entities[0].has_pose = true;
  out.entities[0].pose.position_world_m = {5.0 - 0.2 * i, 5.0, 0.0};
  out.entities[0].pose.world_from_body =
      physics::world_from_body_heading_pitch_roll(0.1 * i, 0.0, 0.0);
  return out;
}

class FoxgloveExport : public ::testing::Test {
 protected:
  void SetUp() override {
    modules_ = node_peers({"@mcap/core", "@mcap/support", "protobufjs"});
    if (modules_.empty()) {
      GTEST_SKIP() << "node with @mcap/core is missing: deploy/scripts/install_deps.sh "
                      "--with-peers";
    }
    auto log = protocol::LogWriter::create(poses_);
    ASSERT_TRUE(log) << log.error().text;
    for (std::size_t i = 0; i < kFrames; ++i) {
      ASSERT_TRUE(log->write_host(sent(i), sent(i).sim_time_ns));
    }
    ASSERT_TRUE(log->close());
  }

  /// Records the journal of a rendered scene and its images.
  void record() {
    folder_.write("world.toml", small_world("per-frame"));
    folder_.write("emitd.toml",
                  "scenario = \"world.toml\"\n[pacing]\nmode = \"host-step\"\n"
                  "[host]\nudp = \"127.0.0.1:0\"\n[control]\ntcp = \"127.0.0.1:0\"\n");
    DaemonProcess daemon(folder_, {"--config", folder_.file("emitd.toml")});
    ASSERT_TRUE(daemon.wait_ready()) << folder_.read("stderr");
    const std::string url = "tcp://" + daemon.control();
    ToolProcess recorder(folder_, "record",
                         {"record", "--from", url, "--out", log_, "--with-frames", "--frames",
                          fmt::format("{}", kFrames)});
    // The recorder subscribes before it creates the log.
    while (!std::filesystem::exists(log_) && !recorder.ended()) std::this_thread::yield();
    const ProcessResult played = run_emit({"send", poses_, "--to", url, "--step"});
    ASSERT_EQ(played.exit_code, 0) << played.err;
    ASSERT_EQ(recorder.wait(), 0) << recorder.err();
  }

  SeenTopics exported(const std::string& log, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"log", "export", "foxglove", log, "--out", out_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProcessResult result = run_emit(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    messages_ = result.err;
    return read_peer(modules_, out_);
  }

  ScratchFolder folder_;
  std::string modules_;
  std::string poses_ = folder_.file("poses.mcap");
  std::string log_ = folder_.file("run.mcap");
  std::string out_ = folder_.file("run.foxglove.mcap");
  std::string messages_;
};

TEST_F(FoxgloveExport, another_program_reads_the_poses_pixels_and_camera_of_a_run) {
  ASSERT_NO_FATAL_FAILURE(record());
  const SeenTopics seen = exported(log_);
  EXPECT_EQ(messages_, "");
  std::map<std::string, std::string> schemas;
  for (const auto& [topic, all] : seen) {
    for (const Seen& one : all) {
      schemas[topic] = one.schema;
      EXPECT_EQ(one.log_time_ns, one.stamp_ns) << topic;
      EXPECT_EQ(one.publish_time_ns, one.stamp_ns) << topic;
    }
  }
  const std::map<std::string, std::string> expected{
      {"/camera/calibration", "foxglove.CameraCalibration"},
      {"/camera/image", "foxglove.RawImage"},
      {"/camera/preview", "foxglove.RawImage"},
      {"/events", "foxglove.Log"},
      {"/frames", "emit.v1.FrameDecision"},
      {"/seeker/location", "foxglove.LocationFix"},
      {"/seeker/pose", "foxglove.PoseInFrame"},
      {"/tf", "foxglove.FrameTransform"}};
  ASSERT_EQ(schemas, expected);

  // Poses are the ones sent, to the last bit, at the instants sent.
  const std::vector<Seen>& poses = seen.at("/seeker/pose");
  ASSERT_EQ(poses.size(), kFrames);
  for (std::size_t i = 0; i < kFrames; ++i) {
    EXPECT_EQ(poses[i].stamp_ns, kEpochNs + sent(i).sim_time_ns);
    EXPECT_EQ(poses[i].fields[0], "world");
    expect_same(pose_at(poses[i], 1), sent(i).seeker);
  }
  std::map<std::string, std::vector<Seen>> frames;
  for (const Seen& one : seen.at("/tf")) {
    EXPECT_EQ(one.fields[0], "world");
    frames[one.fields[1]].push_back(one);
  }
  ASSERT_EQ(frames.size(), 3U);
  ASSERT_EQ(frames["seeker"].size(), kFrames);
  ASSERT_EQ(frames["entity_1"].size(), kFrames);
  ASSERT_EQ(frames["camera"].size(), kFrames);
  for (std::size_t i = 0; i < kFrames; ++i) {
    expect_same(pose_at(frames["seeker"][i], 2), sent(i).seeker);
    expect_same(pose_at(frames["entity_1"][i], 2), sent(i).entities[0].pose);
  }

  // Pixels are those of the log.
  const std::vector<Seen>& images = seen.at("/camera/image");
  ASSERT_EQ(images.size(), kFrames);
  auto reader = protocol::FrameLogReader::open(log_);
  ASSERT_TRUE(reader) << reader.error().text;
  for (const Seen& image : images) {
    ASSERT_TRUE(reader->next().value_or(false));
    EXPECT_EQ(image.stamp_ns, kEpochNs + reader->frame().sim_time_ns());
    EXPECT_THAT(std::vector(image.fields.begin(), image.fields.end() - 1),
                testing::ElementsAre("camera", "48", "36", "32FC1", "192"));
    EXPECT_EQ(image.fields[5], hex(std::as_bytes(reader->pixels())));
  }
  for (const Seen& image : seen.at("/camera/preview")) {
    EXPECT_THAT(std::vector(image.fields.begin(), image.fields.end() - 1),
                testing::ElementsAre("camera", "48", "36", "rgb8", "144"));
    EXPECT_EQ(image.fields[5].size(), 2U * 3U * 48U * 36U);
  }

  // The camera shows a point of the scene where the renderer drew it.
  const Seen& calibration = seen.at("/camera/calibration").front();
  const physics::Pose camera = pose_at(frames["camera"].front(), 2);
  for (const auto& [x, y] : std::vector<std::pair<int, int>>{{5, 30}, {40, 33}}) {
    const ProcessResult explained =
        run_emit({"explain", folder_.file("world.toml"), "--time-s", "0", "--px",
                  fmt::format("{},{}", x, y), "--json", folder_.file("explain.json")});
    ASSERT_EQ(explained.exit_code, 0) << explained.err;
    std::string json = folder_.read("explain.json");
    std::erase_if(json, [](char c) { return c == ' ' || c == '\n'; });
    const std::size_t at = json.find("\"position_m\":[");
    ASSERT_NE(at, std::string::npos) << json;
    glm::dvec3 point{};
    ASSERT_EQ(std::sscanf(json.c_str() + at, "\"position_m\":[%lf,%lf,%lf]", &point.x, &point.y,
                          &point.z),
              3);
    const glm::dvec3 in_camera =
        glm::conjugate(camera.world_from_body) * (point - camera.position_world_m);
    ASSERT_GT(in_camera.z, 0.0);
    const double u = calibration.number(3) * in_camera.x / in_camera.z + calibration.number(5);
    const double v = calibration.number(7) * in_camera.y / in_camera.z + calibration.number(8);
    EXPECT_NEAR(u, x, 0.02);
    EXPECT_NEAR(v, y, 0.02);
  }

  // The place is that of the first pose over the ellipsoid.
  const Seen& place = seen.at("/seeker/location").front();
  const physics::GeoPlace geo{physics::Radians(place.number(1) * M_PI / 180.0),
                              physics::Radians(place.number(2) * M_PI / 180.0),
                              physics::Metres(place.number(3))};
  const physics::GeoPlace origin{physics::Radians(48.0 * M_PI / 180.0),
                                 physics::Radians(11.0 * M_PI / 180.0), physics::Metres(0.0)};
  const glm::dvec3 enu = glm::transpose(physics::ecef_from_enu(origin)) *
                         (physics::ecef_m(geo) - physics::ecef_m(origin));
  EXPECT_NEAR(glm::length(enu - sent(0).seeker.position_world_m), 0.0, 1e-6);

  std::string events;
  for (const Seen& one : seen.at("/events")) events += one.fields[0] + " " + one.fields[2] + "\n";
  EXPECT_THAT(events, HasSubstr("INFO run "));
  EXPECT_THAT(events, HasSubstr("pacing host-step"));
  EXPECT_THAT(events, HasSubstr("48 x 36 px in W m-2 sr-1"));
}

TEST_F(FoxgloveExport, its_schemas_are_those_that_foxglove_publishes) {
  if (node_peers({"@foxglove/schemas"}).empty()) {
    GTEST_SKIP() << "@foxglove/schemas is missing: deploy/scripts/install_deps.sh --with-peers";
  }
  ASSERT_NO_FATAL_FAILURE(record());
  exported(log_);
  const ProcessResult peer =
      run_process({"env", "NODE_PATH=" + modules_, "node",
                   EMIT_TEST_SOURCE_DIR "/server/tool/peers/compare_foxglove_schemas.js", out_});
  EXPECT_EQ(peer.exit_code, 0) << peer.err;
  // Six message types and the five that they are made of.
  EXPECT_THAT(peer.out, HasSubstr("\"messages\":11"));
}

TEST_F(FoxgloveExport, a_log_of_poses_gives_poses_and_transforms_of_a_range) {
  const SeenTopics seen = exported(poses_, {"--from-s", "0.5", "--to-s", "1"});
  EXPECT_THAT(messages_, HasSubstr("stamps count from 1970-01-01"));
  ASSERT_EQ(seen.size(), 2U);
  const std::vector<Seen>& poses = seen.at("/seeker/pose");
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_EQ(poses[0].stamp_ns, kStepNs);
  expect_same(pose_at(poses[1], 1), sent(2).seeker);
  EXPECT_EQ(seen.at("/tf").size(), 4U);
}

TEST_F(FoxgloveExport, what_cannot_be_exported_is_refused_and_leaves_no_file) {
  const auto refused = [&](const std::string& log, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"log", "export", "foxglove", log, "--out", out_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    ProcessResult result = run_emit(arguments);
    EXPECT_FALSE(std::filesystem::exists(out_));
    return result;
  };
  const ProcessResult none = refused(poses_, {"--from-s", "9"});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("no frame from 9 s on"));
  const ProcessResult other = refused(poses_, {"--run-id", "6"});
  EXPECT_EQ(other.exit_code, 2);
  const ProcessResult csv = refused(folder_.write("poses.csv", "sim_time_s\n"), {});
  EXPECT_EQ(csv.exit_code, 1);
  EXPECT_THAT(csv.err, HasSubstr("not an MCAP file"));
  // Simulation times may be negative, those of MCAP may not.
  auto log = protocol::LogWriter::create(folder_.file("early.mcap"));
  protocol::HostFrameData early = sent(0);
  early.sim_time_ns = -kStepNs;
  ASSERT_TRUE(log->write_host(early, 0));
  ASSERT_TRUE(log->close());
  const ProcessResult before = refused(folder_.file("early.mcap"), {});
  EXPECT_EQ(before.exit_code, 2);
  EXPECT_THAT(before.err, HasSubstr("before 1970"));
}

}  // namespace
}  // namespace emit::test
