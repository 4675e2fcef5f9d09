// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "emit/physics/climate/rain.hpp"
#include "emit/physics/sky/cloud_field.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::renderer {

/// Sun and weather of a scenario at any instant of the thermal history, including the changes that
/// the host sent. Owner: Renderer.
/// Thread: the renderer's.  Real time: everything but the constructor is RT-safe.
class Environment {
 public:
  /// Largest number of live samples.
  static constexpr std::size_t kMaxLiveSamples = 4096;

  explicit Environment(const scene::ScenarioDesc& scenario);

  /// Adds a weather sample of the host. It holds from its time on until the next one. Returns false
  /// when its time is before the newest one. A row equal to the newest changes nothing. When the
  /// store is full, its oldest half is thinned to every other sample.
  bool append(const physics::WeatherSample& row) noexcept;
  /// Forgets the live samples.
  void reset() noexcept;

  /// Returns the instants at which live weather changes, ascending.
  [[nodiscard]] std::span<const std::int64_t> changes_ns() const noexcept { return changes_ns_; }

  /// Returns the live samples that are kept, ascending in time.
  [[nodiscard]] std::span<const physics::WeatherSample> live() const noexcept { return live_; }

  /// Returns the earliest instant from which the weather differs from that of a revision. It
  /// returns the lowest number when any instant may differ, and the highest one when nothing has
  /// changed.
  [[nodiscard]] std::int64_t changed_since_ns(std::uint64_t revision) const noexcept;

  /// Returns the revision, which every change by the host raises.
  [[nodiscard]] std::uint64_t revision() const noexcept { return revision_; }

  /// Returns true if it rains at any instant that is known.
  [[nodiscard]] bool rains() const noexcept { return !table_rain_.is_dry() || live_rains_; }
  /// Returns the depth of rain between two instants, mm.
  [[nodiscard]] double rain_mm(std::int64_t begin_ns, std::int64_t end_ns) const noexcept {
    return rains() ? rain_until_mm(end_ns) - rain_until_mm(begin_ns) : 0.0;
  }

  /// Returns the position of the sun.
  [[nodiscard]] physics::SunPosition sun_at(std::int64_t sim_time_ns) const noexcept;
  /// Returns the weather. `sun` is the result of sun_at() for the same instant.
  [[nodiscard]] physics::Forcing forcing_at(std::int64_t sim_time_ns,
                                            const physics::SunPosition& sun) const noexcept;

  /// Returns the broken clouds over the scene; null without any. They live as long as the
  /// environment.
  [[nodiscard]] const physics::CloudField* clouds() const noexcept { return clouds_.get(); }
  /// Returns the direct sun under these clouds, for results of forcing_at() and sun_at() for the
  /// same instant. @pre clouds() != nullptr
  [[nodiscard]] physics::CloudLight cloud_light(const physics::Forcing& forcing,
                                                const physics::SunPosition& sun) const noexcept {
    return clouds_->light(forcing, sun, place_, clear_sky_.linke_turbidity);
  }

 private:
  [[nodiscard]] double rain_until_mm(std::int64_t sim_time_ns) const noexcept;

  physics::GeoPlace place_;
  std::int64_t epoch_utc_ns_ = 0;
  physics::ClearSky clear_sky_;
  std::vector<physics::WeatherSample> table_;
  double usual_dew_point_k_ = 0.0;  ///< where the weather states no humidity
  double film_factor_ = 1.0;
  std::shared_ptr<const physics::CloudField> clouds_;  ///< copies of the environment share it
  std::vector<physics::WeatherSample> live_;
  std::vector<std::int64_t> changes_ns_;  ///< times of the rows of live_
  physics::RainDepth table_rain_;
  std::vector<double> live_rain_mm_;  ///< depth at the rows of live_
  bool live_rains_ = false;
  std::vector<std::uint64_t> revisions_;  ///< revisions of the rows of live_, ascending
  std::uint64_t revision_ = 0;
  std::uint64_t reset_revision_ = 0;
};

}  // namespace emit::renderer
