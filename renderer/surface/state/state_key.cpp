// SPDX-License-Identifier: Apache-2.0
// Hashes of the parts of the input on which a saved state depends.
#include <algorithm>

#include "surface/state/state_bytes.hpp"
#include "surface/state/state_file.hpp"

namespace emit::renderer {
namespace {

/// Adds plain values to a hash, in their order.
template <class... Values>
void add(Fnv64& hash, const Values&... values) {
  (put_value(hash, values), ...);
}

/// Adds a value that may be absent; absent and 0 give different hashes.
void add_optional(Fnv64& hash, const std::optional<double>& value) {
  add(hash, value.has_value(), value.value_or(0.0));
}

/// Adds a row of weather.
void add_weather(Fnv64& hash, const physics::WeatherSample& row) {
  add(hash, row.sim_time_ns, row.direct_normal_w_m2, row.diffuse_horizontal_w_m2,
      row.longwave_down_w_m2, row.air_k, row.wind_m_s, row.cloud_frac);
  add_optional(hash, row.environment_k);
  add_optional(hash, row.film_w_m2_k);
  add_optional(hash, row.wind_from_rad);
  add_optional(hash, row.relative_humidity_frac);
  add(hash, row.rain_mm_h);
}

void add_pose(Fnv64& hash, const physics::Pose& pose) {
  add(hash, pose.position_world_m, pose.world_from_body);
}

/// Adds a trajectory, preceded by its length.
void add_keys(Fnv64& hash, std::span<const scene::Keyframe> keys) {
  add(hash, keys.size());
  for (const scene::Keyframe& key : keys) {
    add(hash, key.sim_time_ns, key.on, key.teleport);
    add_pose(hash, key.pose);
  }
}

/// Hash of meshes, instances and trajectories.
std::uint64_t scene_hash(const scene::ScenarioDesc& scenario,
                         const scene::SceneGeometry& geometry) {
  Fnv64 hash;
  for (const scene::Mesh& mesh : geometry.meshes) {
    add(hash, mesh.positions_m, mesh.normals, mesh.indices, mesh.submeshes.size(), mesh.closed);
    for (const scene::Submesh& submesh : mesh.submeshes) {
      add(hash, submesh.first_index, submesh.index_count, submesh.material, submesh.double_sided);
    }
  }
  for (const scene::Instance& instance : geometry.instances) {
    add(hash, instance.mesh, instance.object, instance.body_from_mesh, instance.world_from_mesh);
  }
  for (const scene::ObjectDesc& object : scenario.objects) {
    add(hash, object.entity_id, object.on, object.interior.heat_j_m2_k,
        object.interior.ventilation_w_m2_k, object.air_film.shape, object.air_film.length_m);
    add_keys(hash, object.trajectory);
    for (const scene::PartDesc& part : object.parts) {
      add(hash, part.id, part.material, part.curve.given, part.curve.idle_k, part.curve.full_k,
          part.curve.cold_k, part.curve.up_s, part.curve.down_s);
      for (const scene::TimedPartCommand& key : part.commands) {
        add(hash, key.sim_time_ns, key.command.kind, key.command.value);
      }
    }
  }
  return hash.value();
}

/// Adds the thermal properties of a material. Its name and its looks in the bands do not matter to
/// the temperature.
void add_material(Fnv64& hash, const scene::Material& material) {
  add(hash, material.solar_absorptance_frac, material.emissivity_frac, material.base_k,
      material.layers.size(), material.foster_modes.size(), material.modes.size(), material.sheet,
      material.rests_on_body(), material.roughness);
  add_optional(hash, material.leaf_width_m);
  add_optional(hash, material.leaf_area_index);
  for (const scene::Layer& layer : material.layers) {
    add(hash, layer.thickness_m, layer.conductivity_w_m_k, layer.density_kg_m3,
        layer.specific_heat_j_kg_k);
  }
  for (const scene::FosterMode& mode : material.foster_modes) {
    add(hash, mode.tau_s, mode.resistance_m2k_w);
  }
  for (const scene::RelaxationMode& mode : material.modes) {
    add(hash, mode.tau_s, mode.weight_frac);
  }
  add_optional(hash, material.core_conductance_w_m2_k);
  add_optional(hash, material.initial_k);
  add_optional(hash, material.prescribed_k);
  const physics::MoistSurface moisture = scene::moisture_of(material);
  add(hash, moisture.wetness_frac, moisture.resistance_s_m, moisture.night_resistance_s_m);
  // The twins do not depend on the looks of the field.
  add(hash, scene::varies_in_heat(material));
  if (scene::varies_in_heat(material)) {
    add(hash, material.clutter->solar_absorptance_sd_frac, material.clutter->emissivity_sd_frac,
        material.clutter->inertia_sd_ln);
  }
  const physics::WaterStore store = scene::water_store_of(material);
  add(hash, store.kind, store.capacity_mm, store.ready_mm, store.initial_mm);
}

std::uint64_t materials_hash(const scene::ScenarioDesc& scenario,
                             const scene::SceneGeometry& geometry) {
  Fnv64 hash;
  for (const scene::Material& material : geometry.materials) add_material(hash, material);
  // Add the material of the surroundings, which need not occur in the scene.
  const std::string& surroundings = scenario.thermal.surroundings_material.empty()
                                        ? scenario.default_material
                                        : scenario.thermal.surroundings_material;
  const auto found = std::ranges::find(scenario.materials, surroundings, &scene::Material::name);
  if (found != scenario.materials.end()) add_material(hash, *found);
  return hash.value();
}

/// Hash of place and date.
std::uint64_t place_hash(const scene::ScenarioDesc& scenario) {
  Fnv64 hash;
  add(hash, scenario.place.lat_rad, scenario.place.lon_rad, scenario.place.height_m,
      scenario.epoch_utc_ns);
  return hash.value();
}

/// Hash of the weather table and of the clear-sky model, which counts where there is no table.
std::uint64_t weather_hash(const scene::ScenarioDesc& scenario) {
  Fnv64 hash;
  for (const physics::WeatherSample& sample : scenario.weather) add_weather(hash, sample);
  const scene::ClearSky& sky = scenario.clear_sky;
  add(hash, sky.linke_turbidity, sky.air_mean_k, sky.air_amplitude_k, sky.dew_point_k, sky.wind_m_s,
      sky.cloud_frac);
  add_optional(hash, sky.wind_from_rad);
  add_optional(hash, sky.cloud_base.height_m);
  add_optional(hash, sky.cloud_base.kelvin);
  if (sky.fog) {
    add(hash, sky.fog->sun_depth, sky.fog->sun_asymmetry, sky.fog->longwave_through_frac);
  }
  add(hash, sky.cloud_transmission_frac, scenario.clouds.has_value());
  if (scenario.clouds) {
    const physics::Clouds& clouds = *scenario.clouds;
    add(hash, clouds.cover_frac, clouds.base_m, clouds.transmission_frac, clouds.shortest_m,
        clouds.longest_m, clouds.slope, clouds.seed, clouds.drift_m_s, clouds.drift_from_rad);
  }
  return hash.value();
}

/// Hash of the thermal options that the method `cached` reads, and of joints between bodies.
std::uint64_t thermal_hash(const scene::ScenarioDesc& scenario) {
  const scene::ThermalOptions& o = scenario.thermal;
  Fnv64 hash;
  add(hash, o.model, o.tolerance_k, o.initial_k, o.initial_stated, o.history_start_ns, o.spin_up_ns,
      o.foster_modes, o.steps, o.spacing, o.first_step_s, o.max_samples, o.lateral, o.exchange,
      o.film_factor);
  for (const scene::ContactDesc& contact : scenario.contacts) {
    add(hash, contact.between, contact.resistance_m2k_w);
  }
  return hash.value();
}

/// Hash of the sensor's format, field of view and trajectory.
std::uint64_t camera_hash(const scene::SensorDesc& sensor) {
  Fnv64 hash;
  add(hash, sensor.width_px, sensor.height_px, sensor.fov_h_rad, sensor.narrowest_fov_rad());
  add_keys(hash, sensor.trajectory);
  return hash.value();
}

std::uint64_t& at(StateKey& key, StatePart part) {
  return key[static_cast<std::size_t>(part)];
}

}  // namespace

std::string_view describe(StatePart part) noexcept {
  switch (part) {
    case StatePart::scene:
      return "scene geometry";
    case StatePart::materials:
      return "materials";
    case StatePart::place:
      return "place or date";
    case StatePart::weather:
      return "weather";
    case StatePart::thermal:
      return "thermal options";
    case StatePart::camera:
      return "sensor format, field of view or trajectory";
    case StatePart::live:
      return "input of the host before the state was saved";
  }
  return "?";
}

StateKey scenario_key(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry) {
  StateKey key{};
  at(key, StatePart::scene) = scene_hash(scenario, geometry);
  at(key, StatePart::materials) = materials_hash(scenario, geometry);
  at(key, StatePart::place) = place_hash(scenario);
  at(key, StatePart::weather) = weather_hash(scenario);
  at(key, StatePart::thermal) = thermal_hash(scenario);
  at(key, StatePart::camera) = camera_hash(scenario.sensor);
  return key;
}

std::uint64_t live_hash(std::int64_t at_ns, const Environment& environment,
                        std::span<const PoseHistory> entities, std::span<const PartHistory> parts) {
  Fnv64 hash;
  for (const PoseHistory& entity : entities) {
    // Add the poses that the host has sent for instants up to `at_ns`.
    const std::span<const scene::Keyframe> live = entity.live();
    const auto end = std::ranges::upper_bound(live, at_ns, {}, &scene::Keyframe::sim_time_ns);
    add_keys(hash, live.first(static_cast<std::size_t>(end - live.begin())));
  }
  // Add the weather that it has sent, likewise.
  for (const physics::WeatherSample& row : environment.live()) {
    if (row.sim_time_ns <= at_ns) add_weather(hash, row);
  }
  // Add its commands to parts.
  for (const PartHistory& part : parts) {
    for (const PartHistory::Step& step : part.live()) {
      if (step.from_ns > at_ns) break;
      add(hash, part.id(), part.entity(), step.from_ns, step.command.kind, step.command.value);
    }
  }
  return hash.value();
}

}  // namespace emit::renderer
