// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <optional>

#include "emit/protocol/cigi/host_packets.hpp"
#include "emit/protocol/host_frame.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// Weather of a CIGI host over that of the scenario.
///
/// Air temperature, humidity, wind and its direction of Atmosphere Control replace the scenario's,
/// and so does the cover of the cloud layers of Weather Control. A humidity of 0 % is one that the
/// host does not know: the scenario's holds. A clear-sky model is evaluated with them; of a table
/// of weather, only these columns change. The Component Control "radiation" states all of it
/// instead.
///
/// Thread: one owner. Real time: RT-safe after construction.
class CigiWeather {
 public:
  /// Component Control of class atmosphere with all of the weather, as six floats: direct normal,
  /// diffuse horizontal and long-wave irradiance (W m-2), air temperature (K), wind (m/s) and cloud
  /// cover (0..1).
  static constexpr std::uint16_t kRadiationComponent = 1;
  /// Time between two samples of weather that changes with time of day.
  static constexpr std::int64_t kRefreshNs = 60'000'000'000;

  /// `scenario` may be null and outlives the object.
  explicit CigiWeather(const scene::ScenarioDesc* scenario) : scenario_(scenario) {}

  /// Goes back to the weather of the scenario.
  void clear() noexcept;
  /// Returns false where it has no effect: temperature or wind are out of range.
  bool take(const protocol::cigi::AtmosphereControl& packet) noexcept;
  /// Returns false where it has no effect: a region, an entity, or no layer of clouds.
  bool take(const protocol::cigi::WeatherControl& packet) noexcept;
  /// Returns false where it has no effect: another component, or numbers out of range.
  bool take(const protocol::cigi::ComponentControl& packet) noexcept;
  /// Sends everything with the next frame again.
  void mark() noexcept { changed_ = is_set(); }

  /// Returns the weather that a host frame at that time carries; none: nothing has changed.
  [[nodiscard]] std::optional<protocol::EnvironmentData> take_change(
      std::int64_t sim_time_ns) noexcept;

 private:
  [[nodiscard]] bool is_set() const noexcept { return air_k_ || cloud_frac_ || stated_; }
  [[nodiscard]] protocol::EnvironmentData at(std::int64_t sim_time_ns) const noexcept;

  const scene::ScenarioDesc* scenario_;
  std::optional<double> air_k_;
  double wind_m_s_ = 0.0;                ///< comes with `air_k_`
  double wind_from_deg_ = 0.0;           ///< comes with `air_k_`
  std::optional<double> humidity_frac_;  ///< comes with `air_k_`
  std::array<double, 4> cover_frac_{};   ///< of layers 1 to 3
  std::optional<double> cloud_frac_;
  std::optional<protocol::EnvironmentData> stated_;
  bool changed_ = false;
  std::int64_t sent_ns_ = 0;
};

}  // namespace emit::server
