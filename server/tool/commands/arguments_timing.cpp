// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/arguments.hpp"
#include "tool/commands/timing_commands.hpp"

namespace emit::tool {

void Tool::add_timing_commands() {
  {
    auto [app, o] = add<LatencyCommand>(
        app_, "latency",
        "Transport delay end to end: sends poses as the host, switches a marker with each, and "
        "waits for the first frame that shows it; exits 1 when one was never shown",
        "emit latency udp://127.0.0.1:7000 --to udp://127.0.0.1:7001 --frames 1000", run_latency);
    app.footer(
        "Takes the host's place: a run of its own begins. The marker: --entity is switched on and "
        "off and found\nin the pictures by itself; the canned test pattern has a marker of its "
        "own; otherwise a frame shows\na pose when it carries its number. Delays across machines "
        "hold as far as their clocks agree.\n"
        "Example: emit latency udp://127.0.0.1:7000 --to udp://127.0.0.1:7001 --frames 1000");
    app.add_option("url", o.url, "Frames: tcp://host:port, udp://host:port or shm://name")
        ->required()
        ->type_name("URL");
    app.add_option("--to", o.to,
                   "Poses: udp://host:port (host port) or tcp://host:port (control port); "
                   "default: TCP to where the frames come from")
        ->type_name("URL");
    add_count(app, "--frames", o.frames, "Poses to measure")->check(positive());
    app.add_option("--rate", o.rate_hz,
                   "Poses a second at most, at random distances; the next one waits for the frame "
                   "of the last")
        ->type_name("HZ")
        ->check(CLI::Range(0.01, 10'000.0))
        ->capture_default_str();
    app.add_option("--entity", o.entity, "Entity of the scenario to switch on and off")
        ->type_name("ID");
    add_path(app, "--log", o.log, "Pose log whose first pose is held; default: the daemon's view");
    add_seconds(app, "--time-s", o.time_s, "Simulated time of the first pose")
        ->capture_default_str();
    add_seconds(app, "--timeout-s", o.timeout_s, "A pose not shown for this long is missed")
        ->check(positive())
        ->capture_default_str();
    app.add_option("--seed", o.seed, "Of the distances between poses")->capture_default_str();
    add_path(app, "--key-file", o.security.key_file,
             "Poses by udp: pre-shared key, as in the daemon's host.key_file");
    add_security(app, o.security);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<TriggerCommand>(
        app_, "trigger", "Sync source stand-in: sends triggers to pacing.mode = \"trigger\"",
        "emit trigger udp://127.0.0.1:7003 --rate 100 --frames 1000", run_trigger);
    app.add_option("to", o.to, "udp://host:port of trigger.udp")->required()->type_name("URL");
    app.add_option("--rate", o.rate_hz, "Triggers a second, by an absolute timer on CLOCK_TAI")
        ->type_name("HZ")
        ->check(CLI::Range(0.01, 10'000.0))
        ->capture_default_str();
    add_count(app, "--frames", o.frames, "Triggers to send; 0: until interrupted");
    app.add_flag("--stamp", o.stamp, "Say in each when it was sent, so that its delay is judged");
    add_path(
        app, "--key-file", o.key_file,
        "A MAC in each by the file's first key, as in the daemon's host.key_file; implies --stamp");
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<TraceCommand>(
        app_, "trace",
        "Stages of the frames sent last, as a Chrome trace for Perfetto or chrome://tracing",
        "emit trace http://127.0.0.1:7002 --out trace.json", run_trace);
    app.add_option("url", o.url, "http://host:port of metrics.listen")
        ->required()
        ->type_name("URL");
    add_path(app, "--out", o.out, "JSON file to write")->required();
  }
}

}  // namespace emit::tool
