// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/geodesy.hpp"
#include "emit/reference/measured_plate.hpp"

/// Records of loggers on level, open ground: CSV tables as weather stations write them.
///
/// Columns are known by name. Each quantity has one column, in one of its units:
///
/// | quantity | column | needed |
/// |---|---|---|
/// | time since the record's first midnight or any other instant | `time_s`, `time_min`, `time_h` |
/// yes | | direct sun across its beam; diffuse on level ground | `dni_w_m2`; `dhi_w_m2` | these two
/// or the next | | global sun on level ground | `ghi_w_m2` | counts where the two above, place or
/// date are missing | | sun that the ground reflects | `reflected_w_m2` | no: gives the absorptance
/// | | long-wave from the sky | `longwave_down_w_m2` | yes | | surface | `longwave_up_w_m2`,
/// `surface_k`, `surface_c` | yes | | air | `air_k`, `air_c` | yes | | wind, 10 m up | `wind_m_s` |
/// this or `film_w_m2_k` | | film of the air | `film_w_m2_k` | no | | relative humidity | `rh_pct`
/// | no: for moist materials and signs of dew | | heat that evaporation takes | `latent_w_m2` | no:
/// dry materials lose it |
///
/// An empty cell, `nan` and codes at or below -999 mean that the value is missing; rows without a
/// needed value are left out and counted. Direct and diffuse sun win over global sun, whose
/// instrument errs by its levelling and at low sun. Comment lines may state place and date as
/// "37.70 N, 105.92 W, 2317 m" and "UTC of 2016-01-01".
namespace emit::tool {

struct LoggerOptions {
  /// "COLUMN=NAME": the file calls the column NAME.
  std::vector<std::string> columns;
  // These win over what the comment lines state.
  std::optional<double> lat_deg;
  std::optional<double> lon_deg;
  std::optional<double> height_m;
  std::string date;     ///< YYYY-MM-DD, UTC, of time 0; empty: not stated
  std::string surface;  ///< words about the ground, as comment lines have them; empty: none
};

/// One row of a logger, and what a model of dry ground does not need.
struct LoggerRecord {
  std::filesystem::path file;
  /// Rows with all needed values. `surface_k` is set by set_emissivity().
  std::vector<reference::LoggerRow> rows;
  std::vector<double> longwave_up_w_m2;  ///< by row; empty: the file has the temperature itself
  std::vector<double> rh_frac;           ///< by row, NaN where missing; empty: no such column
  std::vector<double> latent_w_m2;       ///< likewise
  std::optional<double> reflected_frac;  ///< reflected over incident sun, by sums over the record
  /// Share of the sun that came while it stood below the horizon, if place and date are known.
  std::optional<double> dark_sun_frac;
  /// Mean size of the difference between global sun and what direct and diffuse add up to, by mean
  /// global sun, over the rows that have all three.
  std::optional<double> sun_gap_frac;
  std::optional<double> lat_deg;
  std::optional<double> lon_deg;
  std::optional<double> height_m;
  std::optional<std::int64_t> epoch_utc_ns;  ///< of time 0
  std::string words;                         ///< comment lines and LoggerOptions::surface
  std::vector<std::string> notes;            ///< what was filled, clamped or left out
};

/// Errors: those of the CSV reader; invalid_argument and parse, naming file, line and column.
[[nodiscard]] physics::Result<LoggerRecord> read_logger(const std::filesystem::path& file,
                                                        const LoggerOptions& options);

/// Place of the record; 0 where it is not known.
[[nodiscard]] physics::GeoPlace place_of(const LoggerRecord& record) noexcept;

/// Gives the rows the surface temperature that follows from long-wave radiation up and down. It
/// does nothing where the file states the temperature.
void set_emissivity(LoggerRecord& record, double emissivity_frac);

}  // namespace emit::tool
