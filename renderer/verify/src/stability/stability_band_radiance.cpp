// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "emit/physics/band_radiance_lut.hpp"
#include "emit/verify/stability.hpp"
#include "shared/stability_inputs.glsl.h"
#include "stability_device.hpp"
#include "stability_parallel.hpp"

namespace emit::verify {
namespace {

using physics::BandRadianceLut;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kMinNormal = std::numeric_limits<float>::min();

// Temperature range of the accuracy promise, and that of the renderer's tables, K.
constexpr double kPromiseLowK = 200.0, kPromiseHighK = 3000.0;
constexpr double kTableLowK = 10.0, kTableHighK = 6000.0;

enum RowIndex : std::size_t { kPromised, kWhole, kHostile, kRows };

class BandSweep {
 public:
  BandSweep(const SweepOptions& options, const NamedBand& band) : options_(options), band_(band) {}

  Result<void> run(SweepProgram& program, bool hostile, std::uint32_t cases) {
    std::vector<float> words;
    for (std::uint32_t first = 0; first < cases; first += SweepProgram::kCasesPerChunk) {
      const std::uint32_t count = std::min(SweepProgram::kCasesPerChunk, cases - first);
      if (auto ok = program.run(first, count, options_.seed, words); !ok) return ok;
      check_in_parallel(count, options_.threads, total_,
                        [&](std::uint32_t row, std::vector<Tally>& tallies) {
                          const float* result = words.data() + 2 * std::size_t{row};
                          const std::uint32_t index = first + row;
                          const float t = inputs::temperature_input(options_.seed, index, hostile);
                          if (hostile) {
                            check_hostile(t, result, tallies[kHostile]);
                          } else {
                            check(t, result, index, tallies);
                          }
                        });
    }
    return {};
  }

  void write(std::vector<SweepResult>& out) const {
    static constexpr std::array<const char*, kRows> kTests{"band-radiance", "band-radiance-0-6000",
                                                           "band-radiance-hostile"};
    static constexpr std::array<const char*, kRows> kNotes{
        "200..3000 K",
        "0..6000 K; below 10 K and where the radiance underflows float32 it must be flagged or 0",
        "negative, huge, Inf and NaN temperatures among them: flagged, never NaN out"};
    for (std::size_t i = 0; i < kRows; ++i) {
      SweepResult row{.test = fmt::format("{} {}", kTests[i], band_.name),
                      .computed_by = "shader",
                      .worst_input = {},
                      .note = kNotes[i]};
      total_[i].write(row);
      if (total_[i].has_worst()) {
        row.worst_input = fmt::format(
            "{:.9g} K", inputs::temperature_input(options_.seed, total_[i].worst_case(), false));
      }
      out.push_back(std::move(row));
    }
  }

 private:
  static bool in_table(float t) { return t >= kTableLowK && t <= kTableHighK; }

  void check(float t, const float* result, std::uint32_t index, std::vector<Tally>& tallies) const {
    Tally& whole = tallies[kWhole];
    whole.add_flag(result[1] != 0.0F, in_table(t));
    const auto truth = physics::band_radiance(band_.band, physics::Kelvin(static_cast<double>(t)));
    if (!in_table(t) || truth.radiance_w_m2_sr < kMinNormal) {
      whole.add_unknown(result[0]);
      return;
    }
    const double error = std::abs(static_cast<double>(result[0]) - truth.radiance_w_m2_sr);
    const double error_k = error / truth.derivative_w_m2_sr_k;
    const double error_frac = error / truth.radiance_w_m2_sr;
    whole.add(result[0], truth.radiance_w_m2_sr, error_k, error_frac, index);
    if (t >= kPromiseLowK && t <= kPromiseHighK) {
      tallies[kPromised].add_flag(result[1] != 0.0F, true);
      tallies[kPromised].add(result[0], truth.radiance_w_m2_sr, error_k, error_frac, index);
    }
  }

  static void check_hostile(float t, const float* result, Tally& tally) {
    tally.add_flag(result[1] != 0.0F, in_table(t));
    tally.add_unknown(result[0]);
  }

  const SweepOptions& options_;
  const NamedBand& band_;
  std::vector<Tally> total_ = std::vector<Tally>(kRows);
};

}  // namespace

Result<SweepReport> sweep_band_radiance(const SweepOptions& options,
                                        std::span<const NamedBand> bands) {
  if (options.cases == 0 || options.cases > std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::invalid_argument, "1 to 4294967295 cases are possible");
  }
  auto context = gl::EglContext::create(options.gpu_index, false);
  if (!context) return tl::unexpected(std::move(context.error()));
  SweepReport report{context->device_name(), {}};
  const auto cases = static_cast<std::uint32_t>(options.cases);
  std::size_t done = 0;
  for (const NamedBand& band : bands) {
    const auto lut = BandRadianceLut::build(band.band);
    if (!lut) return tl::unexpected(lut.error());
    BandSweep sweep(options, band);
    for (const bool hostile : {false, true}) {
      const gl::Define define{"EMIT_HOSTILE", hostile ? "1" : "0"};
      auto program = SweepProgram::create("passes/stability_band_radiance.comp", {&define, 1}, 2);
      if (!program) return tl::unexpected(std::move(program.error()));
      program->set_constants(lut->nodes());
      program->set_layout(lut->shader_layout(0));
      if (auto ok = sweep.run(*program, hostile, cases); !ok) {
        return tl::unexpected(std::move(ok.error()));
      }
    }
    sweep.write(report.results);
    ++done;
    if (options.progress &&
        !options.progress(static_cast<double>(done) / static_cast<double>(bands.size()))) {
      return make_error(ErrorCode::internal, "stability sweep: stopped");
    }
  }
  return report;
}

}  // namespace emit::verify
