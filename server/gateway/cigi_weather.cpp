// SPDX-License-Identifier: Apache-2.0
#include "gateway/cigi_weather.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>

#include "emit/physics/climate/rain.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "emit/protocol/convert.hpp"

namespace emit::server {

namespace cigi = protocol::cigi;

void CigiWeather::clear() noexcept {
  air_k_.reset();
  humidity_frac_.reset();
  cover_frac_ = {};
  cloud_frac_.reset();
  stated_.reset();
  changed_ = false;
}

bool CigiWeather::take(const cigi::AtmosphereControl& packet) noexcept {
  protocol::EnvironmentData probe;
  probe.air_k = packet.air_temperature_c + physics::kZeroCelsiusK;
  probe.wind_m_s = packet.horizontal_wind_m_s;
  // Directions from -180 to 360 degrees are allowed.
  const double from_deg = packet.wind_from_deg;
  probe.wind_from_deg = from_deg < 0.0 ? from_deg + 360.0 : from_deg;
  if (packet.humidity_percent > 0) probe.relative_humidity_frac = packet.humidity_percent / 100.0;
  if (protocol::check_environment(probe) != protocol::DecodeStatus::ok) return false;
  air_k_ = probe.air_k;
  wind_m_s_ = probe.wind_m_s;
  wind_from_deg_ = *probe.wind_from_deg;
  humidity_frac_ = probe.relative_humidity_frac;
  changed_ = true;
  return true;
}

bool CigiWeather::take(const cigi::WeatherControl& packet) noexcept {
  if (packet.scope != cigi::WeatherScope::global || packet.layer_id < 1 || packet.layer_id > 3) {
    return false;
  }
  cover_frac_[packet.layer_id] = packet.enabled ? packet.coverage_percent / 100.0 : 0.0;
  // Layers overlap at random.
  double clear_frac = 1.0;
  for (const double cover_frac : cover_frac_) clear_frac *= 1.0 - cover_frac;
  cloud_frac_ = 1.0 - clear_frac;
  changed_ = true;
  return true;
}

bool CigiWeather::take(const cigi::ComponentControl& packet) noexcept {
  if (packet.component_class != cigi::ComponentClass::atmosphere ||
      packet.component_id != kRadiationComponent) {
    return false;
  }
  std::array<double, 6> numbers{};
  std::ranges::transform(packet.data, numbers.begin(),
                         [](std::uint32_t word) { return double{std::bit_cast<float>(word)}; });
  protocol::EnvironmentData stated;
  stated.direct_normal_w_m2 = numbers[0];
  stated.diffuse_horizontal_w_m2 = numbers[1];
  stated.longwave_down_w_m2 = numbers[2];
  stated.air_k = numbers[3];
  stated.wind_m_s = numbers[4];
  stated.cloud_frac = numbers[5];
  if (protocol::check_environment(stated) != protocol::DecodeStatus::ok) return false;
  stated_ = stated;
  changed_ = true;
  return true;
}

protocol::EnvironmentData CigiWeather::at(std::int64_t sim_time_ns) const noexcept {
  if (stated_) return *stated_;
  physics::Forcing forcing;
  double rain_mm_h = 0.0;
  if (scenario_ != nullptr && !scenario_->weather.empty()) {
    forcing = physics::forcing_from_rows(scenario_->weather, sim_time_ns);
    rain_mm_h = physics::rain_rate_mm_h(scenario_->weather, sim_time_ns);
    if (air_k_) {
      forcing.air_k = *air_k_;
      forcing.wind_m_s = wind_m_s_;
    }
    if (cloud_frac_) forcing.cloud_frac = *cloud_frac_;
  } else {
    physics::ClearSky model = scenario_ != nullptr ? scenario_->clear_sky : physics::ClearSky{};
    if (air_k_) {
      model.air_mean_k = *air_k_;
      model.air_amplitude_k = 0.0;
      model.wind_m_s = wind_m_s_;
      if (humidity_frac_) {
        model.dew_point_k =
            physics::dew_point_k(*humidity_frac_ * physics::saturation_over_water_pa(*air_k_));
      }
    }
    if (cloud_frac_) model.cloud_frac = *cloud_frac_;
    const scene::Place at = scenario_ != nullptr ? scenario_->place : scene::Place{};
    const physics::GeoPlace place = {physics::Radians(at.lat_rad), physics::Radians(at.lon_rad),
                                     physics::Metres(at.height_m)};
    const std::int64_t utc_ns = (scenario_ != nullptr ? scenario_->epoch_utc_ns : 0) + sim_time_ns;
    forcing =
        physics::forcing_from_clear_sky(model, place, physics::sun_position(utc_ns, place), utc_ns);
  }
  protocol::EnvironmentData out;
  out.direct_normal_w_m2 = forcing.direct_normal_w_m2;
  out.diffuse_horizontal_w_m2 = forcing.diffuse_horizontal_w_m2;
  out.longwave_down_w_m2 = forcing.longwave_down_w_m2;
  out.air_k = forcing.air_k;
  out.wind_m_s = forcing.wind_m_s;
  out.cloud_frac = forcing.cloud_frac;
  if (forcing.environment_stated) out.environment_k = forcing.environment_k;
  if (air_k_) {
    out.wind_from_deg = wind_from_deg_;
  } else if (forcing.wind_to_east != 0.0 || forcing.wind_to_north != 0.0) {
    const double from_deg =
        std::atan2(-forcing.wind_to_east, -forcing.wind_to_north) / physics::kDegree;
    out.wind_from_deg = from_deg < 0.0 ? from_deg + 360.0 : from_deg;
  }
  if (humidity_frac_) {
    out.relative_humidity_frac = humidity_frac_;
  } else if (const double vapour_pa = forcing.stated_vapour_frac > 0.0
                                          ? forcing.stated_vapour_pa / forcing.stated_vapour_frac
                                          : forcing.vapour_pa;
             vapour_pa > 0.0) {
    out.relative_humidity_frac =
        std::min(1.0, vapour_pa / physics::saturation_over_water_pa(out.air_k));
  }
  out.rain_mm_h = rain_mm_h;
  return out;
}

std::optional<protocol::EnvironmentData> CigiWeather::take_change(
    std::int64_t sim_time_ns) noexcept {
  const bool is_due = is_set() && !stated_ && std::llabs(sim_time_ns - sent_ns_) >= kRefreshNs;
  if (!changed_ && !is_due) return std::nullopt;
  changed_ = false;
  sent_ns_ = sim_time_ns;
  return at(sim_time_ns);
}

}  // namespace emit::server
