// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::renderer {

/// Sun and weather of a scenario at any instant of the thermal history, with changes that the host
/// sent. Owner: Renderer. Real time: everything but the constructor is RT-safe.
class Environment {
 public:
  static constexpr std::size_t kMaxLiveSamples = 4096;

  explicit Environment(const scene::ScenarioDesc& scenario);

  /// Holds from its time on until the next one; false when time goes back. A row equal to the
  /// newest changes nothing. When the store is full, its oldest half is thinned to every other one.
  bool append(const physics::WeatherSample& row) noexcept;
  void reset() noexcept;

  /// Instants at which live weather changes, ascending.
  [[nodiscard]] std::span<const std::int64_t> changes_ns() const noexcept { return changes_ns_; }

  /// What the host sent and is kept, ascending.
  [[nodiscard]] std::span<const physics::WeatherSample> live() const noexcept { return live_; }

  /// The earliest instant from which the weather is not what it was at that revision; the lowest
  /// there is where it may be any, the highest where nothing has changed.
  [[nodiscard]] std::int64_t changed_since_ns(std::uint64_t revision) const noexcept;

  /// Goes up with every change by the host.
  [[nodiscard]] std::uint64_t revision() const noexcept { return revision_; }

  [[nodiscard]] physics::SunPosition sun_at(std::int64_t sim_time_ns) const noexcept;
  [[nodiscard]] physics::Forcing forcing_at(std::int64_t sim_time_ns,
                                            const physics::SunPosition& sun) const noexcept;

 private:
  physics::GeoPlace place_;
  std::int64_t epoch_utc_ns_ = 0;
  physics::ClearSky clear_sky_;
  std::vector<physics::WeatherSample> table_;
  std::vector<physics::WeatherSample> live_;
  std::vector<std::int64_t> changes_ns_;  ///< times of live_
  std::vector<std::uint64_t> revisions_;  ///< of live_, ascending
  std::uint64_t revision_ = 0;
  std::uint64_t reset_revision_ = 0;
};

}  // namespace emit::renderer
