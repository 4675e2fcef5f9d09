// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "bench/stability/bench_stability_frames.hpp"
#include "bench/stability/stability_benches.hpp"
#include "emit/verify/stability.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

struct StabilityOptions {
  std::optional<std::filesystem::path> json;
  std::uint64_t cases = 100'000'000;  ///< of the equilibrium sweep; the others follow
  std::uint32_t seed = 20140621;
  std::vector<std::string> parts;   ///< of stability_parts(); empty: all
  std::vector<std::string> frames;  ///< names of hostile frame tests; empty: all
  std::optional<std::filesystem::path> pictures;
  int gpu_index = -1;
};

/// Shares of the progress bar by the time that the parts take with the default number of cases.
struct Part {
  const char* name;
  double share;
};
constexpr std::array<Part, 4> kParts{
    {{"equilibrium", 0.55}, {"band-radiance", 0.1}, {"relaxation", 0.1}, {"frames", 0.25}}};

/// Number of equilibrium cases per case of a dearer part. A quadrature in double is thousands of
/// times dearer than the table, and a relaxation case takes 9000 steps on average.
constexpr std::uint64_t kCasesPerBandCase = 200;
constexpr std::uint64_t kCasesPerRelaxationCase = 20'000;

std::vector<verify::NamedBand> library_bands() {
  return {{"3-5", {3.0, 5.0, {}}},
          {"3.4-4.1", {3.4, 4.1, {}}},
          {"8-12", {8.0, 12.0, {}}},
          {"7.7-9.3", {7.7, 9.3, {}}}};
}

Json sweep_json(const verify::SweepResult& r) {
  Json json = Json::object();
  json.set("test", r.test).set("cases", r.cases).set("nan_count", r.nan_count);
  json.set("max_error_k", r.max_error_k).set("worst_input", r.worst_input);
  json.set("inf_count", r.inf_count).set("clamped_count", r.clamped_count);
  json.set("unflagged_count", r.unflagged_count).set("below_zero_count", r.below_zero_count);
  json.set("p99_error_k", r.p99_error_k).set("max_error_frac", r.max_error_frac);
  json.set("over_1mk_frac", r.over_1mk_frac);
  json.set("computed_by", r.computed_by).set("note", r.note);
  return json;
}

Json frame_json(const HostileFrameResult& r) {
  Json json = Json::object();
  json.set("test", r.test).set("cases", r.cases).set("nan_count", r.nan_count);
  json.set("max_error_k", r.max_error_k).set("worst_input", r.worst_input);
  json.set("inf_count", r.inf_count).set("clamped_count", r.clamped_count);
  json.set("nonfinite_px", r.nonfinite_px).set("p99_error_k", r.p99_error_k);
  json.set("frames", r.frames).set("computed_by", "renderer").set("note", r.note);
  return json;
}

std::string kelvin(double value) {
  return std::isfinite(value) ? fmt::format("{:.3g}", value) : std::string("-");
}

class StabilityBench {
 public:
  explicit StabilityBench(const StabilityOptions& command)
      : command_(command), progress_("bench stability", 1000) {}

  int run() {
    if (wanted("equilibrium")) {
      if (auto ok = sweep(verify::sweep_equilibrium(options(0, command_.cases))); !ok) {
        return fail(ok.error());
      }
    }
    if (wanted("band-radiance")) {
      const auto bands = library_bands();
      const std::uint64_t cases = std::max<std::uint64_t>(command_.cases / kCasesPerBandCase, 1000);
      if (auto ok = sweep(verify::sweep_band_radiance(options(1, cases), bands)); !ok) {
        return fail(ok.error());
      }
    }
    if (wanted("relaxation")) {
      const std::uint64_t cases =
          std::max<std::uint64_t>(command_.cases / kCasesPerRelaxationCase, 100);
      if (auto ok = sweep(verify::sweep_relaxation(options(2, cases))); !ok) {
        return fail(ok.error());
      }
    }
    if (wanted("frames")) {
      if (auto ok = frames(); !ok) return fail(ok.error());
    }
    progress_.finish();
    return write();
  }

 private:
  [[nodiscard]] bool wanted(const std::string& part) const {
    return command_.parts.empty() ||
           std::find(command_.parts.begin(), command_.parts.end(), part) != command_.parts.end();
  }

  [[nodiscard]] std::function<bool(double)> progress_of(std::size_t part) {
    double before = 0.0;
    for (std::size_t i = 0; i < part; ++i) before += kParts[i].share;
    return [this, before, share = kParts[part].share](double done) {
      progress_.advance_to(static_cast<std::uint64_t>(1000.0 * (before + share * done)));
      return !InterruptGuard::interrupted();
    };
  }

  [[nodiscard]] verify::SweepOptions options(std::size_t part, std::uint64_t cases) {
    verify::SweepOptions options;
    options.cases = cases;
    options.seed = command_.seed;
    options.gpu_index = command_.gpu_index;
    options.progress = progress_of(part);
    return options;
  }

  physics::Result<void> sweep(const physics::Result<verify::SweepReport>& report) {
    if (!report) return tl::unexpected(report.error());
    device_ = report->device;
    for (const verify::SweepResult& r : report->results) {
      results_.push(sweep_json(r));
      table_.add({r.test, r.computed_by, fmt::format("{}", r.cases), fmt::format("{}", r.nan_count),
                  fmt::format("{}", r.inf_count), fmt::format("{}", r.clamped_count),
                  kelvin(r.max_error_k), kelvin(r.p99_error_k), kelvin(r.max_error_frac)});
    }
    return {};
  }

  physics::Result<void> frames() {
    HostileFrameOptions options;
    options.gpu_index = command_.gpu_index;
    options.only = command_.frames;
    if (command_.pictures) options.picture_dir = *command_.pictures;
    options.progress = progress_of(3);
    const auto results = run_hostile_frames(options);
    if (!results) return tl::unexpected(results.error());
    for (const HostileFrameResult& r : *results) {
      device_ = r.device;
      results_.push(frame_json(r));
      table_.add({r.test, "renderer", fmt::format("{}", r.cases), fmt::format("{}", r.nan_count),
                  fmt::format("{}", r.inf_count), fmt::format("{}", r.clamped_count),
                  kelvin(r.max_error_k), kelvin(r.p99_error_k), "-"});
    }
    return {};
  }

  int write() {
    if (command_.json != std::filesystem::path("-")) {
      fmt::print("{}, commit {}, seed {}\n{}", device_, kCommit, command_.seed, table_.to_string());
    }
    if (!command_.json) return kExitOk;
    Json json = Json::object();
    json.set("device", device_).set("commit", kCommit).set("suite", "stability");
    json.set("seed", command_.seed).set("cases", command_.cases);
    json.set("results", std::move(results_));
    if (auto written = write_json(*command_.json, json); !written) return fail(written.error());
    return kExitOk;
  }

  const StabilityOptions& command_;
  InterruptGuard interrupt_;
  Progress progress_;
  std::string device_;
  Json results_ = Json::array();
  TextTable table_{
      {"test", "computed by", "cases", "NaN", "Inf", "clamped", "max K", "p99 K", "max rel."}};
};

std::vector<std::string> stability_parts() {
  std::vector<std::string> names;
  for (const Part& part : kParts) names.emplace_back(part.name);
  return names;
}

int run(const StabilityOptions& command) {
  return StabilityBench(command).run();
}

void add_options(CommandLine& line, StabilityOptions& options) {
  line.count("--cases", options.cases,
             "Random surfaces of the equilibrium sweep; the other sweeps follow in proportion")
      .in_range(std::uint64_t{1000}, std::uint64_t{4'000'000'000})
      .show_default();
  line.option("--seed", options.seed, "Draws other cases").type_name("N").show_default();
  line.option("--part", options.parts, "Part of the suite; repeatable; default all")
      .repeatable()
      .one_of(stability_parts());
  line.option("--frame", options.frames, "Test of part frames, e.g. frame-zero-area; repeatable")
      .repeatable();
  line.output_folder("--pictures", options.pictures,
                     "Existing folder for the hostile frames as PNG",
                     CommandLine::OutputFolder::exists);
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_stability(CommandLine& bench) {
  bench.command<StabilityOptions>({.name = "stability",
                                   .text = "Shader functions and whole frames under random and "
                                           "hostile input, against double: NaN, Inf "
                                           "and errors in kelvin",
                                   .example = "emit bench stability --json stability.json"},
                                  add_options, run);
}

}  // namespace emit::tool
