// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"

/// Numerical stability of the shader functions. Millions of random and hostile inputs go through
/// the same GLSL code that draws the images, and each result is checked on the CPU in double.
/// Inputs are drawn from (seed, case number) by integer arithmetic that is the same on device and
/// CPU (shaders/shared/stability_inputs.glsl.h), so a sweep repeats exactly and any case can be
/// drawn again.
/// Thread: any; every sweep creates and destroys its own context on the calling thread.  Real time:
/// setup only, it allocates and starts threads.
namespace emit::verify {

/// Options of a sweep.
struct SweepOptions {
  std::uint64_t cases = 100'000'000;  ///< number of cases, at most 4294967295
  std::uint32_t seed = 20140621;
  int gpu_index = -1;    ///< index as in gl::EglContext::create()
  unsigned threads = 0;  ///< threads of the check; 0: one per processor
  /// Function called between chunks with the part done, 0..1. When it returns false, the sweep
  /// stops with an error.
  std::function<bool(double)> progress;
};

/// Row of the result table. Errors are taken over the finite results; an error that does not apply
/// is NaN.
struct SweepResult {
  std::string test;
  std::string computed_by;  ///< "shader" or "cpu float32"
  std::uint64_t cases = 0;
  std::uint64_t nan_count = 0;
  std::uint64_t inf_count = 0;
  std::uint64_t clamped_count = 0;    ///< cases that raised the clamped flag
  std::uint64_t unflagged_count = 0;  ///< cases outside the valid range that did not raise the flag
  std::uint64_t below_zero_count = 0;  ///< negative temperatures or radiances
  double max_error_k = 0.0;
  double p99_error_k = 0.0;
  double max_error_frac = 0.0;  ///< relative error of the temperature or of the radiance
  double over_1mk_frac = 0.0;   ///< fraction of the finite results that miss by more than 1 mK
  std::string worst_input;      ///< input at which max_error_k (else max_error_frac) occurred
  std::string note;
};

/// Result of a sweep.
struct SweepReport {
  std::string device;
  std::vector<SweepResult> results;
};

/// Sweeps the equilibrium temperature. `cases` draws come from the box of conductivity 0.02..400
/// W/m/K, thickness 0.1 mm..1 m, emissivity 0.02..1, radiative temperature 0..1000 K and core
/// 200..400 K, where each value lies on an edge with probability 1/4. The printed closed forms run
/// on the same inputs. A quarter as many draws have temperatures up to 6000 K and convection; an
/// eighth each are hostile surfaces and raw bit patterns. The truth is a monotone Newton iteration
/// on the balance in double, from the same float32 inputs.
/// Errors: gpu; internal when device and CPU draw different inputs or the sweep was stopped.
[[nodiscard]] physics::Result<SweepReport> sweep_equilibrium(const SweepOptions& options);

/// Spectral band with its name.
struct NamedBand {
  std::string name;
  physics::Band band;
};
/// Sweeps the in-band radiance of the renderer's table, per band: `cases` temperatures of 0..6000 K
/// against the quadrature in double, and as many with hostile values among them. `max_error_k` is
/// the radiance error divided by dL/dT. Errors as for sweep_equilibrium().
[[nodiscard]] physics::Result<SweepReport> sweep_band_radiance(const SweepOptions& options,
                                                               std::span<const NamedBand> bands);

/// Sweeps the relaxation: time constants 5 s..3e6 s, four step lengths of 1 ns to a year in turn, 1
/// to 1e5 steps, constant and linear drive within 128 K of the reference. The truth is the same
/// recursion in double with gains from expm1. The note states the error bound that applied to every
/// case. Errors as for sweep_equilibrium().
[[nodiscard]] physics::Result<SweepReport> sweep_relaxation(const SweepOptions& options);

/// Recorded history of one surface: the equilibrium temperature at nodes, linear in between.
struct DriveHistory {
  std::string name;
  std::vector<double> node_s;   ///< times of the nodes, ascending
  std::vector<double> drive_k;  ///< one value per node
  double start_k = 0.0;
  std::vector<double> tau_s;        ///< one value per mode, 1..3 modes
  std::vector<double> weight_frac;  ///< one weight per mode
};
/// Cuts every interval of every history into `splits` equal parts (each 1..1000), with the drive
/// linear across them, and relaxes it by the shader's own steps. Returns one row per split count,
/// in order: the difference to the unsplit history (maximum and 99th percentile over the
/// histories). Errors: gpu; invalid_argument.
[[nodiscard]] physics::Result<SweepReport> sweep_split(std::span<const DriveHistory> histories,
                                                       std::span<const std::uint32_t> splits,
                                                       int gpu_index);

}  // namespace emit::verify
