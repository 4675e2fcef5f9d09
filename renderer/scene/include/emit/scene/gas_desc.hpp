// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/gas/spectrum.hpp"

/// Hot gas, flares and smoke of a scenario (physics.md section 13). They are part of the picture
/// and take no part in the heat of surfaces. All values SI.
namespace emit::scene {

/// Puffs of gas that a frame may hold.
inline constexpr std::size_t kMaxGasPuffs = 256;

/// Number that belongs to a band.
struct BandValue {
  std::string band;
  double value = 0.0;
};
/// Times that stand for always, ns.
inline constexpr std::int64_t kSinceEverNs = -1'000'000'000'000'000'000;
inline constexpr std::int64_t kForEverNs = 1'000'000'000'000'000'000;

/// Exhaust at one setting of the engine: a nozzle flow whose pressure is that of the air.
struct ExhaustSetting {
  double exit_k = 800.0;
  double exit_m_s = 300.0;  ///< against the nozzle
};
/// Exhaust jet of an object.
struct PlumeDesc {
  static constexpr std::size_t kPuffs = 20;
  std::string name;
  std::string object;
  /// Part of the object whose throttle drives the plume. When empty, the plume is always full.
  std::string part;
  glm::dvec3 nozzle_body_m{0.0};              ///< forward, right, down
  glm::dvec3 direction_body{-1.0, 0.0, 0.0};  ///< of the flow; any length above 0
  double radius_m = 0.3;
  ExhaustSetting full;
  ExhaustSetting idle;
  physics::GasMixture exhaust{0.06, 0.06};
  double soot_per_m = 0.0;  ///< absorption of soot at the nozzle, the same in all bands
};

/// Burning decoy: a small flame that an object carries. It burns from the instant on at which the
/// object appears.
struct FlareDesc {
  static constexpr std::size_t kPuffs = 1;
  std::string name;
  std::string object;
  double kelvin = 2200.0;  ///< of the flame, for bands without an intensity of their own
  double area_m2 = 0.05;   ///< emissivity times area as seen from any side
  std::vector<BandValue> intensity_w_sr;  ///< at the height of the burn
  double radius_m = 0.2;                  ///< of the flame: two standard deviations
  double rise_s = 0.1;
  double burn_s = 4.0;  ///< at the height of the burn
  double fall_s = 1.0;
};

/// Cloud of particles from a source that stands or moves.
struct SmokeDesc {
  static constexpr std::size_t kPuffs = 48;
  std::string name;
  std::string object;          ///< what carries the source; empty: it stands at `position_m`
  glm::dvec3 position_m{0.0};  ///< in the world, or in the body of the object
  std::int64_t start_ns = kSinceEverNs;
  std::int64_t stop_ns = kForEverNs;
  double rate_g_s = 10.0;
  double radius_m = 0.5;  ///< of the cloud at the source: two standard deviations
  double lifetime_s = 60.0;
  double rise_m_s = 0.0;
  std::optional<double> source_k;  ///< at the source; absent: that of the air
  double extinction_m2_g = 0.3;    ///< in bands without properties of their own
  double albedo_frac = 0.0;        ///< share of the extinction that scatters
  std::vector<BandValue> band_extinction_m2_g;
  std::vector<BandValue> band_albedo_frac;
};

/// Fire on the ground: the flame. Its smoke is a SmokeDesc.
struct FireDesc {
  static constexpr std::size_t kPuffs = 12;
  std::string name;
  std::string object;          ///< what burns; empty: the fire stands at `position_m`
  glm::dvec3 position_m{0.0};  ///< middle of its base, in the world or in the body of the object
  double diameter_m = 1.0;
  double heat_release_w = 1e6;
  double kelvin = 1200.0;
  double absorption_per_m = 2.0;  ///< of the sooty flame, the same in all bands
  std::int64_t start_ns = kSinceEverNs;
  std::int64_t stop_ns = kForEverNs;
};

/// All gas of a scenario.
struct GasDesc {
  std::vector<PlumeDesc> plumes;
  std::vector<FlareDesc> flares;
  std::vector<SmokeDesc> smokes;
  std::vector<FireDesc> fires;

  [[nodiscard]] bool empty() const noexcept {
    return plumes.empty() && flares.empty() && smokes.empty() && fires.empty();
  }
  /// Puffs that all of it takes.
  [[nodiscard]] std::size_t puffs() const noexcept {
    return plumes.size() * PlumeDesc::kPuffs + flares.size() * FlareDesc::kPuffs +
           smokes.size() * SmokeDesc::kPuffs + fires.size() * FireDesc::kPuffs;
  }
};

}  // namespace emit::scene
