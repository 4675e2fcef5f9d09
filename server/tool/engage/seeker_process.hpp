// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "tool/engage/line_pipe.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {

/// Answer of a seeker to one frame (server/docs/engage.md).
struct SeekerAnswer {
  std::uint64_t frame_number = 0;
  std::uint64_t host_frame_number = 0;
  bool found = false;
  // The members below hold where the target was found.
  double x_px = 0.0;
  double y_px = 0.0;
  double azimuth_rad = 0.0;    ///< right of the optical axis
  double elevation_rad = 0.0;  ///< above the optical axis
  double quality = 0.0;
};

/// Reads a line of a seeker. Errors (protocol): no JSON object, a key that is missing or of another
/// type, a number that is not finite, an angle of more than half a turn.
[[nodiscard]] physics::Result<SeekerAnswer> parse_answer(const std::string& line);

/// Returns the unit vector in the world towards a point that a sensor of this pose sees at these
/// angles.
[[nodiscard]] glm::dvec3 direction_of(const SeekerAnswer& answer, const physics::Pose& sensor);

/// A seeker program that reads frames from shared memory and prints answers. Single thread.
class SeekerProcess {
 public:
  struct Options {
    std::string command;  ///< shell command; empty: the reference seeker of the Python package
    std::string method = "hot-spot";
    std::string url;  ///< shm://NAME
    std::string channel;
    double focal_px = 0.0;
    bool newest = false;  ///< answers to the newest frames alone
    std::filesystem::path log;
  };
  /// Starts the program and waits until it is ready. Errors: not_found (the Python package), io
  /// (it ended, or was not ready in time), with the last lines of its log.
  [[nodiscard]] static physics::Result<SeekerProcess> start(const Options& options,
                                                            std::chrono::milliseconds timeout);

  /// Returns the next answer; nothing when none came within the timeout. Errors: protocol, io.
  [[nodiscard]] physics::Result<std::optional<SeekerAnswer>> next(
      std::chrono::milliseconds timeout);

 private:
  SeekerProcess(Subprocess process, LinePipe lines, std::filesystem::path log)
      : process_(std::move(process)), lines_(std::move(lines)), log_(std::move(log)) {}
  [[nodiscard]] physics::Error with_log(physics::Error error) const;

  Subprocess process_;
  LinePipe lines_;
  std::filesystem::path log_;
};

}  // namespace emit::tool
