// SPDX-License-Identifier: Apache-2.0
// Command emit export gnss.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "emit/protocol/record/log.hpp"
#include "net/socket.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::vector<std::string> rows_of(const std::string& text) {
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) out.push_back(line);
  return out;
}

/// Returns the number of a key in a line of gpsd's JSON; NaN when there is none.
double gpsd_number(const std::string& row, const std::string& key) {
  const std::string head = "\"" + key + "\":";
  const std::size_t at = row.find(head);
  return at == std::string::npos ? std::nan("") : std::stod(row.substr(at + head.size()));
}

class CliExportGnss : public ::testing::Test {
 protected:
  void SetUp() override {
    // Poses stand above the origin for one second and then go north at 100 m/s.
    write_poses(2.0);
  }
  void write_poses(double length_s) {
    std::string text = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n";
    for (int i = 0; i <= static_cast<int>(std::lround(100.0 * length_s)); ++i) {
      const double time_s = 0.01 * i;
      text += fmt::format("{:.2f},0,{:.3f},250,0,0.7071067811865476,0.7071067811865476,0\n", time_s,
                          100.0 * std::max(0.0, time_s - 1.0));
    }
    write_text(log_, text);
  }
  [[nodiscard]] ProcessResult run(const std::string& format, std::vector<std::string> more = {},
                                  const std::string& out = "") const {
    std::vector<std::string> arguments = {"export",
                                          "gnss",
                                          log_,
                                          "--scenario",
                                          "box",
                                          "--format",
                                          format,
                                          "--set",
                                          "epoch_utc=2024-06-21T11:59:59.5Z",
                                          "--set",
                                          "place.lat_deg=45",
                                          "--set",
                                          "place.lon_deg=-10",
                                          "--set",
                                          "place.height_m=50"};
    if (out != "none") {
      arguments.insert(arguments.end(), {"--out", out.empty() ? out_ : out});
    }
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_emit(arguments);
  }

  TemporaryFolder folder_;
  const std::string log_ = folder_.file("poses.csv");
  const std::string out_ = folder_.file("out");
};

TEST_F(CliExportGnss, ecef_rows_are_ten_a_second_without_a_header) {
  const ProcessResult result = run("ecef-csv");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  EXPECT_THAT(result.out, HasSubstr("21 rows at 10 Hz from 201 poses, velocities from positions"));
  EXPECT_THAT(result.out, HasSubstr("first row: 2024-06-21 11:59:59.500 UTC, GPS week 2319, "
                                    "475217.500 s (GPS time is 18 s ahead of UTC)"));
  const auto rows = rows_of(read_text(out_));
  ASSERT_EQ(rows.size(), 21U);
  // The value is that of PROJ for 45 N, 10 W and 300 m.
  EXPECT_EQ(rows[0], "0.0,4449167.4317,-784508.2599,4487560.5409");
  EXPECT_EQ(rows[20].substr(0, 4), "2.0,");
}

TEST_F(CliExportGnss, geodetic_rows_have_the_place_of_the_scenario) {
  ASSERT_EQ(run("llh-csv").exit_code, 0);
  const auto rows = rows_of(read_text(out_));
  ASSERT_EQ(rows.size(), 21U);
  EXPECT_EQ(rows[0], "0.0,45.0000000000,-10.0000000000,300.0000");
  // A hundred metres to the north are 0.9 thousandths of a degree.
  double time_s = 0.0;
  double latitude_deg = 0.0;
  ASSERT_EQ(std::sscanf(rows[20].c_str(), "%lf,%lf", &time_s, &latitude_deg), 2);
  EXPECT_NEAR(latitude_deg, 45.0 + 100.0 / 111132.0, 1e-6);
}

TEST_F(CliExportGnss, sentences_are_at_tenths_of_utc_and_end_with_both_characters) {
  ASSERT_EQ(run("nmea", {"--geoid-m", "48.5", "--static-s", "0.5"}).exit_code, 0);
  const std::string text = read_text(out_);
  const auto rows = rows_of(text);
  ASSERT_EQ(rows.size(), 26U);
  EXPECT_THAT(rows[0], HasSubstr("$GPGGA,115959.00,4500.00000000,N,01000.00000000,W,1,12,0.80,"
                                 "251.500,M,48.500,M,,*"));
  EXPECT_THAT(rows[10], HasSubstr("$GPGGA,120000.00,"));
  for (const std::string& row : rows) {
    EXPECT_EQ(row.back(), '\r');
    EXPECT_LT(row.size(), 100U) << "gps-sdr-sim reads shorter lines";
  }
  EXPECT_EQ(text.back(), '\n');
}

TEST_F(CliExportGnss, gpsd_reads_the_sentences) {
  if (run_process({"sh", "-c", "command -v gpsdecode"}).exit_code != 0) {
    GTEST_SKIP() << "gpsdecode (Debian gpsd-clients) is not installed";
  }
  ASSERT_EQ(run("nmea", {"--geoid-m", "48.5"}).exit_code, 0);
  const ProcessResult decoded = run_process({"sh", "-c", "gpsdecode -j < " + out_});
  ASSERT_EQ(decoded.exit_code, 0) << decoded.err;
  std::vector<double> latitudes_deg;
  std::vector<double> heights_m;
  for (const std::string& row : rows_of(decoded.out)) {
    if (row.find("\"class\":\"TPV\"") == std::string::npos) continue;
    latitudes_deg.push_back(gpsd_number(row, "lat"));
    heights_m.push_back(gpsd_number(row, "altHAE"));
    EXPECT_NEAR(gpsd_number(row, "lon"), -10.0, 1e-7);
  }
  ASSERT_GE(latitudes_deg.size(), 19U) << decoded.out.substr(0, 2000);
  EXPECT_NEAR(latitudes_deg.front(), 45.0, 1e-7);
  EXPECT_GT(latitudes_deg.back(), 45.0007);
  for (const double height_m : heights_m) EXPECT_NEAR(height_m, 300.0, 0.01);
}

TEST_F(CliExportGnss, motion_rows_are_a_hundred_a_second_with_24_numbers) {
  const ProcessResult result = run("spirent-mot", {"--static-s", "1", "--json", "-"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json_value(result.out, "rows"), "301");
  EXPECT_NEAR(std::stod(json_value(result.out, "max_speed_m_s")), 100.0, 10.0);
  const auto rows = rows_of(read_text(out_));
  ASSERT_EQ(rows.size(), 301U);
  EXPECT_EQ(rows[0],
            "0 00:00:00.000,mot,v1_m1,4449167.431700,-784508.259898,4487560.540900,"
            "0.000000,0.000000,0.000000,0.000000,0.000000,0.000000,0.000000,0.000000,0.000000,"
            "0.000000000,0.000000000,0.000000000,0.000000000,0.000000000,0.000000000,"
            "0.000000000,0.000000000,0.000000000,0.000000000,0.000000000,0.000000000");
  for (const std::string& row : rows) EXPECT_EQ(std::ranges::count(row, ','), 26) << row;
  EXPECT_EQ(rows[300].substr(0, 15), "0 00:00:03.000,");
  const ProcessResult named = run("spirent-mot", {"--name", "v2_m1", "--rate-hz", "50"});
  EXPECT_EQ(named.exit_code, 0) << named.err;
  EXPECT_THAT(read_text(out_), HasSubstr("0 00:00:00.020,mot,v2_m1,"));
}

TEST_F(CliExportGnss, datagrams_follow_each_other_in_the_file) {
  ASSERT_EQ(run("skydel", {"--level", "1", "--name", "seeker"}).exit_code, 0);
  const std::string bytes = read_text(out_);
  constexpr std::size_t kSize = 110 + 48 + 6;
  ASSERT_EQ(bytes.size(), 201 * kSize);
  for (std::size_t at = 0; at < bytes.size(); at += kSize) {
    EXPECT_EQ(bytes.substr(at, 2), std::string("\x08\x01", 2));
    EXPECT_EQ(bytes.substr(at + kSize - 10, 10), std::string("\x06\0\0\0seeker", 10));
  }
}

TEST_F(CliExportGnss, datagrams_go_out_in_real_time) {
  const server::SocketContext context;
  auto socket = server::UdpSocket::open_bound(context, server::numeric_address("127.0.0.1", 0));
  ASSERT_TRUE(socket.has_value());
  const std::string to = "udp://" + server::to_string(socket->local_address());
  // The datagrams of a run fit into the socket's usual buffer.
  ASSERT_EQ(run("skydel", {"--rate-hz", "50"}).exit_code, 0);
  const std::string file = read_text(out_);
  for (const std::string speed : {"2", "max"}) {
    const auto start = std::chrono::steady_clock::now();
    const ProcessResult result =
        run("skydel", {"--rate-hz", "50", "--to", to, "--speed", speed}, "none");
    const double took_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.out, HasSubstr(to + ": 101 rows at 50 Hz"));
    if (speed == "2") {
      EXPECT_GE(took_s, 1.0);
    }
    std::vector<std::string> got;
    std::array<std::byte, 2048> space;
    while (true) {
      const server::IoResult one = socket->receive(space);
      if (one.status != server::IoStatus::done) break;
      got.emplace_back(reinterpret_cast<const char*>(space.data()), one.bytes);
    }
    ASSERT_EQ(got.size(), 103U);
    EXPECT_EQ(got.front(), "\x01") << "hello";
    EXPECT_EQ(got.back(), "\x02") << "bye";
    std::string all;
    for (std::size_t i = 1; i + 1 < got.size(); ++i) all += got[i];
    EXPECT_EQ(all, file);
  }
}

TEST_F(CliExportGnss, standard_output_holds_rows_alone) {
  const ProcessResult result = run("llh-csv", {}, "-");
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(rows_of(result.out).size(), 21U);
  EXPECT_THAT(result.err, HasSubstr("21 rows at 10 Hz"));
}

TEST_F(CliExportGnss, reads_the_logs_that_send_reads) {
  const std::string made = folder_.file("airfield.mcap");
  ASSERT_EQ(run_emit({"make-log", "airfield", "--duration-s", "2", "--out", made}).exit_code, 0);
  const ProcessResult result = run_emit(
      {"export", "gnss", made, "--scenario", "airfield", "--format", "spirent-mot", "--out", out_});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("201 rows at 100 Hz from 401 poses, velocities of the log"));
}

TEST_F(CliExportGnss, one_run_of_a_log_with_two_is_chosen) {
  const std::string two = folder_.file("two.mcap");
  {
    auto writer = protocol::LogWriter::create(two);
    ASSERT_TRUE(writer.has_value()) << writer.error().text;
    const auto pose = std::make_unique<protocol::HostFrameData>();
    for (std::int64_t i = 0; i < 40; ++i) {
      pose->run_id = i < 20 ? 7 : 8;
      pose->frame_number = static_cast<std::uint64_t>(i + 1);
      pose->sim_time_ns = i % 20 * 100'000'000;
      ASSERT_TRUE(writer->write_host(*pose, i));
    }
    ASSERT_TRUE(writer->close());
  }
  const auto export_two = [&](std::vector<std::string> more) {
    std::vector<std::string> arguments = {"export",   "gnss",    two,     "--scenario", "box",
                                          "--format", "llh-csv", "--out", out_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_emit(arguments);
  };
  EXPECT_THAT(export_two({}).err, HasSubstr("run 8 of the host begins with pose 21 at 0.000000 s, "
                                            "after run 7: --run-id chooses one"));
  const ProcessResult chosen = export_two({"--run-id", "8"});
  EXPECT_EQ(chosen.exit_code, 0) << chosen.err;
  EXPECT_THAT(chosen.out, HasSubstr("20 rows at 10 Hz from 20 poses"));
  EXPECT_THAT(export_two({"--run-id", "9"}).err, HasSubstr("none of 40 poses is of run 9"));
}

TEST_F(CliExportGnss, warns_of_what_the_readers_cannot_take) {
  write_poses(301.0);
  const ProcessResult many = run("ecef-csv");
  EXPECT_EQ(many.exit_code, 0);
  EXPECT_THAT(many.err, HasSubstr("3011 rows: gps-sdr-sim reads 3000 (300 s)"));
  write_poses(2.0);
  EXPECT_THAT(run("llh-csv", {"--rate-hz", "20"}).err,
              HasSubstr("gps-sdr-sim takes rows as 0.1 s apart"));
  // The log begins while the vehicle moves.
  std::string moving = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n";
  for (int i = 0; i < 100; ++i) moving += fmt::format("{:.2f},{},0,10,1,0,0,0\n", 0.01 * i, i);
  write_text(log_, moving);
  EXPECT_THAT(run("nmea", {"--static-s", "10"}).err,
              HasSubstr("the first pose moves at 100.0 m/s"));
}

TEST_F(CliExportGnss, refuses_what_makes_no_trajectory_and_keeps_the_old_file) {
  write_text(out_, "kept");
  const auto expect_refused = [&](const ProcessResult& result, int code, const char* text) {
    EXPECT_EQ(result.exit_code, code) << result.err;
    EXPECT_THAT(result.err, HasSubstr(text));
    EXPECT_EQ(read_text(out_), "kept");
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_.path()),
                            std::filesystem::directory_iterator()),
              2);
  };
  expect_refused(run("nmea", {"--set", "place.lat_deg=91"}), 78, "'lat_deg' is 91");
  expect_refused(run("nmea", {"--rate-hz", "3"}), 2, "nmea has times in steps of 10 ms");
  expect_refused(run("nmea", {"--name", "x"}), 2, "nmea holds no name");
  expect_refused(run("skydel", {"--name", "a,b"}), 2, "a name has no comma");
  expect_refused(run("nmea", {"--to", "udp://127.0.0.1:9"}), 2, "either --out FILE or --to");
  expect_refused(run("nmea", {"--to", "udp://127.0.0.1:9"}, "none"), 2, "needs --format skydel");
  expect_refused(run("skydel", {"--to", "tcp://127.0.0.1:9"}, "none"), 2, "is a udp:// URL");
  expect_refused(run("skydel", {"--speed", "-1"}), 2, "a positive number or max");
  expect_refused(run("rinex"), 2, "--format");
  const std::string head = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n";
  write_text(log_, head + "0,0,0,10,1,0,0,0\n0.5,0,0,10,1,0,0,0\n1.75,0,0,10,1,0,0,0\n");
  expect_refused(run("nmea"), 1,
                 "no pose for 1.250 s between pose 2 at 0.500000 s and pose 3 at 1.750000 s");
  EXPECT_EQ(run("nmea", {"--max-gap-s", "2"}, folder_.file("other")).exit_code, 0);
  std::filesystem::remove(folder_.file("other"));
  write_text(log_, head + "0,0,0,10,1,0,0,0\n0.5,0,0,10,1,0,0,0\n0.25,0,0,10,1,0,0,0\n");
  expect_refused(run("nmea"), 1, "poses.csv");
  write_text(log_, head + "0,0,0,-20000,1,0,0,0\n0.5,0,0,-20000,1,0,0,0\n");
  expect_refused(run("nmea"), 1, "below the ellipsoid at 0.000 s");
}

TEST(CliExport, help_says_what_is_untested) {
  const ProcessResult help = run_emit({"export", "gnss", "--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(help.out, HasSubstr("The Spirent and Skydel outputs are untested against hardware."));
}

}  // namespace
}  // namespace emit::test
