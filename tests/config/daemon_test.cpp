// SPDX-License-Identifier: Apache-2.0
#include "config/config_support.hpp"
#include "emit/config/motion_controller.hpp"

namespace emit::config::testing {
namespace {

const std::string kCanned = "[source]\nkind = \"canned\"\n";

TEST_F(ConfigTest, an_empty_canned_daemon_has_the_defaults) {
  const auto loaded = daemon(kCanned);
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const DaemonConfig defaults;
  EXPECT_EQ(loaded->pacing.mode, defaults.pacing.mode);
  EXPECT_EQ(loaded->pacing.horizon_ns, 50'000'000);
  EXPECT_EQ(loaded->control.tcp, "127.0.0.1:7000");
  EXPECT_EQ(loaded->stream.queue_frames, 4U);
  EXPECT_TRUE(loaded->scenario.empty());
}

TEST_F(ConfigTest, every_daemon_key_is_read_and_survives_printing) {
  write("s.toml", "");
  std::filesystem::create_directories(folder_ / "frames");
  const std::string text =
      "scenario = \"s.toml\"\n"
      "[source]\nkind = \"canned\"\nfirst_time_s = -7.5\ncanned_dir = \"frames\"\ncanned_width_px "
      "= 320\n"
      "canned_height_px = 240\ncanned_frames = 3\n"
      "[pacing]\nmode = \"ig-clock\"\nrate_hz = 59.94\nbudget_ms = 4.5\nhorizon_ms = 20\n"
      "display_delay_ms = 7.25\n"
      "[host]\nudp = \"\"\nkey_file = \"k\"\n"
      "[control]\ntcp = \"[::1]:7100\"\nmax_clients = 3\nmax_record_bytes = 2048\n"
      "[stream]\nqueue_frames = 2\nudp_fragment_payload_bytes = 1400\n"
      "tcp_send_buffer_bytes = 70000\nudp_send_buffer_bytes = 100000\nmulticast_ttl = 9\n"
      "shm = \"rig.1\"\nshm_slots = 5\nshm_mode = \"0640\"\n"
      "[journal]\nfile = \"j.bin\"\nring_entries = 128\n"
      "[access]\nallow = [\"10.0.0.0/8\", \"::ffff:192.0.2.0/120\", \"fd00::1\"]\n"
      "multicast_groups = []\nmax_connections_per_peer = 5\nmax_host_frames_hz = 400\n"
      "max_control_records_hz = 6\n"
      "[tls]\ncertificate = \"a.pem\"\nkey = \"b.pem\"\nclient_ca = \"c.pem\"\n"
      "allow_names = [\"rig\", \"view\"]\nmax_handshakes = 2\n"
      "[device]\ngpu_index = 2\n"
      "[log]\nlevel = \"debug\"\nfile = \"l.txt\"\n";
  const auto first = daemon(text);
  ASSERT_TRUE(first.has_value()) << first.error().text;
  EXPECT_EQ(first->scenario, folder_ / "s.toml");
  EXPECT_EQ(first->source.kind, SourceKind::canned);
  EXPECT_EQ(first->source.first_time_ns, -7'500'000'000);
  EXPECT_EQ(first->source.canned_dir, folder_ / "frames");
  EXPECT_EQ(first->source.canned_width_px, 320U);
  EXPECT_EQ(first->source.canned_height_px, 240U);
  EXPECT_EQ(first->source.canned_frames, 3U);
  EXPECT_EQ(first->pacing.mode, PacingMode::ig_clock);
  EXPECT_EQ(first->pacing.rate_hz, 59.94);
  EXPECT_EQ(first->pacing.budget_ns, 4'500'000);
  EXPECT_EQ(first->pacing.horizon_ns, 20'000'000);
  EXPECT_EQ(first->pacing.display_delay_ns, 7'250'000);
  EXPECT_EQ(first->host.udp, "");
  EXPECT_EQ(first->control.tcp, "[::1]:7100");
  EXPECT_EQ(first->control.max_clients, 3U);
  EXPECT_EQ(first->control.max_record_bytes, 2048U);
  EXPECT_EQ(first->stream.queue_frames, 2U);
  EXPECT_EQ(first->stream.udp_fragment_payload_bytes, 1400U);
  EXPECT_EQ(first->stream.tcp_send_buffer_bytes, 70000U);
  EXPECT_EQ(first->stream.udp_send_buffer_bytes, 100000U);
  EXPECT_EQ(first->stream.multicast_ttl, 9);
  EXPECT_EQ(first->stream.shm, "rig.1");
  EXPECT_EQ(first->stream.shm_slots, 5U);
  EXPECT_EQ(first->stream.shm_mode, 0640U);
  EXPECT_EQ(first->journal.file, folder_ / "j.bin");
  EXPECT_EQ(first->journal.ring_entries, 128U);
  EXPECT_EQ(first->host.key_file, folder_ / "k");
  ASSERT_EQ(first->access.allow.size(), 3U);
  EXPECT_EQ(to_string(first->access.allow[0]), "10.0.0.0/8");
  EXPECT_EQ(to_string(first->access.allow[1]), "192.0.2.0/24");
  EXPECT_EQ(to_string(first->access.allow[2]), "fd00::1/128");
  EXPECT_TRUE(first->access.multicast_groups.empty());
  EXPECT_EQ(first->access.max_connections_per_peer, 5U);
  EXPECT_EQ(first->access.max_host_frames_hz, 400U);
  EXPECT_EQ(first->access.max_control_records_hz, 6U);
  EXPECT_EQ(first->tls.certificate, folder_ / "a.pem");
  EXPECT_EQ(first->tls.key, folder_ / "b.pem");
  EXPECT_EQ(first->tls.client_ca, folder_ / "c.pem");
  EXPECT_EQ(first->tls.allow_names, (std::vector<std::string>{"rig", "view"}));
  EXPECT_EQ(first->tls.max_handshakes, 2U);
  EXPECT_EQ(first->device.gpu_index, 2);
  EXPECT_EQ(first->log.level, "debug");
  EXPECT_EQ(first->log.file, folder_ / "l.txt");

  const std::string printed = print_daemon(*first);
  const auto second = daemon(printed);
  ASSERT_TRUE(second.has_value()) << second.error().text;
  EXPECT_EQ(print_daemon(*second), printed);
}

TEST_F(ConfigTest, daemon_combinations_and_ranges_are_checked) {
  EXPECT_EQ(daemon_error("[pacing]\nrate_hz = 100\n"),
            "d.toml:1:1: key 'scenario' is missing (only a canned source goes without)");
  EXPECT_EQ(daemon_error(kCanned + "[pacing]\nmode = \"ig-clock\"\nhorizon_ms = 5\n"
                                   "display_delay_ms = 6\n"),
            "d.toml:6:20: 'display_delay_ms' (6) is beyond 'horizon_ms' (5): every frame would be "
            "stale");
  EXPECT_EQ(daemon_error(kCanned + "[control]\ntcp = \"localhost\"\n"),
            "d.toml:4:7: 'tcp' is 'localhost', must be address:port");
  EXPECT_EQ(daemon_error(kCanned + "[control]\ntcp = \"\"\n"),
            "d.toml:4:7: 'tcp' is '', must be address:port");
  EXPECT_EQ(daemon_error(kCanned + "[host]\nudp = \"a:70000\"\n"),
            "d.toml:4:7: 'udp' is 'a:70000', must be address:port or empty");
  EXPECT_EQ(daemon_error(kCanned + "[stream]\nqueue_frames = 14\n"),
            "d.toml:4:16: 'queue_frames' is 14, must be 1 .. 13");
  EXPECT_EQ(daemon_error(kCanned + "[stream]\nshm = \"../rig\"\n"),
            "d.toml:4:7: 'shm' is '../rig', must be 1 to 64 letters, digits, '_', '-' or '.', "
            "beginning with a letter or digit");
  EXPECT_EQ(daemon_error(kCanned + "[stream]\nshm_mode = \"0666\"\n"),
            "d.toml:4:12: 'shm_mode' is '0666', must be one of: 0600, 0640, 0644");
  EXPECT_EQ(daemon_error(kCanned + "[log]\nlevel = \"loud\"\n"),
            "d.toml:4:9: 'level' is 'loud', must be one of: error, warn, info, debug");
  EXPECT_EQ(daemon_error(kCanned + "canned_dir = \"none\"\n"),
            "d.toml:3:14: 'canned_dir': none: no such folder");
  EXPECT_EQ(daemon_error(kCanned + "[stream]\nqueue = 2\n"),
            "d.toml:4:1: unknown key 'queue', did you mean 'queue_frames'?");
  EXPECT_EQ(daemon_error(kCanned + "[sensor]\nwidth_px = 64\n"),
            "d.toml:3:2: unknown key 'sensor', which belongs to the scenario file that 'scenario' "
            "names");
}

TEST_F(ConfigTest, timing_sections_are_read_printed_and_checked) {
  const auto defaults = daemon(kCanned);
  ASSERT_TRUE(defaults.has_value()) << defaults.error().text;
  EXPECT_EQ(defaults->realtime.scheduler, SchedulerKind::other);
  EXPECT_FALSE(defaults->realtime.lock_memory);
  EXPECT_TRUE(defaults->clock.ptp_socket.empty());
  EXPECT_EQ(defaults->trigger.udp, "127.0.0.1:7003");
  const auto first = daemon(kCanned +
                            "[pacing]\nmode = \"trigger\"\n"
                            "[trigger]\nudp = \"[::1]:9\"\npeer = \"::1\"\n"
                            "[clock]\nptp_socket = \"/run/ptp\"\nptp_domain = 5\n"
                            "[realtime]\nscheduler = \"fifo\"\npriority = 9\n"
                            "cpus = \"sender=1-2\"\nlock_memory = true\nheap_touch_mib = 3\n"
                            "required = true\n");
  ASSERT_TRUE(first.has_value()) << first.error().text;
  EXPECT_EQ(first->pacing.mode, PacingMode::trigger);
  EXPECT_EQ(first->trigger.udp, "[::1]:9");
  EXPECT_EQ(first->trigger.peer, "::1");
  EXPECT_EQ(first->clock.ptp_socket, "/run/ptp");
  EXPECT_EQ(first->clock.ptp_domain, 5U);
  EXPECT_EQ(first->realtime.scheduler, SchedulerKind::fifo);
  EXPECT_EQ(first->realtime.priority, 9U);
  EXPECT_EQ(first->realtime.cpus, "sender=1-2");
  EXPECT_TRUE(first->realtime.lock_memory);
  EXPECT_EQ(first->realtime.heap_touch_mib, 3U);
  EXPECT_TRUE(first->realtime.required);
  const std::string printed = print_daemon(*first);
  const auto second = daemon(printed);
  ASSERT_TRUE(second.has_value()) << second.error().text;
  EXPECT_EQ(print_daemon(*second), printed);

  EXPECT_EQ(daemon_error(kCanned + "[trigger]\nudp = \"\"\n"),
            "d.toml:4:7: 'udp' is '', must be address:port");
  EXPECT_THAT(daemon_error(kCanned + "[realtime]\ncpus = \"pilot=1\"\n"),
              ::testing::StartsWith("d.toml:4:8: 'cpus': 'pilot=1' is not AGENT=CORE"));
  EXPECT_EQ(daemon_error(kCanned + "[realtime]\npriority = 3\n"),
            "d.toml:4:12: 'priority' is 3, must be 4 .. 99");
}

const std::string kRing =
    "{ min_deg = -90, max_deg = 90, rate_deg_s = 180, acceleration_deg_s2 = 1800 }";

/// Section of a motion simulator with so many axes.
std::string motion_section(int axes, const std::string& more = "") {
  std::string out = kCanned + "[motion]\ncontroller = \"10.0.0.5:7010\"\n" + more + "axes = [";
  for (int i = 0; i < axes; ++i) out += kRing + ", ";
  return out + "]\n";
}

TEST_F(ConfigTest, a_motion_simulator_is_read_printed_and_checked) {
  EXPECT_FALSE(daemon(kCanned)->motion.enabled());
  const auto first = daemon(motion_section(
      5,
      "unit_rings = \"pitch-yaw-roll\"\ntarget_rings = \"elevation-azimuth\"\n"
      "target_entity = 7\nlab_deg = [90, 0, 0]\nrate_hz = 2000\nfeedback_timeout_ms = 5\n"
      "host_timeout_ms = 50\ncontroller_timeout_ms = 30\nsoft_frac = 0.5\n"));
  ASSERT_TRUE(first.has_value()) << first.error().text;
  const MotionConfig& motion = first->motion;
  EXPECT_TRUE(motion.enabled());
  EXPECT_EQ(motion.unit_rings, "pitch-yaw-roll");
  EXPECT_EQ(motion.target_rings, TargetRings::elevation_azimuth);
  EXPECT_EQ(motion.target_entity, 7U);
  ASSERT_EQ(motion.axes.size(), 5U);
  EXPECT_NEAR(motion.axes[4].rate_rad_s, 3.14159265, 1e-8);
  EXPECT_NEAR(motion.lab_rad[0], 1.57079633, 1e-8);
  EXPECT_EQ(motion.feedback_timeout_ns, 5'000'000);
  EXPECT_EQ(motion.controller_timeout_ms, 30U);
  const std::string printed = print_daemon(*first);
  const auto second = daemon(printed);
  ASSERT_TRUE(second.has_value()) << second.error().text;
  EXPECT_EQ(print_daemon(*second), printed);

  EXPECT_THAT(daemon_error(motion_section(3, "rate_hz = 50\n")),
              ::testing::HasSubstr("'feedback_timeout_ms' (20) is less than two periods of "
                                   "'motion.rate_hz' (40)"));
  EXPECT_THAT(daemon_error(motion_section(3) + "[pacing]\nhorizon_ms = 0\n"),
              ::testing::HasSubstr("'horizon_ms' (0) is less than two periods"));
  EXPECT_THAT(daemon_error(motion_section(3) + "[pacing]\ndisplay_delay_ms = 60\n"),
              ::testing::HasSubstr("'display_delay_ms' (60) is beyond 'horizon_ms' (50)"));
  EXPECT_THAT(daemon_error(motion_section(5)),
              ::testing::HasSubstr("'axes' has 5 axes, must have 3: three rings of the unit"));
  EXPECT_THAT(
      daemon_error(motion_section(3, "target_rings = \"azimuth-elevation\"\ntarget_entity = 1\n")),
      ::testing::HasSubstr("'axes' has 3 axes, must have 5"));
  EXPECT_THAT(daemon_error(motion_section(5, "target_rings = \"azimuth-elevation\"\n")),
              ::testing::HasSubstr("'target_entity' is missing"));
  EXPECT_THAT(daemon_error(kCanned + "[motion]\ncontroller = \"table\"\n"),
              ::testing::HasSubstr("'controller': 'table' must be address:port, "
                                   "memory:PATH@OFFSET or acutrol:address:port"));
  EXPECT_THAT(daemon_error(kCanned + "[motion]\ncontroller = \"a:1\"\naxes = [ { min_deg = 5, "
                                     "max_deg = 5, rate_deg_s = 1, acceleration_deg_s2 = 1 } ]\n"),
              ::testing::HasSubstr("axis 1 has no travel"));
}

TEST(MotionController, is_told_by_its_form) {
  using Kind = MotionController::Kind;
  const auto udp = parse_motion_controller("[::1]:7010");
  ASSERT_TRUE(udp.has_value());
  EXPECT_EQ(udp->kind, Kind::udp);
  EXPECT_EQ(udp->address, "[::1]:7010");
  const auto acutrol = parse_motion_controller("acutrol:10.0.0.5:9878");
  ASSERT_TRUE(acutrol.has_value());
  EXPECT_EQ(acutrol->kind, Kind::acutrol);
  EXPECT_EQ(acutrol->address, "10.0.0.5:9878");
  const auto memory = parse_motion_controller("memory:/dev/shm/a@b@4096");
  ASSERT_TRUE(memory.has_value());
  EXPECT_EQ(memory->kind, Kind::memory);
  EXPECT_EQ(memory->memory.file, "/dev/shm/a@b");
  EXPECT_EQ(memory->memory.offset_bytes, 4096U);
  EXPECT_EQ(parse_motion_controller("memory:/dev/rfm0@0x10008")->memory.offset_bytes, 0x10008U);
}

TEST(MotionController, other_forms_are_refused_with_what_is_wrong) {
  for (const char* text : {"memory:", "memory:/x", "memory:/x@", "memory:x@0", "memory:@0",
                           "memory:/@0", "memory:/x@-8", "memory:/x@8k", "memory:/x@0x",
                           "memory:/x@ 8", "memory:/x@9223372036854775808", "memory:7010"}) {
    const auto parsed = parse_motion_controller(text);
    ASSERT_FALSE(parsed.has_value()) << text;
    EXPECT_THAT(parsed.error().text, ::testing::HasSubstr("must be PATH@OFFSET")) << text;
  }
  EXPECT_THAT(parse_motion_controller("memory:/x@4").error().text,
              ::testing::HasSubstr("multiple of 8 bytes"));
  for (const char* text : {"acutrol:", "acutrol:10.0.0.5", "acutrol::9878", "acutrol:a:65536",
                           "other:10.0.0.5:9878", ""}) {
    const auto parsed = parse_motion_controller(text);
    ASSERT_FALSE(parsed.has_value()) << text;
    EXPECT_THAT(parsed.error().text, ::testing::HasSubstr("must be address:port")) << text;
  }
}

TEST_F(ConfigTest, an_unknown_scenario_is_reported_where_it_is_named) {
  EXPECT_THAT(daemon_error("scenario = \"no_such_scenario\"\n"),
              ::testing::StartsWith(
                  "d.toml:1:12: scenario 'no_such_scenario' is neither a file nor shipped"));
}

TEST_F(ConfigTest, file_environment_and_set_apply_in_that_order) {
  const std::string text = kCanned + "[pacing]\nrate_hz = 10\nhorizon_ms = 11\nbudget_ms = 12\n";
  options_.environment = {"EMIT_PACING_RATE_HZ=20", "EMIT_PACING_HORIZON_MS=21",
                          "EMIT_THERMAL_STEPS=9", "PACING_BUDGET_MS=99"};
  const auto loaded =
      daemon(text, {"pacing.rate_hz=30", "device.gpu_index=1", "log.level=warn", "host.udp="});
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  EXPECT_EQ(loaded->pacing.rate_hz, 30.0);
  EXPECT_EQ(loaded->pacing.horizon_ns, 21'000'000);
  EXPECT_EQ(loaded->pacing.budget_ns, 12'000'000);
  EXPECT_EQ(loaded->device.gpu_index, 1);
  EXPECT_EQ(loaded->log.level, "warn");
  EXPECT_EQ(loaded->host.udp, "");
}

/// A misspelt variable must not be ignored. Keys of scenarios are known to the daemon's loader and
/// the other way round, because one environment serves both.
TEST_F(ConfigTest, unknown_names_in_the_environment_are_errors_with_a_suggestion) {
  options_.environment = {"EMIT_PACING_RATEHZ=5", "EMIT_FOO=1", "EMIT_DATA_DIR=/x", "HOME=/root"};
  EXPECT_EQ(daemon_error(kCanned),
            "EMIT_PACING_RATEHZ: unknown environment variable, did you mean EMIT_PACING_RATE_HZ?\n"
            "EMIT_FOO: unknown environment variable: no key has this name");
  options_.environment = {"EMIT_PACING_RATE_HZ=5", "EMIT_THERMAL_STEP=5", "EMIT_OBJECT_SCALE=2"};
  EXPECT_EQ(scenario_error(""),
            "EMIT_THERMAL_STEP: unknown environment variable, did you mean EMIT_THERMAL_STEPS?\n"
            "EMIT_OBJECT_SCALE: unknown environment variable: no key has this name");
}

TEST_F(ConfigTest, faults_in_environment_and_set_name_them) {
  options_.environment = {"EMIT_PACING_RATE_HZ=fast"};
  EXPECT_EQ(daemon_error(kCanned), "EMIT_PACING_RATE_HZ: 'rate_hz' must be a number, not a string");
  options_.environment->clear();
  EXPECT_EQ(daemon_error(kCanned, {"pacing.rte_hz=3"}),
            "--set pacing.rte_hz=3: unknown key 'rte_hz', did you mean 'rate_hz'?");
  EXPECT_EQ(daemon_error(kCanned, {"pacng.rate_hz=3"}),
            "--set pacng.rate_hz=3: unknown key 'pacng', did you mean 'pacing'?");
  EXPECT_EQ(daemon_error(kCanned, {"pacing.rate_hz=0"}),
            "--set pacing.rate_hz=0: 'rate_hz' is 0, must be 0.1 .. 2000");
  EXPECT_EQ(daemon_error(kCanned, {"pacing.rate_hz"}),
            "--set pacing.rate_hz: expected key=value, such as thermal.steps=90");
  EXPECT_EQ(daemon_error(kCanned, {"pacing..rate_hz=1"}),
            "--set pacing..rate_hz=1: expected key=value, such as thermal.steps=90");
  EXPECT_EQ(daemon_error(kCanned, {"source.kind.x=1"}),
            "--set source.kind.x=1: 'kind' is a string, which has no key 'x'");
}

TEST_F(ConfigTest, overrides_are_sorted_by_the_file_they_belong_to) {
  const std::vector<std::string> overrides = {"thermal.steps=9", "pacing.rate_hz=1",
                                              "object[a].scale=2", "scenario=box", "wrong.x=1"};
  const SplitOverrides split = split_overrides(overrides);
  EXPECT_EQ(split.scenario, (std::vector<std::string>{"thermal.steps=9", "object[a].scale=2"}));
  EXPECT_EQ(split.daemon,
            (std::vector<std::string>{"pacing.rate_hz=1", "scenario=box", "wrong.x=1"}));
}

std::string cigi_section(const std::string& keys) {
  return "[cigi]\nlisten = \"127.0.0.1:8000\"\nhost = \"127.0.0.1:8001\"\n" + keys;
}

TEST_F(ConfigTest, parts_of_a_cigi_host_are_read_and_printed) {
  const auto result =
      daemon(kCanned + cigi_section("entities = [{ id = 12, entity = 1 }]\n"
                                    "parts = [{ id = 12, part = 2, entity = 3, on_part = 1 },\n"
                                    "  { id = 12, part = 1, entity = 2, joint_m = [0.5, 0, -2], "
                                    "joint_yaw_pitch_roll_deg = [0, 90, 0] }]\n"));
  ASSERT_TRUE(result.has_value()) << result.error().text;
  EXPECT_EQ(print_daemon(*daemon(print_daemon(*result))), print_daemon(*result));
  ASSERT_EQ(result->cigi.parts.size(), 2U);
  EXPECT_EQ(result->cigi.parts[0].on_part, 1);
  EXPECT_EQ(result->cigi.parts[1].on_part, -1);
  EXPECT_EQ(result->cigi.parts[1].joint_m, glm::dvec3(0.5, 0.0, -2.0));
  EXPECT_EQ(result->cigi.parts[1].joint_yaw_pitch_roll_deg, glm::dvec3(0.0, 90.0, 0.0));
}

TEST_F(ConfigTest, parts_of_a_cigi_host_hang_on_something_and_stand_once) {
  const auto fault = [&](const std::string& parts) {
    return daemon_error(cigi_section("entities = [{ id = 9, entity = 1 }]\nparts = " + parts));
  };
  EXPECT_THAT(fault("[{ id = 1, part = 1, entity = 2, on_part = 7 }]\n"),
              ::testing::HasSubstr("part 1 of entity 1 hangs on part 7, which is not there"));
  EXPECT_THAT(fault("[{ id = 1, part = 1, entity = 2, on_part = 2 },\n"
                    " { id = 1, part = 2, entity = 3, on_part = 1 }]\n"),
              ::testing::HasSubstr("hangs on itself"));
  EXPECT_THAT(fault("[{ id = 1, part = 1, entity = 2 }, { id = 1, part = 1, entity = 3 }]\n"),
              ::testing::HasSubstr("part 1 of entity 1 stands twice"));
  EXPECT_THAT(fault("[{ id = 1, part = 1, entity = 2 }, { id = 2, part = 1, entity = 2 }]\n"),
              ::testing::HasSubstr("entity 2 stands twice"));
  EXPECT_THAT(fault("[{ id = 1, part = 1, entity = 1 }]\n"),
              ::testing::HasSubstr("entity 1 stands twice"));
}

}  // namespace
}  // namespace emit::config::testing
