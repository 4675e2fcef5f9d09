// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"

/// Numerical stability of the shader functions: random and hostile inputs by the million through
/// the very GLSL code that draws the images, each result checked on the CPU in double. Inputs are
/// drawn from (seed, case number) by integer arithmetic that is the same on device and CPU
/// (shaders/shared/stability_inputs.glsl.h), so a sweep repeats exactly and any case can be drawn
/// again. Any thread; every sweep creates and destroys its own context on the calling thread.
/// Setup class: allocates, starts threads.
namespace emit::verify {

struct SweepOptions {
  std::uint64_t cases = 100'000'000;  ///< at most 4294967295
  std::uint32_t seed = 20140621;
  int gpu_index = -1;    ///< as gl::EglContext::create()
  unsigned threads = 0;  ///< for the check; 0: one per processor
  /// Called between chunks with the share done, 0..1; false stops the sweep with an error.
  std::function<bool(double)> progress;
};

/// One row of the table. Errors are over the finite results; an error that does not apply is NaN.
struct SweepResult {
  std::string test;
  std::string computed_by;  ///< "shader" or "cpu float32"
  std::uint64_t cases = 0;
  std::uint64_t nan_count = 0;
  std::uint64_t inf_count = 0;
  std::uint64_t clamped_count = 0;     ///< cases that raised the clamped flag
  std::uint64_t unflagged_count = 0;   ///< inputs outside the valid range without the flag
  std::uint64_t below_zero_count = 0;  ///< negative temperatures or radiances
  double max_error_k = 0.0;
  double p99_error_k = 0.0;
  double max_error_frac = 0.0;  ///< of the temperature, or of the radiance
  double over_1mk_frac = 0.0;   ///< share of finite results that miss by more than 1 mK
  std::string worst_input;      ///< where max_error_k (else max_error_frac) was met
  std::string note;
};

struct SweepReport {
  std::string device;
  std::vector<SweepResult> results;
};

/// Equilibrium temperature: the box (lambda 0.02..400 W/m/K, d 0.1 mm..1 m, emissivity 0.02..1,
/// radiative temperature 0..1000 K, core 200..400 K; each on an edge with probability 1/4) with
/// `cases` draws, the printed closed forms on the same inputs; a quarter as many with temperatures
/// to 6000 K and convection; an eighth each of hostile surfaces and of raw bit patterns.
/// Truth: monotone Newton on the balance in double, from the same float32 inputs.
/// Errors: gpu; internal when device and CPU draw different inputs or the sweep was stopped.
[[nodiscard]] physics::Result<SweepReport> sweep_equilibrium(const SweepOptions& options);

struct NamedBand {
  std::string name;
  physics::Band band;
};
/// In-band radiance from the renderer's table, per band: `cases` temperatures of 0..6000 K against
/// the quadrature in double, and as many with hostile values among them. `max_error_k` is the
/// radiance error over dL/dT.
[[nodiscard]] physics::Result<SweepReport> sweep_band_radiance(const SweepOptions& options,
                                                               std::span<const NamedBand> bands);

/// Relaxation: time constants 5 s..3e6 s, four step lengths of 1 ns to a year in turn, 1 to 1e5
/// steps, constant and linear drive within 128 K of the reference, against the same recursion in
/// double with gains from expm1. The note states the bound that every case was held to.
[[nodiscard]] physics::Result<SweepReport> sweep_relaxation(const SweepOptions& options);

/// A recorded history of one surface: equilibrium temperature at nodes, linear in between.
struct DriveHistory {
  std::string name;
  std::vector<double> node_s;   ///< ascending
  std::vector<double> drive_k;  ///< as many
  double start_k = 0.0;
  std::vector<double> tau_s;        ///< 1..3 modes
  std::vector<double> weight_frac;  ///< as many
};
/// Every interval of every history cut into `splits` equal parts (each 1..1000) with the drive
/// linear across them, relaxed by the shader's own steps. One row per split count, in order: the
/// difference to the unsplit history (max, p99 over the histories). Errors: gpu; invalid_argument.
[[nodiscard]] physics::Result<SweepReport> sweep_split(std::span<const DriveHistory> histories,
                                                       std::span<const std::uint32_t> splits,
                                                       int gpu_index);

}  // namespace emit::verify
