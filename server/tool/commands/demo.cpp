// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <system_error>

#include "emit/config/load.hpp"
#include "emit/protocol/record/log.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/commands/demo_report.hpp"
#include "tool/streams/pose_log.hpp"
#include "tool/streams/pose_plan.hpp"
#include "tool/support/console.hpp"
#include "tool/support/daemon_process.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/work_folder.hpp"

namespace emit::tool {
namespace {

struct DemoOptions {
  std::filesystem::path out = "emit-demo";
  ScenarioChoice input{"airfield", {}};
  std::optional<std::filesystem::path> log;
  std::uint64_t frames = 0;  ///< 0: as many as fit the budget
  bool all = false;
  bool keep = false;
  double budget_s = 10.0;
  std::optional<std::filesystem::path> json;
};

using Clock = std::chrono::steady_clock;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// The shipped log of a scenario, or one made from the scenario's trajectories where none ships.
Result<std::filesystem::path> find_or_make_log(const DemoOptions& command,
                                               const scene::ScenarioDesc& scenario,
                                               const std::filesystem::path& work) {
  if (command.log) return *command.log;
  if (auto shipped = config::find_data_file(std::filesystem::path("logs") /
                                            (scenario.file.stem().string() + ".mcap"))) {
    return *shipped;
  }
  const auto path = work / "host.mcap";
  if (auto fits = check_entities_fit(scenario); !fits) return tl::unexpected(fits.error());
  auto writer = protocol::LogWriter::create(path);
  if (!writer) return tl::unexpected(writer.error());
  constexpr double kRateHz = 200.0;
  constexpr std::uint64_t kPoses = 4001;
  const auto frame = std::make_unique<protocol::HostFrameData>();
  const std::int64_t start_ns = std::max<std::int64_t>(0, trajectory_start_ns(scenario));
  for (std::uint64_t i = 0; i < kPoses; ++i) {
    make_host_frame(scenario, start_ns, kRateHz, i, *frame);
    if (auto done = writer->write_host(*frame, frame->sim_time_ns); !done) {
      return tl::unexpected(done.error());
    }
  }
  if (auto done = writer->close(); !done) return tl::unexpected(done.error());
  return path;
}

Result<std::uint64_t> count_host_frames(const std::filesystem::path& path) {
  auto log = PoseLog::open(path);
  if (!log) return tl::unexpected(log.error());
  std::uint64_t count = 0;
  while (true) {
    const auto more = log->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    ++count;
  }
  if (count == 0) {
    return make_error(ErrorCode::parse, fmt::format("{}: no host frame in the log", path.string()));
  }
  return count;
}

/// Sequential reader of host frames by index.
class HostFrameReader {
 public:
  explicit HostFrameReader(PoseLog log) : log_(std::move(log)) {}
  /// `index` must ascend from call to call and lie within the log.
  Result<const protocol::HostFrameData*> at(std::uint64_t index) {
    for (; next_ <= index; ++next_) {
      const auto more = log_.next();
      if (!more) return tl::unexpected(more.error());
      if (!*more) return make_error(ErrorCode::io, "the host log changed while it was read");
    }
    return &log_.host();
  }

 private:
  PoseLog log_;
  std::uint64_t next_ = 0;
};

config::DaemonConfig daemon_config(const scene::ScenarioDesc& scenario,
                                   const std::filesystem::path& work) {
  config::DaemonConfig daemon;
  std::error_code ignored;
  daemon.scenario = std::filesystem::absolute(scenario.file, ignored);
  daemon.pacing.mode = config::PacingMode::host_step;
  daemon.host.udp = "127.0.0.1:0";
  daemon.control.tcp = "127.0.0.1:0";
  daemon.journal.file = std::filesystem::absolute(work / "journal.mcap", ignored);
  return daemon;
}

class Demo {
 public:
  Demo(const DemoOptions& command, scene::ScenarioDesc scenario, WorkFolder& work)
      : command_(command), scenario_(std::move(scenario)), work_(work) {}

  int run();

 private:
  Result<void> prepare();
  Result<void> start();
  Result<void> play();
  Result<void> play_pose(const protocol::HostFrameData& recorded, bool udp);
  Result<void> save_frame();
  void replan(PosePlan& plan, double played_s, double step_s) const;
  Result<void> finish();
  Result<void> replay();
  int report();

  const DemoOptions& command_;
  scene::ScenarioDesc scenario_;
  WorkFolder& work_;
  Clock::time_point begin_ = Clock::now();
  std::filesystem::path log_;
  std::vector<Departure> departures_;
  std::optional<DaemonProcess> daemon_;
  double setup_s_ = 0.0;
  std::unique_ptr<StreamClient> tcp_client_;
  std::unique_ptr<StreamClient> udp_client_;
  std::unique_ptr<client::HostClient> udp_host_;
  std::unique_ptr<client::HostClient> tcp_host_;
  std::unique_ptr<protocol::HostFrameData> frame_ = std::make_unique<protocol::HostFrameData>();
  std::optional<ApparentTemperature> apparent_;
  DemoResults results_;
};

Result<void> Demo::prepare() {
  if (auto made = make_directory(command_.out); !made) return made;
  if (auto made = work_.create(command_.out); !made) return made;
  const auto log = find_or_make_log(command_, scenario_, work_.path());
  if (!log) return tl::unexpected(log.error());
  log_ = *log;
  const auto poses = count_host_frames(log_);
  if (!poses) return tl::unexpected(poses.error());
  results_.poses_in_log = *poses;
  results_.scenario = scenario_.name;
  departures_ = find_departures(scenario_, 60.0);
  return {};
}

Result<void> Demo::start() {
  fmt::print(text_stream(command_.json), "starting emitd on scenario {} ({})\n", scenario_.name,
             scenario_.file.string());
  const auto started = Clock::now();
  std::vector<std::string> set = command_.input.set;
  scene::ThermalOptions& thermal = scenario_.thermal;
  if (thermal.method == scene::ThermalMethod::cached && thermal.state_file.empty()) {
    // The replay warms up from what the daemon has kept.
    std::error_code ignored;
    thermal.state_file = std::filesystem::absolute(work_.path() / "thermal.state", ignored);
    set.push_back(fmt::format("thermal.state_file=\"{}\"", thermal.state_file.string()));
  }
  auto daemon = DaemonProcess::start(daemon_config(scenario_, work_.path()), set, work_.path(),
                                     std::chrono::minutes(15));
  if (!daemon) return tl::unexpected(daemon.error());
  daemon_.emplace(std::move(*daemon));
  setup_s_ = seconds_since(started);

  const auto connect = [&](const std::string& url, scene::ChannelKind kind, bool every_frame) {
    StreamClient::Options options;
    options.url = url;
    const bool offered =
        std::any_of(scenario_.channels.begin(), scenario_.channels.end(),
                    [kind](const scene::ChannelDesc& channel) { return channel.kind == kind; });
    if (offered) {
      options.subscribe.channel_kind =
          kind == scene::ChannelKind::injection ? "injection" : "projector";
    }
    options.subscribe.every_frame = every_frame;
    options.keep_pixels = true;
    return StreamClient::start(options);
  };
  const std::string control = daemon_->control_address();
  auto tcp = connect("tcp://" + control, scene::ChannelKind::injection, true);
  if (!tcp) return tl::unexpected(std::move(tcp.error()).with_context("tcp client"));
  tcp_client_ = std::move(*tcp);
  auto udp = connect("udp://" + control, scene::ChannelKind::projector, false);
  if (!udp) return tl::unexpected(std::move(udp.error()).with_context("udp client"));
  udp_client_ = std::move(*udp);
  results_.device = tcp_client_->server().device;

  auto udp_host = client::HostClient::connect("udp://" + daemon_->host_udp_address());
  if (!udp_host) return tl::unexpected(udp_host.error());
  udp_host_ = std::move(*udp_host);
  auto tcp_host = client::HostClient::connect("tcp://" + control);
  if (!tcp_host) return tl::unexpected(tcp_host.error());
  tcp_host_ = std::move(*tcp_host);

  fmt::print(text_stream(command_.json),
             "emitd is ready after {:.1f} s: control {}, host poses udp {}, device {}\n", setup_s_,
             control, daemon_->host_udp_address(), results_.device);
  for (const StreamClient* client : {tcp_client_.get(), udp_client_.get()}) {
    fmt::print(text_stream(command_.json), "  {}\n", channel_text(client->channel()));
  }
  if (const std::string advice = udp_client_->advice(); !advice.empty()) warn(advice);
  return {};
}

/// Sends one pose and waits for its frame at both clients (host-step: pose k makes frame k).
Result<void> Demo::play_pose(const protocol::HostFrameData& recorded, bool udp) {
  *frame_ = recorded;
  // Numbers count up by one whatever poses of the log are left out.
  frame_->frame_number = results_.poses_udp + results_.poses_tcp + 1;
  client::HostClient& host = udp ? *udp_host_ : *tcp_host_;
  if (auto sent = host.send(*frame_); !sent) return sent;
  ++(udp ? results_.poses_udp : results_.poses_tcp);

  constexpr std::chrono::seconds kFrameTimeout(120);
  if (!tcp_client_->wait_for_host_frame(frame_->frame_number, kFrameTimeout)) {
    if (auto alive = daemon_->check_alive(); !alive) return alive;
    std::string reason = tcp_client_->error();
    if (const auto status = host.receive_status(0); status && *status) {
      reason += (reason.empty() ? "" : "; ") + (*status)->text;
    }
    return make_error(ErrorCode::io,
                      fmt::format("no frame for pose {} sent over {}: {}", frame_->frame_number,
                                  udp ? "UDP" : "TCP", reason));
  }
  // A datagram may be lost for want of buffer space: that is counted, not waited for.
  if (!udp_client_->wait_for_host_frame(frame_->frame_number, std::chrono::seconds(2))) {
    warn(fmt::format("the udp client did not get the frame of pose {}", frame_->frame_number));
  }
  while (true) {
    const auto status = host.receive_status(0);
    if (!status || !*status) return {};
    if (!(*status)->ok()) {
      return make_error(ErrorCode::protocol, fmt::format("emitd refused pose {}: {}",
                                                         frame_->frame_number, (*status)->text));
    }
  }
}

Result<void> Demo::save_frame() {
  const auto snapshot = tcp_client_->last_frame();
  FramePlanes planes;
  planes.width_px = snapshot.header.width_px;
  planes.height_px = snapshot.header.height_px;
  planes.radiance_w_m2_sr = snapshot.pixels;
  const std::size_t band = band_of_channel(scenario_, scene::ChannelKind::injection);
  if (!apparent_ && band < scenario_.bands.size() &&
      scenario_.bands[band].name == tcp_client_->channel().band) {
    apparent_.emplace(scene::spectral_band(scenario_.bands[band]));
  }
  planes.apparent = apparent_ ? &*apparent_ : nullptr;
  planes.metadata = {snapshot.header.sim_time_ns,
                     snapshot.header.frame_number,
                     snapshot.header.pose,
                     tcp_client_->channel().band,
                     tcp_client_->channel().band_lo_um,
                     tcp_client_->channel().band_hi_um,
                     "W m-2 sr-1",
                     tcp_client_->channel().response,
                     snapshot.header.fov_h_rad};
  if (auto written = write_frame_files(command_.out, planes,
                                       {scenario_.display.min_k, scenario_.display.max_k});
      !written) {
    return written;
  }
  ++results_.frames_written;
  const bool after = std::any_of(departures_.begin(), departures_.end(), [&](const Departure& d) {
    return snapshot.header.sim_time_ns > d.left_ns;
  });
  if (after) ++results_.frames_after_departure;
  return {};
}

/// Limits the plan to the poses that fit the rest of the budget, `played_s` after the first pose.
/// Every pose costs `step_s` twice: once now and once in the replay.
void Demo::replan(PosePlan& plan, double played_s, double step_s) const {
  const double free_s = command_.budget_s - played_s - static_cast<double>(plan.played()) * step_s;
  const double poses = std::floor(free_s / (2.0 * step_s));
  plan.limit_to(poses > 0.0 ? static_cast<std::uint64_t>(poses) : 0);
}

Result<void> Demo::play() {
  std::optional<std::uint64_t> count;
  if (command_.all) count = results_.poses_in_log;
  if (command_.frames > 0) count = command_.frames;
  PosePlan plan(results_.poses_in_log, count);
  auto log = PoseLog::open(log_);
  if (!log) return tl::unexpected(log.error());
  HostFrameReader reader(std::move(*log));

  constexpr std::uint64_t kEvenSaves = 6;
  constexpr std::size_t kTrialFrames = 8;
  std::uint64_t next_save = 0;
  const auto begin = Clock::now();
  Progress progress("poses", plan.left());
  Samples step_s;
  while (const auto index = plan.next()) {
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
    const auto recorded = reader.at(*index);
    if (!recorded) return tl::unexpected(recorded.error());
    const bool udp = *index * 2 < results_.poses_in_log;
    const auto started = Clock::now();
    if (auto played = play_pose(**recorded, udp); !played) return played;
    step_s.add(seconds_since(started));
    if (step_s.count() == 1) results_.first_frame_ms = 1e3 * step_s.values().front();

    // Evenly over the log, and the last two in any case.
    const std::uint64_t share = results_.poses_in_log > 1
                                    ? *index * (kEvenSaves - 1) / (results_.poses_in_log - 1)
                                    : kEvenSaves;
    // The first frames are slower than the rest and say little about it.
    if (step_s.count() >= kTrialFrames) {
      replan(plan, seconds_since(begin), 1.1 * step_s.median());
    }
    if (share >= next_save || plan.left() <= 1) {
      next_save = share + 1;
      if (auto saved = save_frame(); !saved) return saved;
    }
    progress.advance_to(plan.played());
  }
  progress.finish();
  fmt::print(text_stream(command_.json),
             "played {} of the log's {} poses ({}), evenly spaced: the first half of the log over "
             "UDP ({}), the second over TCP ({})\n",
             plan.played(), results_.poses_in_log,
             command_.all ? "all" : "a subset; --all plays every pose", results_.poses_udp,
             results_.poses_tcp);
  return {};
}

Result<void> Demo::finish() {
  // Stop the receivers first: the daemon's closing of the connection is no loss.
  udp_host_.reset();
  tcp_host_.reset();
  tcp_client_->stop();
  udp_client_->stop();
  return daemon_->stop(std::chrono::seconds(30));
}

Result<void> Demo::replay() {
  JournalReplayOptions options;
  options.log = work_.path() / "journal.mcap";
  const std::size_t injection = band_of_channel(scenario_, scene::ChannelKind::injection);
  const std::size_t projector = band_of_channel(scenario_, scene::ChannelKind::projector);
  const auto compare = [&](const server::ReplayedFrame& frame, const StreamClient& client,
                           std::size_t plane) {
    const auto received = client.crcs().find(frame.frame_number);
    if (received == client.crcs().end() || plane >= frame.view->radiance_w_m2_sr.size()) return;
    ++results_.replay_client_compared;
    const auto bytes = std::as_bytes(frame.view->radiance_w_m2_sr[plane]);
    if (protocol::crc32c(bytes) != received->second) ++results_.replay_client_mismatches;
  };
  ReplayHooks hooks;
  hooks.on_frame = [&](const server::ReplayedFrame& frame, std::uint64_t) -> Result<void> {
    if (frame.view == nullptr) return {};
    compare(frame, *tcp_client_, injection);
    compare(frame, *udp_client_, projector);
    return {};
  };
  SystemReplayClock clock;
  auto summary = replay_journal(renderer_bench(scenario_, options, clock), options, hooks);
  if (!summary) return tl::unexpected(summary.error());
  results_.replay = std::move(*summary);
  return {};
}

int Demo::report() {
  const std::vector<DemoClientView> clients{{"tcp", tcp_client_.get()}, {"udp", udp_client_.get()}};
  results_.total_s = seconds_since(begin_);
  fmt::print(text_stream(command_.json), "{}\n", demo_tables(clients));
  for (const Departure& departure : departures_) {
    fmt::print(text_stream(command_.json), "{} stood {:.0f} s and left at sim time {:.1f} s\n",
               departure.object,
               1e-9 * static_cast<double>(departure.left_ns - departure.arrived_ns),
               1e-9 * static_cast<double>(departure.left_ns));
  }
  fmt::print(text_stream(command_.json), "{} frames written to {}, {} of them after a departure\n",
             results_.frames_written, command_.out.string(), results_.frames_after_departure);
  const bool equal = results_.replay.mismatches == 0 && results_.replay_client_mismatches == 0;
  fmt::print(text_stream(command_.json),
             "replay of the recording: {} of {} frames equal bit for bit; {} received images "
             "compared, {} differ\n",
             results_.replay.frames - results_.replay.mismatches, results_.replay.frames,
             results_.replay_client_compared, results_.replay_client_mismatches);
  fmt::print(text_stream(command_.json), "total time {:.1f} s\n", results_.total_s);
  if (command_.json) {
    if (auto done = write_json(*command_.json, demo_json(results_, clients)); !done) {
      return fail(done.error());
    }
  }

  std::vector<std::string> warnings;
  std::vector<std::string> failures = demo_losses(clients, warnings);
  const std::uint64_t played = results_.poses_udp + results_.poses_tcp;
  if (!equal) failures.emplace_back("the replay differs from the live run");
  if (results_.replay.frames != played || tcp_client_->report().frames() != played) {
    failures.push_back(
        fmt::format("{} poses made {} frames at the tcp client and {} in the journal", played,
                    tcp_client_->report().frames(), results_.replay.frames));
  }
  for (std::string& text : demo_shortfalls(results_, departures_)) {
    failures.push_back(std::move(text));
  }
  for (const std::string& text : warnings) warn(text);
  for (const std::string& text : failures) fail(kExitFailure, text);
  if (!failures.empty()) work_.keep();
  if (work_.kept()) {
    fmt::print(text_stream(command_.json), "recording, configuration and log are kept in {}\n",
               work_.path().string());
  }
  return failures.empty() ? kExitOk : kExitFailure;
}

int Demo::run() {
  using Step = Result<void> (Demo::*)();
  for (const Step step :
       {&Demo::prepare, &Demo::start, &Demo::play, &Demo::finish, &Demo::replay}) {
    if (auto done = (this->*step)(); !done) {
      if (!InterruptGuard::interrupted()) work_.keep();  // to see what went wrong
      const int code = fail(done.error());
      if (work_.kept()) {
        fmt::print(stderr, "emit: configuration and log of the daemon are kept in {}\n",
                   work_.path().string());
      }
      return code;
    }
  }
  return report();
}

int run(const DemoOptions& command) {
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  WorkFolder work(command.keep);
  const InterruptGuard interrupt;
  return Demo(command, *scenario, work).run();
}

void add_options(CommandLine& line, DemoOptions& options) {
  line.output_folder("--out", options.out, "Folder for the frames")
      .default_text(options.out.string());
  line.option("--scenario", options.input.scenario, "Shipped scenario or .toml file")
      .show_default();
  add_set(line, options.input.set);
  line.path("--log", options.log, "Host log to play; default: the scenario's shipped log");
  line.count("--frames", options.frames,
             "Poses to play, evenly spaced over the log; 0: as many as fit");
  line.flag("--all", options.all, "Play every pose of the log, however long it takes");
  line.flag("--keep", options.keep, "Keep the recording, the daemon's configuration and its log");
  line.seconds("--budget-s", options.budget_s,
               "Time for the chosen poses and their replay, after the warm-up")
      .positive()
      .show_default();
  add_json(line, options.json);
}

}  // namespace

void add_demo(CommandLine& tool) {
  tool.command<DemoOptions>(
      {.name = "demo",
       .text =
           "The main job end to end on loopback: daemon, pose log over UDP and TCP, two clients, "
           "frames on disk, timing table, bit-exact replay",
       .example = "emit demo --out frames"},
      add_options, run);
}

}  // namespace emit::tool
