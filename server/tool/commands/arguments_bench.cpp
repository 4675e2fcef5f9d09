// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/arguments.hpp"
#include "bench/frame_time/scaling_axes.hpp"

namespace emit::tool {

void Tool::add_bench_commands() {
  CLI::App* bench = app_.add_subcommand("bench", "Benchmarks; results as JSON");
  bench->require_subcommand(1);
  bench->footer("Example: emit bench paper --json paper.json");
  {
    auto [app, o] = add<BenchPaperCommand>(
        *bench, "paper", "Scenes and step counts of the published tables, 1024x768",
        "emit bench paper --json paper.json --scene box --steps 27", run_bench_paper);
    app.add_option("--scene", o.scenes, "box or statue; repeatable; default both")
        ->allow_extra_args(false);
    app.add_option("--steps", o.steps, "History steps; repeatable; default 27 and 90")
        ->allow_extra_args(false)
        ->check(positive());
    app.add_option("--frames", o.frames, "Frames per result, at least 5; cached takes at least 300")
        ->check(CLI::Range(5U, 100000U))
        ->capture_default_str();
    app.add_option("--width", o.width_px, "Image width, px")->capture_default_str();
    app.add_option("--height", o.height_px, "Image height, px")->capture_default_str();
    app.add_option("--method", o.methods, "Thermal method; repeatable; default both")
        ->allow_extra_args(false)
        ->check(CLI::IsMember({"per-frame", "cached"}))
        ->capture_default_str();
    app.add_option("--model", o.model, "Thermal model; default emit2014, the paper's own")
        ->check(CLI::IsMember({"emit2014", "foster"}));
    app.add_option(
           "--pixels", o.pixels,
           "Surface pixels per picture whose error is computed; published figures: 20000 or more")
        ->check(CLI::Range(1U, 100'000'000U))
        ->capture_default_str();
    app.add_flag("--no-errors", o.no_errors, "Times only: spares the reference");
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchErrorCommand>(
        *bench, "error-vs-time",
        "What every setting costs in time and in error against the reference solver",
        "emit bench error-vs-time --json error.json --csv error.csv --plot error.svg",
        run_bench_error);
    app.add_option("--scene", o.scenes,
                   "Scenario; repeatable; default block-on-road, ribbed, statue, airfield")
        ->allow_extra_args(false);
    app.add_flag("--quick", o.quick, "Models, spacings and two step counts only");
    add_path(app, "--csv", o.csv, "Write the results as CSV");
    add_path(app, "--plot", o.plot, "Write the diagrams as SVG");
    add_path(app, "--figures", o.figures,
             "Folder for pictures and profiles of reference and models")
        ->type_name("DIR");
    app.add_option("--frames", o.frames, "Frames timed per setting")
        ->check(positive())
        ->capture_default_str();
    app.add_option("--width", o.width_px, "Image width, px")->capture_default_str();
    app.add_option("--height", o.height_px, "Image height, px")->capture_default_str();
    app.add_option("--rays", o.rays, "Rays per face or pixel of the reference")
        ->check(positive())
        ->capture_default_str();
    app.add_option("--refine", o.refine, "Refinement of the three-dimensional reference")
        ->check(positive())
        ->capture_default_str();
    app.add_option("--pixels", o.pixels,
                   "Surface pixels the reference solves (published figures: 20000 or more); 0: all")
        ->capture_default_str();
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchStreamCommand>(
        *bench, "stream",
        "Transport alone: canned frames over loopback and shared memory, first at a fixed rate, "
        "then as fast as they go, beside bare sockets in the same run",
        "emit bench stream --json stream.json --frames 1000 --rate 200", run_bench_stream);
    add_count(app, "--frames", o.frames, "Frames per client at the fixed rate")
        ->check(positive())
        ->capture_default_str();
    app.add_option("--rate", o.rate_hz, "Frames a second")
        ->check(positive())
        ->capture_default_str();
    app.add_option("--width", o.width_px, "Image width, px")->capture_default_str();
    app.add_option("--height", o.height_px, "Image height, px")->capture_default_str();
    app.add_option("--clients", o.clients, "Clients at the fixed rate")
        ->check(CLI::Range(1U, 8U))
        ->capture_default_str();
    CLI::Option* transport =
        app.add_option(
               "--transport", o.transports,
               "Transport at the fixed rate; repeatable; mixed: tcp, udp, shm in turn; tcp-lz4: "
               "compressed")
            ->allow_extra_args(false)
            ->check(CLI::IsMember({"tcp", "tcp-lz4", "udp", "shm", "mixed"}))
            ->capture_default_str();
    app.add_option("--repeats", o.repeats,
                   "Interleaved measurements of throughput, medians of which count; 0: none")
        ->check(CLI::Range(0U, 1000U))
        ->capture_default_str();
    CLI::Option* only =
        app.add_option("--only", o.only,
                       "Of the throughput measurements only this one, e.g. tcp, and nothing at a "
                       "fixed rate; repeatable; default: all")
            ->allow_extra_args(false)
            ->check(CLI::IsMember(stream_contenders()))
            ->type_name("NAME")
            ->excludes(transport);
    app.add_option("--cpus", o.cpus,
                   "Cores of the daemon's agents, as realtime.cpus has them, e.g. \"sender=0, "
                   "render=1\"; default: wherever the kernel likes, like all yardsticks");
    app.add_option("--loss", o.losses,
                   "Nothing but this: frames over UDP through a network that loses this share of "
                   "the datagrams: without help, with resend, with error correction; repeatable")
        ->allow_extra_args(false)
        ->check(CLI::Range(0.0, 0.9))
        ->type_name("FRAC")
        ->excludes(only);
    app.add_option("--burst", o.burst_mean, "--loss: datagrams lost in a row, mean")
        ->check(CLI::Range(1.0, 1000.0))
        ->capture_default_str();
    add_error_correction(app, "--fec", o.fec);
    app.add_option("--payload", o.payload_bytes, "--loss: bytes of a fragment")
        ->check(CLI::Range(320U, 65000U))
        ->capture_default_str();
    app.add_option("--seed", o.seed, "--loss: loses other datagrams")
        ->type_name("N")
        ->capture_default_str();
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchIsolationCommand>(
        *bench, "isolation",
        "What a stopped and a flooding client cost the others: p99 of their intervals between "
        "frames, in interleaved pairs of runs with and without, beside a run against itself",
        "emit bench isolation --json isolation.json", run_bench_isolation);
    add_count(app, "--frames", o.frames, "Frames per client and run")
        ->check(CLI::Range(10U, 1'000'000U))
        ->capture_default_str();
    app.add_option("--rate", o.rate_hz, "Frames a second")
        ->check(positive())
        ->capture_default_str();
    app.add_option("--width", o.width_px, "Image width, px")->capture_default_str();
    app.add_option("--height", o.height_px, "Image height, px")->capture_default_str();
    app.add_option("--clients", o.clients, "Clients that are watched: tcp, udp, shm in turn")
        ->check(CLI::Range(1U, 8U))
        ->capture_default_str();
    app.add_option("--pairs", o.pairs, "Pairs of runs; medians count; fewer than 15 are not judged")
        ->check(CLI::Range(1U, 1000U))
        ->capture_default_str();
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchStabilityCommand>(*bench, "stability",
                                               "Shader functions and whole frames under random and "
                                               "hostile input, against double: NaN, Inf "
                                               "and errors in kelvin",
                                               "emit bench stability --json stability.json",
                                               run_bench_stability);
    add_count(app, "--cases", o.cases,
              "Random surfaces of the equilibrium sweep; the other sweeps follow in proportion")
        ->check(CLI::Range(std::uint64_t{1000}, std::uint64_t{4'000'000'000}))
        ->capture_default_str();
    app.add_option("--seed", o.seed, "Draws other cases")->type_name("N")->capture_default_str();
    app.add_option("--part", o.parts, "Part of the suite; repeatable; default all")
        ->allow_extra_args(false)
        ->check(CLI::IsMember(stability_parts()));
    app.add_option("--frame", o.frames, "Test of part frames, e.g. frame-zero-area; repeatable")
        ->allow_extra_args(false);
    add_path(app, "--pictures", o.pictures, "Existing folder for the hostile frames as PNG")
        ->type_name("DIR");
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchConvergenceCommand>(
        *bench, "convergence",
        "How the error of the reference solvers falls with their cells and steps",
        "emit bench convergence --plot convergence.svg", run_bench_convergence);
    add_path(app, "--plot", o.plot, "Write the diagrams as SVG");
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchThermalTruthCommand>(
        *bench, "thermal-truth",
        "Split steps, a moved camera, a parked vehicle's print and a restart: what the thermal "
        "history must not depend on, and what it must show",
        "emit bench thermal-truth --json truth.json", run_bench_thermal_truth);
    app.add_option("--method", o.method, "thermal.method to judge")
        ->check(CLI::IsMember({"per-frame", "cached"}))
        ->capture_default_str();
    app.add_option("--steps", o.steps, "History steps")
        ->check(CLI::Range(1U, 4096U))
        ->capture_default_str();
    app.add_option("--width", o.width_px, "Image width, px")->capture_default_str();
    app.add_option("--height", o.height_px, "Image height, px")->capture_default_str();
    add_path(app, "--pictures", o.pictures, "Existing folder for the judged frames as PNG")
        ->type_name("DIR");
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  add_frame_time_benches(*bench);
}

void Tool::add_frame_time_benches(CLI::App& bench) {
  {
    auto [app, o] = add<BenchScalingCommand>(
        bench, "scaling",
        "How frame time grows with history steps, triangles, pixels, objects out of view and "
        "thermal samples",
        "emit bench scaling --json scaling.json --axis steps", run_bench_scaling);
    app.add_option("--axis", o.axes, "Axis; repeatable; default all")
        ->allow_extra_args(false)
        ->check(CLI::IsMember(scaling_axes()));
    app.add_option("--method", o.methods, "Thermal method; repeatable; default both")
        ->allow_extra_args(false)
        ->check(CLI::IsMember({"per-frame", "cached"}));
    app.add_flag("--quick", o.quick, "Small scenes and coarse pictures, in seconds");
    app.add_option("--pairs", o.pairs, "cached: frames of two scenes that are shown in turn")
        ->check(CLI::Range(15U, 100'000U))
        ->capture_default_str();
    app.add_option("--per-frame-frames", o.per_frame_frames, "per-frame: frames timed per scene")
        ->check(CLI::Range(1U, 100'000U))
        ->capture_default_str();
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchCrowdCommand>(
        bench, "crowd",
        "The airfield with and without ten thousand figures of a thousand triangles: frame time, "
        "thermal samples and their memory",
        "emit bench crowd --json crowd.json", run_bench_crowd);
    add_set(app, o.set);
    app.add_option("--instances", o.instances, "Figures")
        ->check(CLI::Range(1U, 1'000'000U))
        ->capture_default_str();
    app.add_option("--triangles", o.triangles, "Of each figure, at least")
        ->check(CLI::Range(1000U, 1'000'000U))
        ->capture_default_str();
    app.add_option("--pairs", o.pairs, "Frames of the two scenes that are shown in turn")
        ->check(CLI::Range(15U, 100'000U))
        ->capture_default_str();
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchTurnCommand>(
        bench, "turn",
        "Worst frame while the camera turns all round in a second, and after jumps to places that "
        "nobody announced",
        "emit bench turn --json turn.json --set thermal.tolerance_k=0.5", run_bench_turn);
    app.add_option("--scene", o.scene, "Scenario with a camera trajectory: turns at its end")
        ->capture_default_str();
    add_set(app, o.set);
    app.add_option("--method", o.methods, "Thermal method; repeatable")
        ->allow_extra_args(false)
        ->check(CLI::IsMember({"per-frame", "cached"}))
        ->capture_default_str();
    app.add_option("--runs", o.runs, "Turns, and jumps; all after one warm-up")
        ->check(CLI::Range(1U, 1000U))
        ->capture_default_str();
    app.add_option("--frames", o.frames, "Frames per turn")
        ->check(CLI::Range(2U, 100'000U))
        ->capture_default_str();
    app.add_option("--budget", o.budget_frac,
                   "Once more with a deadline: share of the free-running median")
        ->check(CLI::Range(0.01, 100.0))
        ->capture_default_str();
    app.add_option("--width", o.width_px, "Image width, px")->capture_default_str();
    app.add_option("--height", o.height_px, "Image height, px")->capture_default_str();
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchLiveCommand>(
        bench, "live",
        "The scenario's entities driven by its script and by a host that tells the same poses: "
        "frame times in turn, and temperatures beside those of the script in shorter intervals",
        "emit bench live --seconds 60 --json live.json", run_bench_live);
    app.add_option("--scene", o.scene, "Scenario whose entities move")->capture_default_str();
    add_set(app, o.set);
    app.add_option("--seconds", o.seconds, "Sim time, s")
        ->check(CLI::Range(1.0, 86'400.0))
        ->capture_default_str();
    app.add_option("--rate", o.rate_hz, "Frames and host poses per second of sim time")
        ->check(CLI::Range(0.1, 1000.0))
        ->capture_default_str();
    app.add_option("--every", o.every_s, "Sim time between pictures that are compared, s")
        ->check(CLI::Range(0.001, 3600.0))
        ->capture_default_str();
    app.add_option("--finest", o.finest_s, "thermal.first_step_s of the reference, s")
        ->check(CLI::Range(0.01, 3600.0))
        ->capture_default_str();
    app.add_option("--weather-every", o.weather_every_s,
                   "A cloud passes, of which the script knows and the host tells that often, s; "
                   "0: clear sky")
        ->check(CLI::Range(0.0, 3600.0))
        ->capture_default_str();
    app.add_option("--width", o.width_px, "Image width, px")->capture_default_str();
    app.add_option("--height", o.height_px, "Image height, px")->capture_default_str();
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
  {
    auto [app, o] = add<BenchBudgetCommand>(
        bench, "budget",
        "The scenario's flight within less time per frame than full quality takes: frames that "
        "keep to it, and what they get wrong beside what they say",
        "emit bench budget --budget 0.8 --json budget.json", run_bench_budget);
    app.add_option("--scene", o.scene, "Scenario with a camera trajectory")->capture_default_str();
    add_set(app, o.set);
    app.add_option("--budget", o.budgets,
                   "Time per frame, as a part of the median at full quality; repeatable")
        ->allow_extra_args(false)
        ->check(positive())
        ->capture_default_str();
    app.add_option("--frames", o.frames, "Frames of the flight")
        ->check(CLI::Range(2U, 1'000'000U))
        ->capture_default_str();
    app.add_option("--width", o.width_px, "Image width, px")->capture_default_str();
    app.add_option("--height", o.height_px, "Image height, px")->capture_default_str();
    add_gpu(app, o.gpu_index);
    add_json(app, o.json);
  }
}

}  // namespace emit::tool
