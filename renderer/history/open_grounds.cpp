// SPDX-License-Identifier: Apache-2.0
#include "history/open_grounds.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/climate/soil_share.hpp"
#include "emit/physics/constants.hpp"
#include "history/foster_history.hpp"

namespace emit::renderer {
namespace {

using physics::FosterDrive;
using physics::FosterState;

/// Returns true if rain on open ground of both materials dries alike. Sheets of any heat capacity
/// have the same resistance, so that every mode counts.
bool dry_alike(const FosterMaterial& a, const FosterMaterial& b) noexcept {
  const auto same_mode = [](const physics::NetworkMode& x, const physics::NetworkMode& y) {
    return x.tau_s == y.tau_s && x.resistance_m2k_w == y.resistance_m2k_w;
  };
  return a.store == b.store && a.moisture == b.moisture && a.skin == b.skin &&
         a.solar_absorptance_frac == b.solar_absorptance_frac &&
         a.emissivity_frac == b.emissivity_frac && a.base_k == b.base_k &&
         a.initial_k == b.initial_k && a.body == b.body && a.network.count == b.network.count &&
         std::ranges::equal(a.network.modes, b.network.modes, same_mode);
}

/// Returns how little two stores have in common: the capacity by ratio, after the kind.
double unlikeness(const physics::WaterStore& a, const physics::WaterStore& b) noexcept {
  return (a.kind != b.kind ? 100.0 : 0.0) + std::abs(std::log(a.capacity_mm / b.capacity_mm));
}

}  // namespace

void number_water(std::span<FosterMaterial> materials) {
  std::vector<std::size_t> owners;
  // Gives a material a slot if there is one for it.
  const auto place = [&](std::size_t m) {
    FosterMaterial& material = materials[m];
    const auto same = std::ranges::find_if(
        owners, [&](std::size_t owner) { return dry_alike(materials[owner], material); });
    material.water_shared = same == owners.end() && owners.size() == physics::kWaterSlots;
    if (material.water_shared) return;
    material.water_slot = static_cast<int>(same - owners.begin());
    if (same == owners.end()) owners.push_back(m);
  };
  std::vector<std::size_t> means(materials.size());
  for (std::size_t m = 0; m < means.size(); ++m) means[m] = m;
  for (std::size_t m = 0; m < materials.size(); ++m) {
    const std::size_t twin = materials[m].first_twin;
    if (twin != 0) means[twin] = means[twin + 1] = m;
  }
  // Twins get what the materials leave.
  for (const bool twins : {false, true}) {
    for (std::size_t m = 0; m < materials.size(); ++m) {
      if (!materials[m].store.none() && (means[m] != m) == twins) place(m);
    }
  }
  for (const bool twins : {false, true}) {
    for (std::size_t m = 0; m < materials.size(); ++m) {
      FosterMaterial& material = materials[m];
      if (!material.water_shared || (means[m] != m) != twins) continue;
      if (twins) {
        material.water_slot = materials[means[m]].water_slot;
        continue;
      }
      const auto most_alike = std::ranges::min_element(owners, {}, [&](std::size_t owner) {
        return unlikeness(materials[owner].store, material.store);
      });
      material.water_slot = static_cast<int>(most_alike - owners.begin());
    }
  }
}

OpenGrounds::OpenGrounds(std::span<const FosterMaterial> materials, double reference_k,
                         double tolerance_k)
    : reference_k_(reference_k), tolerance_k_(tolerance_k) {
  const auto ground_of = [&](const FosterMaterial& material) {
    return Ground{material, foster_surface_of(material, reference_k)};
  };
  // Take a material of its own in each slot for its ground.
  std::array<const FosterMaterial*, physics::kWaterSlots> owners{};
  std::vector<bool> is_twin(materials.size(), false);
  for (std::size_t m = 0; m < materials.size(); ++m) {
    const FosterMaterial& material = materials[m];
    if (material.first_twin != 0)
      is_twin[material.first_twin] = is_twin[material.first_twin + 1] = true;
    if (material.water_slot < 0 || material.water_shared) continue;
    const FosterMaterial*& owner = owners[static_cast<std::size_t>(material.water_slot)];
    if (owner == nullptr) owner = &material;
  }
  for (const FosterMaterial* const owner : owners) {
    if (owner == nullptr) break;
    water_.push_back(ground_of(*owner));
    moist_ = moist_ || !owner->moisture.dry();
    always_ = always_ || owner->store.initial_mm > 0.0;
  }
  // Watch what is moist or frozen without a store.
  for (std::size_t m = 0; m < materials.size(); ++m) {
    const FosterMaterial& material = materials[m];
    const bool moist = !material.moisture.dry();
    if (material.water_slot >= 0 || is_twin[m] || !(moist || material.snow_or_ice)) continue;
    moist_ = moist_ || moist;
    always_ = always_ || material.snow_or_ice;
    if (std::ranges::any_of(watched_, [&](const Ground& ground) {
          return ground.material.snow_or_ice == material.snow_or_ice &&
                 dry_alike(ground.material, material);
        })) {
      continue;
    }
    if (watched_.size() < kWatchedGrounds) {
      watched_.push_back(ground_of(material));
    } else {
      (moist ? more_moist_ : more_snow_) = true;
    }
  }
}

void OpenGrounds::start(GroundState& state) const noexcept {
  for (std::size_t s = 0; s < water_.size(); ++s) {
    const FosterMaterial& material = water_[s].material;
    state.water[s] = {foster_initial_states(material), material.store.initial_mm};
    state.half_water[s] = state.sheltered[s] = state.water[s];
  }
  for (std::size_t g = 0; g < watched_.size(); ++g) {
    state.watched[g] = foster_initial_states(watched_[g].material);
  }
}

bool OpenGrounds::needed(const Environment& environment,
                         std::span<const HistoryInterval> intervals) const noexcept {
  if (always_ || (environment.rains() && !water_.empty())) return true;
  // Open ground is at most some 10 K colder than the air.
  constexpr double kColderK = 10.0;
  return moist_ && std::ranges::any_of(intervals, [](const HistoryInterval& interval) {
           return std::min(interval.forcing_begin.air_k, interval.forcing_end.air_k) <
                  physics::kZeroCelsiusK + kColderK;
         });
}

void OpenGrounds::note_weather(const HistoryInterval& interval, GroundState& state) const noexcept {
  const physics::Forcing& a = interval.forcing_begin;
  const physics::Forcing& b = interval.forcing_end;
  // Drops do not count.
  constexpr double kLeastMm = 0.005;
  if (interval.rain_mm > kLeastMm && std::min(a.air_k, b.air_k) < kSnowAirK) {
    state.limits.pass(HeatLimit::snowfall, interval.begin_ns);
  }
  constexpr double kAll = 0.999;  // rounding
  const bool wet = moist_ || std::ranges::any_of(state.water, [](const WaterGround& ground) {
                     return ground.water_mm > 0.0;
                   });
  if (wet && std::min(a.stated_vapour_frac, b.stated_vapour_frac) < kAll) {
    state.limits.pass(HeatLimit::humidity_unknown, interval.begin_ns);
  }
  if (std::max(a.wind_m_s, b.wind_m_s) > kMostFilmWindMS &&
      std::min(a.stated_film_frac, b.stated_film_frac) < kAll) {
    state.limits.pass(HeatLimit::strong_wind, interval.begin_ns);
  }
  const auto dark = [](const physics::Forcing& now) {
    const double air2 = now.air_k * now.air_k;
    return now.longwave_down_w_m2 < kLeastSkyFrac * physics::kStefanBoltzmannWPerM2K4 * air2 * air2;
  };
  if (dark(a) || dark(b)) state.limits.pass(HeatLimit::longwave_low, interval.begin_ns);
  if (more_moist_ && std::min(a.air_k, b.air_k) < physics::kZeroCelsiusK) {
    state.limits.pass(HeatLimit::freezing, interval.begin_ns);
  }
  if (more_snow_ && std::max(a.air_k, b.air_k) > physics::kZeroCelsiusK) {
    state.limits.pass(HeatLimit::melting, interval.begin_ns);
  }
}

void OpenGrounds::note_temperature(const Ground& ground, const FosterState<double>& modes_k,
                                   bool wet, std::int64_t at_ns,
                                   HeatLimitTimes& limits) const noexcept {
  const double t_k = reference_k_ + physics::foster_offset_k(modes_k, ground.surface);
  if (wet && t_k < physics::kZeroCelsiusK) limits.pass(HeatLimit::freezing, at_ns);
  if (ground.material.snow_or_ice && t_k > physics::kZeroCelsiusK) {
    limits.pass(HeatLimit::melting, at_ns);
  }
}

void OpenGrounds::carry(const HistoryInterval& interval, IntervalForcing& out,
                        GroundState& state) const noexcept {
  const double rain_mm = std::max(0.0, interval.rain_mm);
  for (std::size_t s = 0; s < water_.size(); ++s) {
    WaterGround& open = state.water[s];
    const WaterGround before = open;
    const Wetness wetness = carry_water(s, out, interval.begin_ns, rain_mm, open, state.limits);
    out.begin.wet_frac[s] = wetness.begin_frac;
    out.end.wet_frac[s] = wetness.end_frac;
    // Follow ground that gets less of the rain while it differs.
    const auto carry_less = [&](WaterGround& less, double rain_frac) {
      const bool alike = less == before || (less.water_mm == 0.0 && open.water_mm == 0.0);
      if (rain_mm > 0.0 || !alike) {
        return carry_water(s, out, interval.begin_ns, rain_frac * rain_mm, less, state.limits);
      }
      less = open;
      return wetness;
    };
    const Wetness half = carry_less(state.half_water[s], 0.5);
    out.begin.half_wet_frac[s] = half.begin_frac;
    out.end.half_wet_frac[s] = half.end_frac;
    // Only soil that starts wet has water without rain.
    if (!(water_[s].material.store.initial_mm > 0.0)) continue;
    const Wetness none = carry_less(state.sheltered[s], 0.0);
    out.begin.sheltered_wet_frac[s] = none.begin_frac;
    out.end.sheltered_wet_frac[s] = none.end_frac;
  }
  const glm::dvec3 up(0.0, 0.0, 1.0);
  for (std::size_t g = 0; g < watched_.size(); ++g) {
    const Ground& ground = watched_[g];
    FosterState<double>& modes_k = state.watched[g];
    const double offset_k = physics::foster_offset_k(modes_k, ground.surface);
    const auto drive = [&](const SurfaceForcing& f) {
      return unshadowed_drive(f, ground.material, up, reference_k_, offset_k);
    };
    physics::foster_advance(modes_k, drive(out.begin), drive(out.end),
                            physics::foster_ladder(out.dt_s, ground.material.network),
                            ground.surface, tolerance_k_);
    note_temperature(ground, modes_k, !ground.material.moisture.dry(), interval.begin_ns,
                     state.limits);
  }
}

OpenGrounds::Wetness OpenGrounds::carry_water(std::size_t slot, const IntervalForcing& interval,
                                              std::int64_t begin_ns, double rain_mm,
                                              WaterGround& now,
                                              HeatLimitTimes& limits) const noexcept {
  // Parts last 300 s or less, but for the oldest, longest intervals, which have eight.
  constexpr double kPartS = 300.0;
  constexpr std::size_t kFinestLevel = 3;
  const glm::dvec3 up(0.0, 0.0, 1.0);
  const double j_kg = physics::vaporisation_j_kg(interval.begin.air_k);
  const FosterMaterial& ground = water_[slot].material;
  const physics::FosterSurface<double>& surface = water_[slot].surface;
  const bool wet = rain_mm > 0.0 || now.water_mm > 0.0;
  // Set up the drive of ground that is as the material states it, and of ground wet all over.
  const double offset_k = physics::foster_offset_k(now.modes_k, surface);
  const auto drive = [&](SurfaceForcing f, double wet_frac) {
    f.wet_frac[slot] = wet_frac;
    return unshadowed_drive(f, ground, up, reference_k_, offset_k);
  };
  const auto ladder = physics::foster_ladder(interval.dt_s, ground.network);
  const FosterDrive<double> dry[] = {drive(interval.begin, 0.0), drive(interval.end, 0.0)};
  if (!wet) {
    physics::foster_advance(now.modes_k, dry[0], dry[1], ladder, surface, tolerance_k_);
    note_temperature(water_[slot], now.modes_k, !ground.moisture.dry(), begin_ns, limits);
    return {};
  }
  const FosterDrive<double> open[] = {drive(interval.begin, 1.0), drive(interval.end, 1.0)};
  const auto drive_at = [&](double f, double wet_frac) {
    FosterDrive<double> out_drive = physics::lerp(dry[0], dry[1], f);
    if (!(wet_frac > 0.0)) return out_drive;
    const FosterDrive<double> wet_drive = physics::lerp(open[0], open[1], f);
    out_drive.evaporation_w_m2_pa =
        std::lerp(out_drive.evaporation_w_m2_pa, wet_drive.evaporation_w_m2_pa, wet_frac);
    out_drive.dew_w_m2_pa = wet_drive.dew_w_m2_pa;
    out_drive.vapour_pa = wet_drive.vapour_pa;
    return out_drive;
  };
  const auto open_mm_s = [&](double f) {
    const double t_k = reference_k_ + physics::foster_offset_k(now.modes_k, surface);
    return physics::latent_flux(t_k, physics::lerp(open[0], open[1], f)).flux_w_m2 / j_kg;
  };
  const auto factor_of = [&](double water_mm) {
    return physics::warm_soil_factor(ground.store, physics::wet_frac(ground.store, water_mm),
                                     interval.begin.air_k, interval.begin.moist);
  };
  const auto share_of = [&](double water_mm) {
    return physics::wet_frac(ground.store, water_mm) * factor_of(water_mm);
  };
  // Dew forms on all that is wet.
  const auto scaled = [](double mm_s, double factor) { return mm_s > 0.0 ? mm_s * factor : mm_s; };
  // Let heat and water take turns over short parts of the interval.
  std::size_t level = 0;
  while (level < kFinestLevel && interval.dt_s > kPartS * static_cast<double>(1U << level)) {
    ++level;
  }
  const double parts = static_cast<double>(1U << level);
  const double begin_frac = share_of(now.water_mm);
  double evaporated_mm = 0.0;
  double open_mm = 0.0;
  for (double part = 0.0; part < parts; ++part) {
    const double from = part / parts;
    const double to = (part + 1.0) / parts;
    const double dt_s = interval.dt_s / parts;
    const double begin_mm_s = open_mm_s(from);
    const double begin_factor = factor_of(now.water_mm);
    const double expected_mm = physics::advance_water(ground.store, now.water_mm, rain_mm / parts,
                                                      scaled(begin_mm_s, begin_factor), dt_s)
                                   .water_mm;
    physics::foster_step(now.modes_k, drive_at(from, share_of(now.water_mm)),
                         drive_at(to, share_of(expected_mm)), ladder.level[level], surface);
    const double mean_mm_s = 0.5 * (begin_mm_s + open_mm_s(to));
    const double mean_factor = 0.5 * (begin_factor + factor_of(expected_mm));
    const physics::StoredWater after = physics::advance_water(
        ground.store, now.water_mm, rain_mm / parts, scaled(mean_mm_s, mean_factor), dt_s);
    now.water_mm = after.water_mm;
    if (mean_mm_s > 0.0) {
      evaporated_mm += after.evaporated_mm;
      open_mm += mean_mm_s * dt_s;
    }
  }
  note_temperature(water_[slot], now.modes_k, true, begin_ns, limits);
  // Give the interval a line whose mean evaporates what has evaporated.
  const double end_frac = share_of(now.water_mm);
  const double mean_frac =
      open_mm > 0.0 ? std::min(1.0, evaporated_mm / open_mm) : 0.5 * (begin_frac + end_frac);
  const double most = std::min(mean_frac, 1.0 - mean_frac);
  const double half = std::clamp(0.5 * (end_frac - begin_frac), -most, most);
  return {mean_frac - half, mean_frac + half};
}

}  // namespace emit::renderer
