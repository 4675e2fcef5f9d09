// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "emit/physics/relaxation.hpp"
#include "emit/verify/stability.hpp"
#include "shared/stability_inputs.glsl.h"
#include "stability_device.hpp"
#include "stability_parallel.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::size_t kStepLengths = 4;
constexpr std::size_t kWordsPerCase = 3 + 2 * kStepLengths;
constexpr std::uint32_t kCasesPerChunk = 4096;
constexpr std::uint32_t kMaxSteps = 100'000;
constexpr std::uint32_t kStepsPerDispatch = 32'768;
constexpr double kYearS = 365.25 * 86400.0;
/// Largest offset of drive and start, K. The offset between drive and state is at most twice as
/// large.
constexpr double kMaxOffsetK = 128.0;

struct Case {
  double tau_s = 0.0;
  std::array<double, kStepLengths> step_s{};
  std::uint32_t steps = 0;
  bool linear = false;
  double start_k = 0.0;
};

/// Dimensions of the random numbers above those of the drive's nodes.
constexpr std::uint32_t kTau = 1U << 20, kStart = kTau + 1, kSteps = kTau + 2, kKind = kTau + 3,
                        kStep = kTau + 8;

Case draw(std::uint32_t seed, std::uint32_t index) {
  const auto bits = [&](std::uint32_t dimension) {
    return inputs::random_bits(seed, index, dimension);
  };
  Case c;
  c.tau_s = inputs::logarithmic_between(bits(kTau), 5.0F, 3e6F);
  // One in four cases has one step length throughout, so that rounding adds up in one direction.
  const bool uniform = (bits(kKind) & 6U) == 0;
  for (std::size_t i = 0; i < kStepLengths; ++i) {
    c.step_s[i] =
        inputs::logarithmic_between(bits(kStep + (uniform ? 0U : static_cast<std::uint32_t>(i))),
                                    1e-9F, static_cast<float>(kYearS));
  }
  c.steps = static_cast<std::uint32_t>(
      inputs::logarithmic_between(bits(kSteps), 1.0F, static_cast<float>(kMaxSteps)));
  c.linear = (bits(kKind) & 1U) != 0;
  c.start_k = inputs::drive_offset_k(seed, index, kStart);
  return c;
}

std::string describe(const Case& c) {
  return fmt::format("tau {:.7g} s, steps of {:.4g}, {:.4g}, {:.4g}, {:.4g} s, {} steps, {} drive",
                     c.tau_s, c.step_s[0], c.step_s[1], c.step_s[2], c.step_s[3], c.steps,
                     c.linear ? "linear" : "constant");
}

std::array<physics::RelaxationGains<double>, kStepLengths> gains_of(const Case& c) {
  std::array<physics::RelaxationGains<double>, kStepLengths> gains;
  for (std::size_t i = 0; i < kStepLengths; ++i) {
    gains[i] = physics::relaxation_gains(c.step_s[i], c.tau_s);
  }
  return gains;
}

struct Truth {
  double offset_k = 0.0;
  double bound_k = 0.0;
};

/// Computes the recursion in double, with E and the gains from expm1 instead of the increments that
/// the shader adds. The bound adds up the worst case of every rounding: per step one unit in the
/// last place of the offset (in float32), because compilers may add the two increments one by one,
/// and the roundings of the increment, damped by the decay of a step.
Truth truth_of(const Case& c, std::uint32_t seed, std::uint32_t index) {
  constexpr double kUlp = std::numeric_limits<float>::epsilon();
  struct Factors {
    double decay = 0.0;
    double start = 0.0;
    double end = 0.0;
  };
  std::array<Factors, kStepLengths> factors;
  for (std::size_t i = 0; i < kStepLengths; ++i) {
    const double z = c.step_s[i] / c.tau_s;
    const double gain = -std::expm1(-z);
    // 1 - phi loses digits for small z. Two terms of its series are exact to 1e-13 there.
    const double end = z < 1e-4 ? z * (0.5 - z / 6.0 * (1.0 - 0.25 * z)) : 1.0 - gain / z;
    factors[i] = {1.0 - gain, gain - end, end};
  }
  Truth truth{c.start_k, 0.0};
  double u0 = inputs::drive_offset_k(seed, index, 0);
  for (std::uint32_t step = 0; step < c.steps; ++step) {
    const Factors& f = factors[step % kStepLengths];
    const double u1 = inputs::drive_offset_k(seed, index, step + 1);
    const double before_k = truth.offset_k;
    truth.offset_k = c.linear ? f.decay * before_k + f.start * u0 + f.end * u1
                              : f.decay * before_k + (f.start + f.end) * u0;
    const double increment_k =
        f.start * std::abs(u0 - before_k) + f.end * std::abs((c.linear ? u1 : u0) - before_k);
    truth.bound_k =
        f.decay * truth.bound_k + kUlp * (std::max(std::abs(truth.offset_k), std::abs(before_k)) +
                                          truth.bound_k + 2.5 * increment_k);
    u0 = u1;
  }
  // Devices may flush states below the normal range.
  truth.bound_k = 1.01 * truth.bound_k + 1e-30;
  return truth;
}

enum RowIndex : std::size_t { kConstant, kLinear, kRows };

}  // namespace

Result<SweepReport> sweep_relaxation(const SweepOptions& options) {
  if (options.cases == 0 || options.cases > std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::invalid_argument, "1 to 4294967295 cases are possible");
  }
  auto context = gl::EglContext::create(options.gpu_index, false);
  if (!context) return tl::unexpected(std::move(context.error()));
  auto program = SweepProgram::create("passes/stability_relaxation.comp", {}, 1);
  if (!program) return tl::unexpected(std::move(program.error()));
  const auto cases = static_cast<std::uint32_t>(options.cases);
  std::vector<Tally> total(kRows);
  std::vector<float> constants;
  std::vector<float> words;
  std::vector<double> shares(kCasesPerChunk);  // errors as a fraction of the bound
  std::array<double, kRows> max_bound_frac{};
  std::uint64_t steps = 0;
  for (std::uint32_t first = 0; first < cases; first += kCasesPerChunk) {
    const std::uint32_t count = std::min(kCasesPerChunk, cases - first);
    constants.clear();
    for (std::uint32_t row = 0; row < count; ++row) {
      const Case c = draw(options.seed, first + row);
      steps += c.steps;
      constants.insert(constants.end(), {static_cast<float>(c.steps), c.linear ? 1.0F : 0.0F,
                                         static_cast<float>(c.start_k)});
      for (const auto& gains : gains_of(c)) {
        constants.push_back(static_cast<float>(gains.start_frac));
        constants.push_back(static_cast<float>(gains.end_frac));
      }
    }
    program->set_constants(constants);
    for (std::uint32_t step = 0; step < kMaxSteps; step += kStepsPerDispatch) {
      program->set_steps(step, step + kStepsPerDispatch);
      if (auto ok = program->run(first, count, options.seed, words); !ok) {
        return tl::unexpected(std::move(ok.error()));
      }
    }
    check_in_parallel(
        count, options.threads, total, [&](std::uint32_t row, std::vector<Tally>& tallies) {
          const std::uint32_t index = first + row;
          const Case c = draw(options.seed, index);
          const Truth truth = truth_of(c, options.seed, index);
          const double error_k = std::abs(static_cast<double>(words[row]) - truth.offset_k);
          Tally& tally = tallies[c.linear ? kLinear : kConstant];
          // Offsets may be negative, so only counters and errors are of interest.
          tally.add(words[row], truth.offset_k, error_k, error_k / kMaxOffsetK, index);
          tally.add_flag(false, error_k <= truth.bound_k);
          shares[row] = error_k / truth.bound_k;
        });
    for (std::uint32_t row = 0; row < count; ++row) {
      double& most = max_bound_frac[draw(options.seed, first + row).linear ? kLinear : kConstant];
      most = std::max(most, shares[row]);
    }
    if (options.progress &&
        !options.progress(static_cast<double>(first + count) / static_cast<double>(cases))) {
      return make_error(ErrorCode::internal, "stability sweep: stopped");
    }
  }
  SweepReport report{context->device_name(), {}};
  static constexpr std::array<const char*, kRows> kTests{"relaxation-constant",
                                                         "relaxation-linear"};
  for (std::size_t i = 0; i < kRows; ++i) {
    SweepResult row{.test = kTests[i], .computed_by = "shader", .worst_input = {}, .note = {}};
    total[i].write(row);
    // Cases beyond the bound were counted as missing flags.
    const std::uint64_t over_bound = row.unflagged_count;
    row.below_zero_count = 0;
    row.note = fmt::format(
        "{} cases over the bound of a unit in the last place per step; most of the bound "
        "used: {:.2f}; {} steps in both rows",
        over_bound, max_bound_frac[i], steps);
    if (total[i].has_worst()) {
      row.worst_input = describe(draw(options.seed, total[i].worst_case()));
    }
    report.results.push_back(std::move(row));
  }
  return report;
}

}  // namespace emit::verify
