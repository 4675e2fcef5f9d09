// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/arguments.hpp"

#include <fmt/format.h>

#include <cmath>

namespace emit::tool {

using std::filesystem::path;

CLI::Option* add_path(CLI::App& app, const std::string& name, path& target,
                      const std::string& text) {
  return app
      .add_option_function<std::string>(
          name, [&target](const std::string& value) { target = value; }, text)
      ->type_name("FILE");
}

CLI::Option* add_path(CLI::App& app, const std::string& name, std::optional<path>& target,
                      const std::string& text) {
  return app
      .add_option_function<std::string>(
          name, [&target](const std::string& value) { target = path(value); }, text)
      ->type_name("FILE");
}

void add_json(CLI::App& app, std::optional<path>& target) {
  add_path(app, "--json", target, "Write the results as JSON (- for standard output)");
}

void add_set(CLI::App& app, std::vector<std::string>& target) {
  app.add_option("--set", target, "Override a key of the file, e.g. --set thermal.steps=90")
      ->allow_extra_args(false)
      ->type_name("KEY=VALUE");
}

void add_scenario(CLI::App& app, ScenarioChoice& target, const std::string& name) {
  app.add_option(name, target.scenario, "Shipped scenario (airfield, box, ...) or a .toml file")
      ->required()
      ->type_name("SCENARIO");
  add_set(app, target.set);
}

void add_gpu(CLI::App& app, int& target) {
  app.add_option("--gpu", target, "EGL device index; default: first hardware device, else Mesa")
      ->type_name("N");
}

CLI::Option* add_count(CLI::App& app, const std::string& name, std::uint64_t& target,
                       const std::string& text) {
  return app.add_option(name, target, text)->type_name("N");
}

CLI::Option* add_seconds(CLI::App& app, const std::string& name, double& target,
                         const std::string& text) {
  return app.add_option(name, target, text)->type_name("S");
}

void Tool::add_scene_commands() {
  {
    auto [app, o] = add<RenderCommand>(
        app_, "render", "Render one frame of a scenario offline",
        "emit render block-on-road --time-s 41400 --out road.exr --png road.png", run_render);
    add_scenario(app, o.input, "scenario");
    add_seconds(app, "--time-s", o.time_s, "Simulated time since the scenario's epoch, s")
        ->required();
    add_path(app, "--out", o.out, "OpenEXR file to write")->required();
    add_path(app, "--png", o.png, "False-colour temperature as PNG");
    app.add_option("--channel", o.channels,
                   "Channel beside radiance: temperature, depth, object; repeatable; default all")
        ->allow_extra_args(false)
        ->check(CLI::IsMember({"temperature", "depth", "object"}));
    app.add_option("--band", o.band, "Band of the radiance channel; default: the first")
        ->type_name("NAME");
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<SolveCommand>(
        app_, "solve",
        "Reference solution: the picture of render by transient conduction and rays, in double",
        "emit solve block-on-road --time-s 12600 --out truth.exr --checkpoint runs", run_solve);
    add_scenario(app, o.input, "scenario");
    add_seconds(app, "--time-s", o.time_s, "Simulated time since the scenario's epoch, s")
        ->required();
    add_path(app, "--out", o.out, "OpenEXR file to write")->required();
    add_path(app, "--png", o.png, "False-colour temperature as PNG");
    app.add_option("--dimension", o.dimension,
                   "Conduction: 3 (solids of axis-aligned faces, nothing moving), 1 (behind every "
                   "pixel), auto (3 where it fits)")
        ->check(CLI::IsMember({"auto", "1", "3"}))
        ->capture_default_str();
    app.add_option("--rays", o.rays, "Rays per face or pixel for sky and surroundings")
        ->check(CLI::Range(1U, 1U << 20U))
        ->capture_default_str();
    app.add_option("--refine", o.refine, "Three dimensions: multiplies cells per axis and steps")
        ->check(CLI::Range(0.1, 8.0))
        ->capture_default_str();
    app.add_option("--tolerance-k", o.tolerance_k,
                   "Three dimensions: error of a step at refine 1, K")
        ->check(positive())
        ->capture_default_str();
    add_count(app, "--pixels", o.pixels,
              "Only so many surface pixels, always the same ones, the rest NaN; 0: all");
    add_path(app, "--checkpoint", o.checkpoint,
             "Folder to save the three-dimensional history in, and to go on from")
        ->type_name("DIR");
    app.add_option("--threads", o.threads, "Threads; 0: one per core")->capture_default_str();
    app.add_option("--band", o.band, "Band of the radiance channel; default: the first")
        ->type_name("NAME");
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<InspectCommand>(app_, "inspect", "Show what the loader sees in a glTF file",
                                        "emit inspect scene.glb", run_inspect);
    add_path(app, "scene", o.file, "glTF 2.0 file (.glb or .gltf)")->required();
    add_json(app, o.json);
  }
  {
    auto [app, o] =
        add<CompareCommand>(app_, "compare", "Difference of two frames, in kelvin and per cent",
                            "emit compare a.exr b.exr --json diff.json", run_compare);
    add_path(app, "a", o.a, "OpenEXR frame")->required();
    add_path(app, "b", o.b, "OpenEXR frame, taken as the reference")->required();
    app.add_option(
           "--max-error-k", o.max_error_k,
           "Exit 1 when temperatures differ by more than this anywhere (radiance by the band "
           "and response in b's attributes; without a response as of a rectangular band)")
        ->type_name("K");
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<GenerateCommand>(
        app_, "generate", "Write one of the shipped scenes, or all, as glTF",
        "emit generate block-on-road --out scenes --set block_size_m=1.5", run_generate);
    app.add_option("scene", o.scene, "Scene name, or all")->required()->type_name("SCENE");
    add_path(app, "--out", o.out, "Folder to write into")->required()->type_name("DIR");
    add_set(app, o.set);
  }
  {
    auto [app, o] = add<ViewCommand>(
        app_, "view", "Live window: a scenario, or the stream of a running daemon",
        "emit view airfield    or    emit view tcp://127.0.0.1:7000\n"
        "Keys, scenario only: arrows or dragging with the left button turn; W/S or the wheel move\n"
        "  forward/back along the view, A/D left/right, E/Q up/down; space pauses;\n"
        "  ] or PgUp jumps 60 s ahead, [ or PgDn 60 s back; Home or H back to the scenario's view\n"
        "Keys, always: - = lower limit of the colours down/up, comma and period upper limit "
        "down/up\n"
        "  (number pad: - + and / *), R limits from the picture, T radiance or temperature, Esc "
        "closes",
        run_view);
    app.add_option("source", o.source, "Scenario name, .toml file, tcp://, udp:// or shm:// URL")
        ->required()
        ->type_name("SCENARIO|URL");
    add_set(app, o.set);
    app.add_option("--time-s", o.time_s, "Scenario: simulated time to start from, s")
        ->type_name("S");
    app.add_option("--min", o.min_value, "Lower limit of the colours, K or W m-2 sr-1");
    app.add_option("--max", o.max_value, "Upper limit of the colours, K or W m-2 sr-1");
    app.add_option("--name", o.channel_name, "URL: channel")->type_name("NAME");
    app.add_option("--channel", o.channel_kind, "URL: channel kind")
        ->check(CLI::IsMember({"injection", "projector"}));
    app.add_option("--band", o.band, "Name of the band")->type_name("NAME");
    add_count(app, "--frames", o.frames,
              "Close after this many frames; 0: until the window closes");
    add_security(app, o.security);
    add_path(app, "--screenshot", o.screenshot, "Write the window's last picture as PNG");
    add_gpu(app, o.gpu_index);
  }
}

void Tool::add_stream_commands() {
  {
    auto [app, o] = add<DemoCommand>(
        app_, "demo",
        "The main job end to end on loopback: daemon, pose log over UDP and TCP, two clients, "
        "frames on disk, timing table, bit-exact replay",
        "emit demo --out frames", run_demo);
    add_path(app, "--out", o.out, "Folder for the frames")
        ->type_name("DIR")
        ->default_str(o.out.string());
    app.add_option("--scenario", o.input.scenario, "Shipped scenario or .toml file")
        ->capture_default_str();
    add_set(app, o.input.set);
    add_path(app, "--log", o.log, "Host log to play; default: the scenario's shipped log");
    add_count(app, "--frames", o.frames,
              "Poses to play, evenly spaced over the log; 0: as many as fit");
    app.add_flag("--all", o.all, "Play every pose of the log, however long it takes");
    app.add_flag("--keep", o.keep, "Keep the recording, the daemon's configuration and its log");
    add_seconds(app, "--budget-s", o.budget_s, "Time that the chosen poses may take")
        ->check(positive())
        ->capture_default_str();
    add_json(app, o.json);
  }
  // Listed here for --help alone: run_tool() hands `emit serve ...` to the daemon's own main.
  app_.add_subcommand("serve", "Run the daemon (same as emitd)");
  {
    auto [app, o] = add<ReceiveCommand>(
        app_, "receive",
        "Receive frames, check sequence and CRC, print the latency histogram; exits 1 when frames "
        "were lost or a gap was not flagged",
        "emit receive tcp://127.0.0.1:7000 --frames 100 --out frames", run_receive);
    app.add_option("url", o.url,
                   "Control address of the daemon; the scheme chooses how frames travel: "
                   "tcp://host:port or udp://host:port; shm://name: shared memory of a daemon on "
                   "this host that has stream.shm = \"name\"")
        ->required()
        ->type_name("URL");
    add_count(app, "--frames", o.frames, "Stop after this many; 0: until interrupted");
    add_path(
        app, "--out", o.out,
        "Folder for frame_NNNNNN.exr and .png (apparent temperature, by the band's response where "
        "the daemon tells it, else as of a rectangular band)")
        ->type_name("DIR");
    app.add_option("--name", o.channel_name, "Channel; default: the first that fits")
        ->type_name("NAME");
    app.add_option("--channel", o.channel_kind, "Channel kind; default: any")
        ->check(CLI::IsMember({"injection", "projector"}));
    app.add_option("--band", o.band, "Band; default: any")->type_name("NAME");
    app.add_option("--sensor", o.sensor, "Sensor; default: any")->type_name("NAME");
    app.add_option("--multicast", o.multicast_group, "UDP: group to join instead of unicast")
        ->type_name("ADDRESS");
    add_seconds(app, "--timeout-s", o.timeout_s, "Give up when no frame comes for this long")
        ->check(positive())
        ->capture_default_str();
    add_error_correction(app, "--fec", o.fec);
    app.add_flag("--resend", o.resend,
                 "UDP, daemon in host-step: ask for fragments that are missing");
    app.add_flag("--compress", o.compress,
                 "TCP: frames losslessly compressed (stream.compression of the daemon)");
    app.add_flag("--every-frame", o.every_frame, "TCP, shm: end rather than skip frames");
    app.add_option("--every", o.every_nth,
                   "Only frames 1, 1 + N, 1 + 2 N, ... of a run; those left out are no gap")
        ->type_name("N")
        ->check(CLI::Range(1U, 1000U))
        ->capture_default_str();
    app.add_flag(
        "--reconnect", o.reconnect,
        "When the stream ends, connect again and go on, until no frame came for --timeout-s");
    add_security(app, o.security);
    app.add_option("--min-k", o.min_k, "Lower limit of the PNG's colours")->capture_default_str();
    app.add_option("--max-k", o.max_k, "Upper limit of the PNG's colours")->capture_default_str();
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<StatCommand>(
        app_, "stat",
        "Counters, times, clients and warnings of a daemon with metrics.listen, again and again",
        "emit stat http://127.0.0.1:7002", run_stat);
    app.add_option("url", o.url, "http://host:port of metrics.listen")
        ->required()
        ->type_name("URL");
    app.add_flag("--once", o.once, "One table, then the end");
    add_seconds(app, "--interval-s", o.interval_s, "Time between two tables")
        ->check(CLI::Range(0.1, 3600.0))
        ->capture_default_str();
    add_json(app, o.json);
  }
  {
    auto [app, o] =
        add<SendCommand>(app_, "send", "Host stand-in: plays the poses of a log to a daemon",
                         "emit send airfield.mcap --to udp://127.0.0.1:7001 --rate 200", run_send);
    add_path(app, "log", o.log,
             "MCAP log with host frames, CSV with poses (*.csv), or a pcap/pcapng capture of a "
             "host's datagrams")
        ->required();
    app.add_option("--to", o.to, "udp://host:port (host port) or tcp://host:port (control port)")
        ->required()
        ->type_name("URL");
    app.add_option("--rate", o.rate_hz, "Poses a second; default: as the log's sim times say")
        ->type_name("HZ")
        ->check(positive());
    app.add_flag("--step", o.step, "Wait until the daemon has sent the frame before the next pose");
    add_count(app, "--frames", o.frames, "Send at most this many poses; 0: all");
    add_count(app, "--every", o.every, "Send every Nth pose, numbered anew")->check(positive());
    app.add_option("--control", o.control,
                   "With udp: control port to watch the frames (--step) and to agree on a key over "
                   "TLS (--tls-*), tcp://host:port")
        ->type_name("URL");
    add_path(app, "--key-file", o.security.key_file,
             "udp: pre-shared key (its first line) for the MAC of every datagram, as in the "
             "daemon's host.key_file");
    add_security(app, o.security);
    app.add_option("--host-port", o.host_port, "Capture: UDP port the host sent to")
        ->type_name("PORT")
        ->check(CLI::Range(1, 65535))
        ->capture_default_str();
    app.add_option("--run-id", o.run_id,
                   "Host run id, not 0; another run in the log counts up. Default: from the clock, "
                   "so that a run that follows another needs no reset")
        ->type_name("N")
        ->check(positive());
    add_seconds(app, "--timeout-s", o.timeout_s, "With --step: longest wait for a frame")
        ->check(positive())
        ->capture_default_str();
    add_json(app, o.json);
  }
}

void Tool::add_log_commands() {
  {
    auto [app, o] = add<RecordCommand>(
        app_, "record", "Fetch the daemon's journal into a log that replay can apply",
        "emit record --from tcp://127.0.0.1:7000 --out run.mcap", run_record);
    app.add_option("--from", o.from, "Control address of the daemon, tcp://host:port")
        ->required()
        ->type_name("URL");
    add_path(app, "--out", o.out, "MCAP log to write")->required();
    add_security(app, o.security);
    add_count(app, "--frames", o.frames, "Stop after this many frames; 0: no limit");
    add_seconds(app, "--duration-s", o.duration_s, "Stop after this long; 0: until interrupted");
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<ReplayCommand>(
        app_, "replay",
        "Apply a recorded journal and check every frame bit for bit; exits 1 on a difference",
        "emit replay run.mcap --scenario airfield --out frames", run_replay);
    add_path(app, "log", o.log, "MCAP log of emit record, or of the daemon's journal")->required();
    add_scenario(app, o.input, "--scenario");
    add_path(app, "--out", o.out, "Folder for frame_NNNNNN.exr and .png")->type_name("DIR");
    app.add_option("--speed", o.speed, "Multiple of the recorded pace, or max")
        ->type_name("X")
        ->capture_default_str();
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<MakeLogCommand>(
        app_, "make-log", "Make a host log from a scenario's own trajectories",
        "emit make-log airfield --rate-hz 200 --duration-s 20 --out airfield.mcap", run_make_log);
    add_scenario(app, o.input, "scenario");
    app.add_option("--rate-hz", o.rate_hz, "Poses a second")
        ->check(positive())
        ->capture_default_str();
    app.add_option("--start-s", o.start_s,
                   "Simulated time of the first pose; default: the sensor trajectory's first node");
    add_seconds(app, "--duration-s", o.duration_s, "Length")
        ->check(positive())
        ->capture_default_str();
    add_path(app, "--out", o.out, "MCAP log to write")->required();
  }
}

void Tool::add_model_commands() {
  auto [app, o] = add<EvaluateCommand>(
      app_, "evaluate", "Run one model on a table; CSV to standard output",
      "emit evaluate equilibrium quartic_roots.csv --precision float32 --device gpu", run_evaluate);
  app.footer(
      "Models:\n" + evaluate_models_text() +
      "Example: emit evaluate equilibrium quartic_roots.csv --precision float32 --device gpu");
  app.add_option("model", o.model, "Name of the model, see below")->required()->type_name("MODEL");
  add_path(app, "input", o.input, "CSV with a header row; columns in any order")->required();
  app.add_option("--precision", o.precision, "float64 or float32")
      ->check(CLI::IsMember({"float32", "float64"}))
      ->capture_default_str();
  app.add_option("--device", o.device, "cpu, or gpu: the shader code itself (float32)")
      ->check(CLI::IsMember({"gpu", "cpu"}))
      ->capture_default_str();
  add_path(app, "--cases", o.cases, "relaxation: CSV of the cases");
  add_path(app, "--nodes", o.nodes, "relaxation: CSV of the history's nodes");
  app.add_option("--refine", o.refine, "conduction-*, surface-history: scales cells and steps")
      ->check(CLI::IsMember({1, 2, 4}))
      ->capture_default_str();
  app.add_option("--layers", o.layers,
                 "surface-history: layers from the surface, thickness m : conductivity W/m/K : "
                 "heat capacity J/m3/K")
      ->type_name("D:K:RC,...");
  app.add_option("--initial", o.initial,
                 "surface-history: profile at the first row, depth m : temperature K, linear")
      ->type_name("Z:T,...");
  app.add_option("--base-k", o.base_k, "surface-history: temperature below the last layer")
      ->type_name("K");
  app.add_option("--emissivity", o.emissivity_frac, "surface-history: long-wave emissivity, 0..1")
      ->type_name("E");
  app.add_option("--film-w-m2-k", o.film_w_m2_k, "surface-history: convection coefficient")
      ->type_name("H");
  app.add_option("--model", o.history_model,
                 "surface-history: reference, emit2014 (first layer, no convection) or foster")
      ->check(CLI::IsMember({"reference", "emit2014", "foster"}))
      ->capture_default_str();
  app.add_option("--rays", o.rays,
                 "sun-disc, wall-shadow, sky-view on the cpu: rays per row and measure")
      ->type_name("N")
      ->check(CLI::Range(1, 1 << 30));
  app.add_option("--method", o.method,
                 "sun-disc, wall-shadow, sky-view with --device gpu: thermal method whose "
                 "visibility answers; default: cached")
      ->check(CLI::IsMember({"per-frame", "cached"}));
  add_gpu(app, o.gpu_index);
  {
    auto [fit, f] = add<FitCommand>(
        app_, "fit", "Fit a material's modes to the reference solver, or to a curve",
        "emit fit block-on-road --material asphalt --modes 4 --json fit.json --out library.toml",
        run_fit);
    fit.add_option(
           "input", f.input.scenario,
           "Scenario: its place, date, weather and materials, over five histories of sun and "
           "shade. Or a curve, CSV with time_s, absorbed_w_m2, film_w_m2_k, air_k, "
           "temperature_k")
        ->required()
        ->type_name("SCENARIO|CURVE.csv");
    add_set(fit, f.input.set);
    fit.add_option("--material", f.materials, "Material; repeatable; default: all of the scenario")
        ->allow_extra_args(false)
        ->type_name("NAME");
    fit.add_option("--modes", f.modes, "foster: 2 to 4, default 4; emit2014: 1 or 2, default 2")
        ->type_name("N")
        ->check(CLI::Range(1, 4));
    fit.add_option("--model", f.model, "Model whose modes are fitted")
        ->check(CLI::IsMember({"foster", "emit2014"}))
        ->capture_default_str();
    add_seconds(fit, "--spin-up-s", f.spin_up_s, "Unshadowed time before the histories")
        ->check(CLI::Range(0.0, 3.2e7))
        ->capture_default_str();
    add_seconds(fit, "--history-s", f.history_s, "Length of a history")
        ->check(CLI::Range(600.0, 864'000.0))
        ->capture_default_str();
    add_path(fit, "--library", f.library, "Library to start from; default: the shipped one");
    add_path(fit, "--out", f.out, "Library to write: the same with the fitted modes");
    add_json(fit, f.json);
  }
}

std::optional<Tool::UnknownCommand> Tool::unknown_command(int argc, char** argv) const {
  UnknownCommand out{app_.get_name(), ""};
  const CLI::App* app = &app_;
  for (int i = 1; i < argc && app->get_require_subcommand_min() > 0; ++i) {
    const std::string name = argv[i];
    if (name.starts_with('-')) return std::nullopt;
    out.command += (i == 1 ? "" : " ") + name;
    const auto known =
        app->get_subcommands([&](const CLI::App* each) { return each->check_name(name); });
    if (known.empty()) return out;
    out.parent += " " + name;
    app = known.front();
  }
  return std::nullopt;
}

CLI::Validator positive() {
  return {[](std::string& text) -> std::string {
            double value = 0.0;
            const bool number = CLI::detail::lexical_cast(text, value);
            if (number && value > 0.0 && std::isfinite(value)) return {};
            return fmt::format("{} is not a number above 0", text);
          },
          "POSITIVE"};
}

int run_tool(int argc, char** argv) {
  if (argc >= 2 && std::string_view(argv[1]) == "serve") return run_serve(argc - 1, argv + 1);
  return Tool().run(argc, argv);
}

}  // namespace emit::tool
