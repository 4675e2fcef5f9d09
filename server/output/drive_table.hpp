// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::server {

/// Table from radiance to the drive of an emitter: linear between its points, and constant beyond
/// its ends.
///
/// Thread: any after construction. Real time: apply() is RT-safe.
class DriveTable {
 public:
  struct Point {
    double radiance_w_m2_sr = 0.0;
    double drive = 0.0;
  };

  /// Reads a CSV file `radiance_w_m2_sr,drive`. Radiance rises from row to row; drive rises, falls,
  /// or stays, but never turns. Errors: those of physics::CsvReader; config, naming file and line.
  [[nodiscard]] static physics::Result<DriveTable> read(const std::filesystem::path& file);
  /// Makes a table of points. Errors (config): fewer than two points, numbers that float32 cannot
  /// hold, radiances that do not rise (in float32), drives that turn. The message names the point.
  [[nodiscard]] static physics::Result<DriveTable> make(std::span<const Point> points) {
    std::size_t at_fault = 0;
    return make(points, at_fault);
  }

  /// Replaces each radiance by its drive, d_i + (L - L_i) (d_i+1 - d_i) / (L_i+1 - L_i) in float32.
  /// A value that is no number gets the drive of the first point.
  /// @return how many values lay beyond the ends
  std::uint32_t apply(std::span<float> values) const noexcept;

 private:
  DriveTable() = default;
  /// `at_fault` becomes the index of the point that an error is about, or the number of points.
  [[nodiscard]] static physics::Result<DriveTable> make(std::span<const Point> points,
                                                        std::size_t& at_fault);
  /// Adds a point. Returns what is wrong with it, or nothing. `way` is the sign of the drive's way.
  [[nodiscard]] std::string add(const Point& point, double& way);
  /// Fills `parts_`. Returns false where float32 cannot tell the parts apart.
  [[nodiscard]] bool divide();

  std::vector<float> radiances_;  // of the points, and infinity
  std::vector<float> drives_;
  std::vector<float> slopes_;  // from a point to the next one; the last one has none
  /// Point at the begin of each of equally wide parts of the table. A look-up goes on from there,
  /// by `most_steps_` points at most.
  std::vector<std::int32_t> parts_;
  std::int32_t last_part_ = 0;
  float parts_per_radiance_ = 0.0F;
  std::int32_t most_steps_ = 0;
};

}  // namespace emit::server
