// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/geodesy.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/engage/flight_host.hpp"
#include "tool/engage/line_pipe.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {

/// State of an aircraft as JSBSim tells it, in the units of its properties.
struct JsbsimState {
  double time_s = 0.0;
  double latitude_rad = 0.0;  ///< geodetic
  double longitude_rad = 0.0;
  double height_m = 0.0;  ///< above sea level
  double roll_rad = 0.0;
  double pitch_rad = 0.0;
  double heading_rad = 0.0;
  double north_ft_s = 0.0;
  double east_ft_s = 0.0;
  double down_ft_s = 0.0;
};

/// Properties of JSBSim in the order of the members of JsbsimState behind the time.
[[nodiscard]] std::vector<std::string> jsbsim_properties();
/// Reads a row of JSBSim's CSV output with these properties. Errors (protocol): a wrong number of
/// cells, or one that is no finite number.
[[nodiscard]] physics::Result<JsbsimState> parse_jsbsim_row(const std::string& row);

/// Returns the pose in the world of a scenario. Latitude, longitude and height are those of WGS-84,
/// and the attitude is against north, east and down at the aircraft's own place.
[[nodiscard]] physics::Pose pose_of(const JsbsimState& state, const physics::GeoPlace& origin);

/// JSBSim as an outside program. Its console (TCP) steps it, and its CSV output, which is a named
/// pipe, tells every state with all digits. The aircraft flies by its own controls, and the seeker
/// is fixed to it.
class JsbsimHost final : public FlightHost {
 public:
  struct Options {
    std::filesystem::path program;  ///< JSBSim
    std::filesystem::path root;     ///< folder with aircraft/, engine/ and systems/
    std::string aircraft;
    double speed_m_s = 60.0;       ///< at the start, along the scenario's sensor, level
    double mount_pitch_rad = 0.0;  ///< of the seeker in the aircraft, up positive
    double rate_hz = 100.0;        ///< of the poses
    std::filesystem::path work;    ///< folder for scripts and logs
  };
  /// Starts JSBSim at the scenario's sensor, and holds it at its first state. Errors: not_found
  /// (the program, the aircraft), config (the sensor has no position), io, protocol.
  [[nodiscard]] static physics::Result<std::unique_ptr<JsbsimHost>> start(
      const scene::ScenarioDesc& scenario, std::int64_t start_ns, const Options& options);
  ~JsbsimHost() override;

  [[nodiscard]] std::string name() const override { return "JSBSim, " + options_.aircraft; }
  [[nodiscard]] bool guided() const noexcept override { return false; }
  [[nodiscard]] double time_s() const noexcept override { return state_.time_s - begin_s_; }
  [[nodiscard]] physics::Pose seeker_pose() const noexcept override;
  [[nodiscard]] std::optional<protocol::PoseRates> seeker_rates() const noexcept override {
    return std::nullopt;
  }
  [[nodiscard]] FlightTruth truth() const noexcept override;
  [[nodiscard]] std::optional<glm::dvec3> target_m(double) const noexcept override {
    return std::nullopt;
  }
  void measure(double, const std::optional<glm::dvec3>&) noexcept override {}
  [[nodiscard]] physics::Result<bool> advance(double step_s) override;
  [[nodiscard]] const JsbsimState& state() const noexcept { return state_; }

 private:
  JsbsimHost(Options options, const physics::GeoPlace& origin, LinePipe rows)
      : options_(std::move(options)), origin_(origin), rows_(std::move(rows)) {}
  [[nodiscard]] physics::Result<void> launch(std::uint16_t port);
  [[nodiscard]] physics::Result<void> connect(std::uint16_t port);
  [[nodiscard]] physics::Result<void> iterate();
  /// Reads rows until one is newer than the state. False: none came within the timeout.
  [[nodiscard]] physics::Result<bool> next_state(std::chrono::milliseconds timeout);

  Options options_;
  physics::GeoPlace origin_;
  LinePipe rows_;
  std::optional<Subprocess> process_;
  int console_ = -1;
  std::uint32_t steps_ = 1;  ///< of JSBSim between two poses
  JsbsimState state_;
  bool has_state_ = false;
  double begin_s_ = 0.0;
  std::uint64_t poses_ = 0;
};

}  // namespace emit::tool
