// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

/// Output files of MODTRAN in wavenumbers: tape7, and tape7.scn, which is tape7 after a slit. Their
/// columns have fixed places, so a blank field is a value of zero and not a missing column.
namespace emit::config {

/// One run of a file.
struct Tape7Run {
  std::uint32_t line = 0;  ///< of the columns' names
  double sensor_m = 0.0;   ///< H1, above sea level
  double elevation_deg = 0.0;
  double range_m = 0.0;
  bool leaves_air = false;  ///< the path ends at the top of the atmosphere
  /// Temperature of the model atmosphere along a level path (ITYPE 1); empty for other paths and
  /// where the cards name no model atmosphere.
  std::optional<double> level_k;
  /// Sample at a wavenumber. The radiance is that of the path alone: the total without what the
  /// surface at its end emits and reflects.
  struct Sample {
    double wavenumber_per_cm = 0.0;
    double transmittance_frac = 0.0;
    double radiance_w_m2_sr_per_cm = 0.0;  ///< W m-2 sr-1 per cm-1
  };
  bool has_radiance = false;    ///< false: the run gives transmittances only
  std::vector<Sample> samples;  ///< ascending, two or more
};

/// Returns whether a file looks like tape7: a line that begins with FREQ or WAVLEN and names
/// columns.
[[nodiscard]] bool is_tape7(const std::filesystem::path& file);

/// Reads all runs of a file but those of direct solar irradiance, which say nothing of a path's
/// radiance. Errors: not_found, io; config, naming file and line (no run, a run without path, a
/// field that is blank, not in its place or no number, wavenumbers that do not ascend, columns that
/// are not known, wavelengths instead of wavenumbers).
[[nodiscard]] physics::Result<std::vector<Tape7Run>> load_tape7(const std::filesystem::path& file);

/// Air of one run in a band.
struct Tape7Air {
  double transmittance_frac = 0.0;  ///< weighted by a blackbody of 300 K
  double path_radiance_w_m2_sr = 0.0;
};
/// Returns the integrals of a run over a band, by the trapezoidal rule between the samples, the
/// points of the response and the ends of the band. It is empty where the run does not cover the
/// band. Without radiance of its own a run emits like air of `level_k`.
/// @pre run.has_radiance or run.level_k
[[nodiscard]] std::optional<Tape7Air> tape7_air(const Tape7Run& run,
                                                const scene::SpectralBand& band);

}  // namespace emit::config
