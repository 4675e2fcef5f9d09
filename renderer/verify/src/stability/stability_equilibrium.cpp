// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "emit/physics/constants.hpp"
#include "emit/verify/stability.hpp"
#include "shared/stability_inputs.glsl.h"
#include "stability_device.hpp"
#include "stability_parallel.hpp"

namespace emit::verify {
namespace {

using inputs::SurfaceInput;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kSigma = physics::kStefanBoltzmannWPerM2K4;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// Coefficients of e T^4 + G T = A.
struct Quartic {
  double emission = 0.0;
  double conductance = 0.0;
  double source = 0.0;
  double source_parts = 0.0;  ///< sum of the magnitudes of the terms of A
};

float flushed(float value) {
  return std::abs(value) < std::numeric_limits<float>::min() ? 0.0F : value;
}

/// Largest divisor for which GLSL 4.50 section 4.7.1 states a precision: 2^126.
constexpr float kMaxDivisor = 0x1p126F;

/// Returns the surface as devices may take it: numbers below the normal range are zero, and so is a
/// quotient by a divisor beyond kMaxDivisor, whose reciprocal is below the normal range.
SurfaceInput as_devices_may_take(SurfaceInput s) {
  for (float* value : {&s.conductivity_w_m_k, &s.thickness_m, &s.emissivity_frac, &s.radiative_k,
                       &s.core_k, &s.film_w_m2_k, &s.air_k}) {
    *value = flushed(*value);
  }
  if (std::isfinite(s.conductivity_w_m_k) && std::abs(s.thickness_m) > kMaxDivisor) {
    s.conductivity_w_m_k = 0.0F;
  }
  return s;
}

Quartic quartic_of(const SurfaceInput& s) {
  const double eps = s.emissivity_frac;
  const double ta = s.radiative_k;
  const double film = s.film_w_m2_k;
  const double body = static_cast<double>(s.conductivity_w_m_k) / s.thickness_m;
  const double terms[] = {eps * kSigma * ta * ta * ta * ta, body * s.core_k, film * s.air_k};
  return {eps * kSigma, body + film, terms[0] + terms[1] + terms[2],
          std::abs(terms[0]) + std::abs(terms[1]) + std::abs(terms[2])};
}

/// Returns the positive root by Newton's method from above. The left side is convex, so the
/// iteration is monotone and converges from any start that is not below the root. Both asymptotes
/// are such starts.
double root_k(const Quartic& b) {
  const double radiative_k = std::sqrt(std::sqrt(b.source / b.emission));
  // When G = 0 the second value is infinite.
  double t = std::min(radiative_k, b.source / b.conductance);
  for (int i = 0; i < 60; ++i) {
    const double t3 = t * t * t;
    const double step = ((b.emission * t3 + b.conductance) * t - b.source) /
                        (4.0 * b.emission * t3 + b.conductance);
    t -= step;
    if (std::abs(step) <= 1e-13 * t) break;
  }
  return t;
}

/// Ranges to which lib/equilibrium.glsl limits its arguments.
constexpr double kMinEmission = 1e-20, kMaxEmission = 1.0;
constexpr double kMaxConductance = 1e16;
constexpr double kMinSource = 1e-9, kMaxSource = 1e18;

/// Relative distance from a limit within which float32 may round a value to its other side.
constexpr double kMargin = 1e-5;

bool surely_outside(double value, double low, double high, double rounding) {
  return !(value >= low * (1.0 - kMargin) - rounding && value <= high * (1.0 + kMargin));
}

bool clearly_invalid(const Quartic& b) {
  return surely_outside(b.emission, kMinEmission, kMaxEmission, 0.0) ||
         surely_outside(b.conductance, 0.0, kMaxConductance, 1e-37) ||
         surely_outside(b.source, kMinSource, kMaxSource, kMargin * b.source_parts);
}

std::string describe(const SurfaceInput& s) {
  return fmt::format(
      "lambda {:.7g} W/m/K, d {:.7g} m, eps {:.7g}, Ta {:.8g} K, Tc {:.8g} K, "
      "h {:.7g} W/m2/K, Tair {:.7g} K",
      s.conductivity_w_m_k, s.thickness_m, s.emissivity_frac, s.radiative_k, s.core_k,
      s.film_w_m2_k, s.air_k);
}

/// Published closed form in IEEE float32, term by term as in the shader.
struct ClosedForms {
  float typeset_k = 0.0F;
  float corrected_k = 0.0F;
  float stable_k = 0.0F;
};
ClosedForms closed_forms(const SurfaceInput& s) {
  const float b =
      s.thickness_m * static_cast<float>(kSigma) * s.emissivity_frac / s.conductivity_w_m_k;
  const float t_b = 1.0F / std::cbrt(b);
  const float theta_c = s.core_k / t_b;
  const float theta_a = s.radiative_k / t_b;
  const float theta_a4 = theta_a * theta_a * theta_a * theta_a;
  const float q = theta_c + theta_a4;
  const float n = std::sqrt(256.0F * q * q * q + 27.0F);
  const float k = std::cbrt(n / (2.0F * 5.19615242F) + 0.5F);
  const float root = std::sqrt(3.0F * k * k - 4.0F * theta_c - 4.0F * theta_a4);
  const float head =
      2.0F * std::sqrt(3.0F * k) / root - k + (4.0F * theta_c + 4.0F * theta_a4) / (3.0F * k);
  const float tail = root / std::sqrt(3.0F * k);
  const float p = 4.0F * q / 3.0F;
  const float c = std::cbrt(0.5F + std::sqrt(0.25F + p * p * p));
  const float u = 1.0F / (c * c + p + (p / c) * (p / c));
  const float r = std::sqrt(u);
  const float theta = 4.0F * q * r / ((1.0F + u * r) * (std::sqrt(2.0F / r - u) + r));
  return {t_b / 2.0F * std::sqrt(head - tail), t_b / 2.0F * (std::sqrt(head) - tail), t_b * theta};
}

struct Row {
  const char* test;
  const char* computed_by;
  const char* note;
};

/// Domain of inputs: shader, words per case and rows of the table.
struct Domain {
  int id = 0;
  std::uint64_t cases = 0;
  std::size_t words = 2;
  std::vector<Row> rows;
};

std::vector<Domain> domains(std::uint64_t cases) {
  return {{EMIT_DOMAIN_BOX,
           cases,
           5,
           {{"equilibrium", "shader", "every result against Newton in double"},
            {"printed-eq6", "shader", "EMIT Eq. 6 as typeset: its outer root spans the last term"},
            {"corrected-eq6", "shader", "EMIT Eq. 6, its outer root closed before the last term"},
            {"stable-closed-form", "shader", "equivalent closed form without cancellation"},
            {"printed-eq6", "cpu float32", "the same in IEEE float32 with a correct cube root"},
            {"corrected-eq6", "cpu float32", "the same in IEEE float32 with a correct cube root"},
            {"stable-closed-form", "cpu float32",
             "the same in IEEE float32 with a correct cube root"}}},
          {EMIT_DOMAIN_EXTENDED,
           std::max<std::uint64_t>(cases / 4, 1),
           2,
           {{"equilibrium-extended", "shader",
             "temperatures 0..6000 K, film 0..120 W/m2/K; float32 resolves 0.5 mK at 6000 K"}}},
          {EMIT_DOMAIN_HOSTILE,
           std::max<std::uint64_t>(cases / 8, 1),
           2,
           {{"equilibrium-hostile", "shader",
             "zero, negative, denormal, huge, Inf and NaN inputs: flagged, never NaN out"}}},
          {EMIT_DOMAIN_RAW,
           std::max<std::uint64_t>(cases / 8, 1),
           2,
           {{"equilibrium-any-bits", "shader",
             "any three bit patterns as coefficients: flagged, never NaN out"}}}};
}

/// Adds the error of a result against the root. A relative error is meaningless near 0 K.
void add(Tally& tally, float result, double truth_k, std::uint32_t index) {
  const double error_k = std::abs(static_cast<double>(result) - truth_k);
  tally.add(result, truth_k, error_k, truth_k > 1.0 ? error_k / truth_k : 0.0, index);
}

class EquilibriumSweep {
 public:
  EquilibriumSweep(const SweepOptions& options, const Domain& domain)
      : options_(options), domain_(domain), total_(domain.rows.size()) {}

  Result<void> run(SweepProgram& program, std::uint64_t& done, std::uint64_t all) {
    for (std::uint64_t first = 0; first < domain_.cases; first += SweepProgram::kCasesPerChunk) {
      const auto count = static_cast<std::uint32_t>(
          std::min<std::uint64_t>(SweepProgram::kCasesPerChunk, domain_.cases - first));
      const auto first_case = static_cast<std::uint32_t>(first);
      if (auto ok = program.run(first_case, count, options_.seed, words_); !ok) return ok;
      check_in_parallel(count, options_.threads, total_,
                        [&](std::uint32_t row, std::vector<Tally>& tallies) {
                          check(first_case + row, words_.data() + row * domain_.words, tallies);
                        });
      done += count;
      if (options_.progress &&
          !options_.progress(static_cast<double>(done) / static_cast<double>(all))) {
        return make_error(ErrorCode::internal, "stability sweep: stopped");
      }
    }
    return {};
  }

  void write(std::vector<SweepResult>& out) const {
    for (std::size_t i = 0; i < total_.size(); ++i) {
      const Row& row = domain_.rows[i];
      SweepResult result{
          .test = row.test, .computed_by = row.computed_by, .worst_input = {}, .note = row.note};
      total_[i].write(result);
      if (total_[i].has_worst()) result.worst_input = worst(total_[i].worst_case());
      out.push_back(std::move(result));
    }
  }

 private:
  [[nodiscard]] Quartic raw(std::uint32_t index) const {
    const auto at = [&](std::uint32_t dimension) {
      return static_cast<double>(inputs::raw_coefficient(options_.seed, index, dimension));
    };
    return {at(0), at(1), at(2), std::abs(at(2))};
  }
  [[nodiscard]] SurfaceInput surface(std::uint32_t index) const {
    return inputs::surface_input(options_.seed, index, static_cast<std::uint32_t>(domain_.id));
  }

  [[nodiscard]] std::string worst(std::uint32_t index) const {
    if (domain_.id != EMIT_DOMAIN_RAW) return describe(surface(index));
    const Quartic b = raw(index);
    return fmt::format("emission {:.9g}, conductance {:.9g}, source {:.9g}", b.emission,
                       b.conductance, b.source);
  }

  void check(std::uint32_t index, const float* words, std::vector<Tally>& tallies) const {
    const bool clamped = words[1] != 0.0F;
    if (domain_.id == EMIT_DOMAIN_HOSTILE || domain_.id == EMIT_DOMAIN_RAW) {
      const bool is_raw = domain_.id == EMIT_DOMAIN_RAW;
      const Quartic b = is_raw ? raw(index) : quartic_of(surface(index));
      // The case is invalid in exact arithmetic as well as in that of a device.
      const bool nonsense =
          clearly_invalid(b) &&
          (is_raw || clearly_invalid(quartic_of(as_devices_may_take(surface(index)))));
      tallies[0].add_flag(clamped, !nonsense);
      if (is_raw && !clamped) {
        // Only the relative error counts, because such coefficients give temperatures of any size.
        const double truth_k = root_k(b);
        tallies[0].add(words[0], truth_k, kNone, std::abs(words[0] - truth_k) / truth_k, index);
      } else {
        tallies[0].add_unknown(words[0]);
      }
      return;
    }
    const SurfaceInput s = surface(index);
    const Quartic b = quartic_of(s);
    // When nothing is absorbed and the core is at 0 K, the root is 0 K and the guarded result must
    // be next to it.
    const double truth_k = b.source > 0.0 ? root_k(b) : 0.0;
    tallies[0].add_flag(clamped, !clearly_invalid(b));
    add(tallies[0], words[0], truth_k, index);
    if (domain_.id != EMIT_DOMAIN_BOX) return;
    for (std::size_t form = 0; form < 3; ++form) {
      add(tallies[1 + form], words[2 + form], truth_k, index);
    }
    const ClosedForms forms = closed_forms(s);
    add(tallies[4], forms.typeset_k, truth_k, index);
    add(tallies[5], forms.corrected_k, truth_k, index);
    add(tallies[6], forms.stable_k, truth_k, index);
  }

  const SweepOptions& options_;
  const Domain& domain_;
  std::vector<Tally> total_;
  std::vector<float> words_;
};

/// Checks that device and CPU draw the same bits, on which every other check relies.
Result<void> compare_inputs(std::uint32_t seed, int domain) {
  constexpr std::uint32_t kCases = 4096;
  const gl::Define define{"EMIT_DOMAIN", fmt::format("{}", domain)};
  auto program = SweepProgram::create("passes/stability_inputs.comp", {&define, 1}, 8);
  if (!program) return tl::unexpected(std::move(program.error()));
  std::vector<float> words;
  // Use the last cases of the range, which show an overflow of index arithmetic.
  const std::uint32_t first = std::numeric_limits<std::uint32_t>::max() - kCases;
  if (auto ok = program->run(first, kCases, seed, words); !ok) return ok;
  for (std::uint32_t row = 0; row < kCases; ++row) {
    const std::uint32_t index = first + row;
    const SurfaceInput s = inputs::surface_input(seed, index, static_cast<std::uint32_t>(domain));
    const std::array<float, 8> expected{s.conductivity_w_m_k,
                                        s.thickness_m,
                                        s.emissivity_frac,
                                        s.radiative_k,
                                        s.core_k,
                                        s.film_w_m2_k,
                                        inputs::temperature_input(seed, index, true),
                                        inputs::drive_offset_k(seed, index, index & 1023U)};
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const std::uint32_t bits = inputs::floatBitsToUint(expected[i]);
      const std::uint32_t got = inputs::floatBitsToUint(words[8 * row + i]);
      if (bits == got) continue;
      // A quiet NaN may lose its payload in a register.
      if (std::isnan(expected[i]) && std::isnan(words[8 * row + i])) continue;
      return make_error(ErrorCode::internal,
                        fmt::format("stability sweep: case {}, input {}: the device drew "
                                    "0x{:08X}, the CPU 0x{:08X}",
                                    index, i, got, bits));
    }
  }
  return {};
}

}  // namespace

Result<SweepReport> sweep_equilibrium(const SweepOptions& options) {
  if (options.cases == 0 || options.cases > std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::invalid_argument, "1 to 4294967295 cases are possible");
  }
  auto context = gl::EglContext::create(options.gpu_index, false);
  if (!context) return tl::unexpected(std::move(context.error()));
  SweepReport report{context->device_name(), {}};
  const std::vector<Domain> all = domains(options.cases);
  std::uint64_t total = 0;
  for (const Domain& domain : all) total += domain.cases;
  std::uint64_t done = 0;
  for (const Domain& domain : all) {
    if (domain.id != EMIT_DOMAIN_RAW) {
      if (auto ok = compare_inputs(options.seed, domain.id); !ok) {
        return tl::unexpected(std::move(ok.error()));
      }
    }
    std::vector<gl::Define> defines{{"EMIT_DOMAIN", fmt::format("{}", domain.id)}};
    if (domain.id == EMIT_DOMAIN_BOX) defines.push_back({"EMIT_CLOSED_FORMS", "1"});
    auto program = SweepProgram::create("passes/stability_equilibrium.comp", defines, domain.words);
    if (!program) return tl::unexpected(std::move(program.error()));
    EquilibriumSweep sweep(options, domain);
    if (auto ok = sweep.run(*program, done, total); !ok) {
      return tl::unexpected(std::move(ok.error()));
    }
    sweep.write(report.results);
  }
  return report;
}

}  // namespace emit::verify
