// SPDX-License-Identifier: Apache-2.0
#include "bench/accuracy/accuracy_benches.hpp"
#include "bench/frame_time/frame_time_benches.hpp"
#include "bench/nature/nature_benches.hpp"
#include "bench/stability/stability_benches.hpp"
#include "bench/stream/stream_benches.hpp"
#include "tool/lab/lab.hpp"

namespace emit::tool {
namespace {

/// The suites stand in the order of `emit bench --help`.
constexpr void (*kSuites[])(CommandLine&) = {
    add_bench_paper,     add_bench_error,       add_bench_stream,        add_bench_isolation,
    add_bench_stability, add_bench_convergence, add_bench_thermal_truth, add_bench_scaling,
    add_bench_crowd,     add_bench_turn,        add_bench_live,          add_bench_budget,
    add_bench_output,    add_bench_nature,      add_bench_subpixel,      add_bench_gas,
    add_bench_clutter,   add_bench_uncertainty};

}  // namespace

void add_bench(CommandLine& tool) {
  CommandLine bench = tool.group(kBenchText);
  for (const auto add : kSuites) add(bench);
}

}  // namespace emit::tool
