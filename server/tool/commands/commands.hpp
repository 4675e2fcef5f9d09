// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/protocol/parity.hpp"
#include "emit/client/security.hpp"

/// One options struct and one function per subcommand of `emit`. The functions return the exit
/// code, print results to standard output and everything else to standard error.
namespace emit::tool {

/// A scenario by name or file, with `--set key=value` applied.
struct ScenarioChoice {
  std::string scenario;
  std::vector<std::string> set;
};

struct RenderCommand {
  ScenarioChoice input;
  double time_s = 0.0;
  std::filesystem::path out;
  std::optional<std::filesystem::path> png;
  std::optional<std::filesystem::path> json;
  std::vector<std::string> channels;  ///< empty: all of temperature, depth, object
  std::string band;                   ///< empty: the scenario's first
  int gpu_index = -1;
};
int run_render(const RenderCommand& command);

struct SolveCommand {
  ScenarioChoice input;
  double time_s = 0.0;
  std::filesystem::path out;
  std::optional<std::filesystem::path> png;
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> checkpoint;
  std::string dimension = "auto";  ///< "auto", "1" or "3"
  std::string band;                ///< empty: the scenario's first
  std::uint32_t rays = 256;
  std::uint32_t threads = 0;  ///< 0: all
  std::uint64_t pixels = 0;   ///< 0: all
  double refine = 1.0;
  double tolerance_k = 0.02;
};
int run_solve(const SolveCommand& command);

/// Takes its arguments as a main() does; argv[0] is "serve".
int run_serve(int argc, char** argv);

struct ReceiveCommand {
  std::string url;
  std::uint64_t frames = 0;  ///< 0: until interrupted or the daemon ends
  std::optional<std::filesystem::path> out;
  std::optional<std::filesystem::path> json;
  std::string channel_name;
  std::string channel_kind;
  std::string band;
  std::string sensor;
  std::string multicast_group;
  std::optional<protocol::FecParams> fec;  ///< absent: the daemon's choice
  bool compress = false;
  bool resend = false;
  double timeout_s = 10.0;
  bool every_frame = false;
  std::uint32_t every_nth = 1;
  bool reconnect = false;
  double min_k = 280.0;
  double max_k = 330.0;
  client::Security security;
};
int run_receive(const ReceiveCommand& command);

struct StatCommand {
  std::string url;
  bool once = false;
  double interval_s = 1.0;
  std::optional<std::filesystem::path> json;  ///< one reading, then the end
};
int run_stat(const StatCommand& command);

struct SendCommand {
  std::filesystem::path log;
  std::string to;
  std::string control;   ///< with step over UDP: where frames can be watched
  double rate_hz = 0.0;  ///< 0: as recorded
  bool step = false;
  std::uint64_t frames = 0;  ///< 0: all
  std::uint64_t every = 1;
  double timeout_s = 60.0;
  std::optional<std::uint64_t> run_id;  ///< absent: from the wall clock
  std::uint16_t host_port = 7001;       ///< of captures: where the host's datagrams went
  std::optional<std::filesystem::path> json;
  client::Security security;
};
int run_send(const SendCommand& command);

struct RecordCommand {
  std::string from;
  std::filesystem::path out;
  std::uint64_t frames = 0;
  double duration_s = 0.0;
  std::optional<std::filesystem::path> json;
  client::Security security;
};
int run_record(const RecordCommand& command);

struct ReplayCommand {
  std::filesystem::path log;
  ScenarioChoice input;
  std::optional<std::filesystem::path> out;
  std::string speed = "max";
  int gpu_index = -1;
  std::optional<std::filesystem::path> json;
};
int run_replay(const ReplayCommand& command);

struct DemoCommand {
  std::filesystem::path out = "emit-demo";
  ScenarioChoice input{"airfield", {}};
  std::optional<std::filesystem::path> log;
  std::uint64_t frames = 0;  ///< 0: as many as fit the budget
  bool all = false;
  bool keep = false;
  double budget_s = 45.0;
  std::optional<std::filesystem::path> json;
};
int run_demo(const DemoCommand& command);

struct ViewCommand {
  std::string source;
  std::vector<std::string> set;
  std::optional<double> time_s;
  std::optional<double> min_value;
  std::optional<double> max_value;
  std::string channel_name;
  std::string channel_kind;
  std::string band;
  std::uint64_t frames = 0;
  std::optional<std::filesystem::path> screenshot;
  int gpu_index = -1;
  client::Security security;
};
int run_view(const ViewCommand& command);

struct CompareCommand {
  std::filesystem::path a;
  std::filesystem::path b;
  std::optional<double> max_error_k;
  std::optional<std::filesystem::path> json;
};
int run_compare(const CompareCommand& command);

struct InspectCommand {
  std::filesystem::path file;
  std::optional<std::filesystem::path> json;
};
int run_inspect(const InspectCommand& command);

struct EvaluateCommand {
  std::string model;
  std::filesystem::path input;
  std::string precision = "float64";
  std::string device = "cpu";
  std::optional<std::filesystem::path> cases;
  std::optional<std::filesystem::path> nodes;
  std::optional<std::uint32_t> rays;
  std::string method;  ///< empty: the default method
  int gpu_index = -1;
  std::uint32_t refine = 1;
  std::string layers;   ///< surface-history: d:k:rc,...
  std::string initial;  ///< surface-history: z:T,...
  std::optional<double> base_k;
  std::optional<double> emissivity_frac;
  std::optional<double> film_w_m2_k;
  std::string history_model = "reference";
};
int run_evaluate(const EvaluateCommand& command);
/// List of the models with their columns, for --help.
[[nodiscard]] std::string evaluate_models_text();

struct FitCommand {
  ScenarioChoice input;  ///< a scenario, or a curve (*.csv)
  std::vector<std::string> materials;
  std::optional<std::size_t> modes;
  std::string model = "foster";
  double spin_up_s = 172'800.0;
  double history_s = 12'600.0;
  std::filesystem::path library;  ///< empty: the shipped one
  std::optional<std::filesystem::path> out;
  std::optional<std::filesystem::path> json;
};
int run_fit(const FitCommand& command);

struct GenerateCommand {
  std::string scene;
  std::filesystem::path out;
  std::vector<std::string> set;
};
int run_generate(const GenerateCommand& command);

struct MakeLogCommand {
  ScenarioChoice input;
  double rate_hz = 200.0;
  std::optional<double> start_s;  ///< absent: first node of the sensor trajectory
  double duration_s = 20.0;
  std::filesystem::path out;
};
int run_make_log(const MakeLogCommand& command);

struct BenchPaperCommand {
  std::optional<std::filesystem::path> json;
  std::vector<std::string> scenes;
  std::vector<std::uint32_t> steps;
  std::uint32_t frames = 5;
  std::uint32_t width_px = 1024;
  std::uint32_t height_px = 768;
  std::vector<std::string> methods{"per-frame", "cached"};
  std::string model;  ///< empty: emit2014
  bool no_errors = false;
  std::uint32_t pixels = 20'000;
  int gpu_index = -1;
};
int run_bench_paper(const BenchPaperCommand& command);

struct BenchErrorCommand {
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> csv;
  std::optional<std::filesystem::path> plot;
  std::optional<std::filesystem::path> figures;
  std::vector<std::string> scenes;
  bool quick = false;
  std::uint32_t frames = 3;
  std::uint32_t width_px = 320;
  std::uint32_t height_px = 256;
  std::uint32_t rays = 256;
  double refine = 1.0;
  std::uint64_t pixels = 0;
  int gpu_index = -1;
};
int run_bench_error(const BenchErrorCommand& command);

struct BenchStreamCommand {
  std::optional<std::filesystem::path> json;
  std::uint64_t frames = 1000;
  double rate_hz = 200.0;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  std::uint32_t clients = 4;
  std::vector<std::string> transports{"tcp", "udp", "shm", "mixed"};
  std::uint32_t repeats = 5;      ///< of the throughput measurements; 0: none
  std::vector<std::string> only;  ///< of the throughput measurements; empty: all
  std::string cpus;               ///< realtime.cpus of the daemons
  /// Shares of datagrams lost on the way; not empty: nothing but lossy networks is measured.
  std::vector<double> losses;
  double burst_mean = 1.0;  ///< datagrams lost in a row
  protocol::FecParams fec{protocol::kDefaultFecData, protocol::kDefaultFecParity};
  std::uint32_t payload_bytes = 1400;  ///< of a fragment on lossy networks
  std::uint64_t seed = 1;
};
int run_bench_stream(const BenchStreamCommand& command);
/// What it measures the throughput of; what BenchStreamCommand::only may name.
[[nodiscard]] std::vector<std::string> stream_contenders();

struct BenchIsolationCommand {
  std::optional<std::filesystem::path> json;
  std::uint64_t frames = 400;  ///< per client and run
  double rate_hz = 200.0;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  std::uint32_t clients = 4;  ///< of mixed transports; the disturbing ones are beside them
  std::uint32_t pairs = 15;
};
int run_bench_isolation(const BenchIsolationCommand& command);

struct BenchStabilityCommand {
  std::optional<std::filesystem::path> json;
  std::uint64_t cases = 100'000'000;  ///< of the equilibrium sweep; the others follow
  std::uint32_t seed = 20140621;
  std::vector<std::string> parts;   ///< of stability_parts(); empty: all
  std::vector<std::string> frames;  ///< names of hostile frame tests; empty: all
  std::optional<std::filesystem::path> pictures;
  int gpu_index = -1;
};
int run_bench_stability(const BenchStabilityCommand& command);
[[nodiscard]] std::vector<std::string> stability_parts();

struct BenchConvergenceCommand {
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> plot;
};
int run_bench_convergence(const BenchConvergenceCommand& command);

struct BenchThermalTruthCommand {
  std::optional<std::filesystem::path> json;
  std::string method = "cached";
  std::uint32_t steps = 90;
  std::uint32_t width_px = 320;
  std::uint32_t height_px = 256;
  std::optional<std::filesystem::path> pictures;
  int gpu_index = -1;
};
int run_bench_thermal_truth(const BenchThermalTruthCommand& command);

struct BenchScalingCommand {
  std::optional<std::filesystem::path> json;
  std::vector<std::string> axes;     ///< of scaling_axes(); empty: all
  std::vector<std::string> methods;  ///< empty: both
  bool quick = false;
  std::uint32_t pairs = 45;
  std::uint32_t per_frame_frames = 3;
  int gpu_index = -1;
};
int run_bench_scaling(const BenchScalingCommand& command);

struct BenchCrowdCommand {
  std::optional<std::filesystem::path> json;
  std::vector<std::string> set;
  std::uint32_t instances = 10'000;
  std::uint32_t triangles = 1000;  ///< of each, at least
  std::uint32_t pairs = 45;
  int gpu_index = -1;
};
int run_bench_crowd(const BenchCrowdCommand& command);

struct BenchTurnCommand {
  std::optional<std::filesystem::path> json;
  std::string scene = "airfield";
  std::vector<std::string> set;
  std::vector<std::string> methods{"cached"};
  std::uint32_t runs = 5;
  std::uint32_t frames = 100;  ///< per turn
  double budget_frac = 1.7;    ///< of the free-running median
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  int gpu_index = -1;
};
int run_bench_turn(const BenchTurnCommand& command);

struct BenchLiveCommand {
  std::optional<std::filesystem::path> json;
  std::string scene = "airfield";
  std::vector<std::string> set;
  double seconds = 60.0;  ///< of sim time
  double rate_hz = 50.0;  ///< of frames and host poses, in sim time
  double every_s = 2.0;   ///< between the pictures that are compared
  double finest_s = 1.0;  ///< thermal.first_step_s of the reference
  /// A cloud passes: the host tells the weather that often, the script has it from the start; 0:
  /// none.
  double weather_every_s = 0.0;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  int gpu_index = -1;
};
int run_bench_live(const BenchLiveCommand& command);

struct BenchBudgetCommand {
  std::optional<std::filesystem::path> json;
  std::string scene = "airfield";
  std::vector<std::string> set;
  std::vector<double> budgets{0.8, 0.6, 0.1};  ///< of the free-running median
  std::uint32_t frames = 500;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  int gpu_index = -1;
};
int run_bench_budget(const BenchBudgetCommand& command);

/// Parses the command line and runs the chosen subcommand; returns the process's exit code.
int run_tool(int argc, char** argv);

}  // namespace emit::tool
