// SPDX-License-Identifier: Apache-2.0
#include "material_lookup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/nearest_name.hpp"
#include "emit/scene/base.hpp"
#include "emit/scene/gloss_optics.hpp"

namespace emit::scene {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Material builtin_default_material() {
  Material material;
  material.name = "default";
  material.solar_absorptance_frac = 0.6;
  material.emissivity_frac = 0.9;
  material.layers = {{0.10, 1.28, 2200.0, 920.0}};
  material.base = BaseKind::air;
  material.modes = {{141.0, 0.324}, {2634.0, 0.676}};
  material.source = "built in: 10 cm of concrete";
  material.uncertainty = "stands in for an unknown material";
  return material;
}

bool MaterialLookup::find(std::string_view name, std::size_t& position) const noexcept {
  const auto found = std::find_if(library_.begin(), library_.end(),
                                  [&](const Material& m) { return m.name == name; });
  position = static_cast<std::size_t>(found - library_.begin());
  return found != library_.end();
}

std::string MaterialLookup::hint_at_material(std::string_view name) const {
  std::vector<std::string_view> names;
  for (const Material& material : library_) names.push_back(material.name);
  return physics::did_you_mean(name, names);
}

Result<MaterialLookup> MaterialLookup::create(const ScenarioDesc& scenario) {
  MaterialLookup lookup;
  lookup.scenario_ = &scenario;
  lookup.library_ = scenario.materials;
  if (scenario.default_material.empty()) {
    lookup.default_position_ = lookup.library_.size();
    lookup.library_.push_back(builtin_default_material());
    lookup.library_.back().base_k = base_temperature_k(lookup.library_.back(), scenario);
  } else if (!lookup.find(scenario.default_material, lookup.default_position_)) {
    return make_error(ErrorCode::config,
                      fmt::format("{}: default_material '{}' is not in the material library{}",
                                  scenario.file.string(), scenario.default_material,
                                  lookup.hint_at_material(scenario.default_material)));
  }
  lookup.used_.assign(lookup.library_.size(), false);
  return lookup;
}

void MaterialLookup::warn_of_unknown_keys(const ObjectDesc& object, const GltfModel& model) {
  std::vector<std::string_view> names;
  for (const GltfMaterial& material : model.materials) {
    if (material.library.empty()) names.push_back(material.name);
  }
  const std::size_t count = names.size();
  for (const auto& [key, material] : object.material_map) {
    // The empty key stands for primitives without material.
    if (key.empty() || std::ranges::count(names, key) > 0) continue;
    std::string hint = physics::did_you_mean(key, names);
    if (hint.empty() && names.empty()) {
      hint = ": the file has no materials";
    } else if (hint.empty()) {
      constexpr std::size_t kMaxNames = 8;
      names.resize(std::min(names.size(), kMaxNames));
      hint = fmt::format(": it has '{}'{}", fmt::join(names, "', '"),
                         count > kMaxNames ? " and more" : "");
    }
    warnings_.push_back(fmt::format("{}: object '{}': material_map: {} has no material '{}'{}",
                                    scenario_->file.string(), object.name,
                                    model.file.filename().string(), key, hint));
  }
}

Result<std::vector<std::size_t>> MaterialLookup::resolve(std::uint32_t object_index,
                                                         const GltfModel& model) {
  EMIT_CHECK_OP(object_index, <, scenario_->objects.size());
  const ObjectDesc& object = scenario_->objects[object_index];
  std::vector<bool> in_use(model.materials.size() + 1, false);
  for (const Mesh& mesh : model.meshes) {
    for (const Submesh& submesh : mesh.submeshes) {
      in_use[std::min<std::size_t>(submesh.material, model.materials.size())] = true;
    }
  }
  warn_of_unknown_keys(object, model);
  std::vector<std::size_t> positions(in_use.size(), default_position_);
  for (std::size_t i = 0; i < in_use.size(); ++i) {
    const std::string name = i < model.materials.size() ? model.materials[i].name : "";
    MappedBy by = MappedBy::fallback;
    std::string wanted;
    if (i < model.materials.size() && !model.materials[i].library.empty()) {
      by = MappedBy::material_image;
      wanted = model.materials[i].library;
    } else if (const auto mapped = object.material_map.find(name);
               mapped != object.material_map.end()) {
      by = MappedBy::material_map;
      wanted = mapped->second;
    } else if (!object.material.empty()) {
      by = MappedBy::object_material;
      wanted = object.material;
    } else if (std::size_t same = 0; !name.empty() && find(name, same)) {
      by = MappedBy::name;
      wanted = name;
    }
    if (by != MappedBy::fallback && !find(wanted, positions[i])) {
      return make_error(
          ErrorCode::config,
          fmt::format("{}: object '{}': material '{}' is not in the material "
                      "library{}",
                      scenario_->file.string(), object.name, wanted, hint_at_material(wanted)));
    }
    if (!in_use[i]) {
      continue;
    }
    used_[positions[i]] = true;
    if (by == MappedBy::fallback) {
      warnings_.push_back(fmt::format("{}: {} maps to nothing in the library, '{}' is used",
                                      model.file.filename().string(),
                                      name.empty() ? std::string("geometry without material")
                                                   : fmt::format("material '{}'", name),
                                      library_[positions[i]].name));
    }
    mappings_.push_back({object_index, name, library_[positions[i]].name, 0, by});
    mapping_positions_.push_back(positions[i]);
  }
  return positions;
}

void MaterialLookup::warn_of_moisture() {
  std::vector<std::string_view> moist;
  std::vector<std::string_view> wet;  // without a resistance: soil or water
  const bool rains = std::ranges::any_of(
      scenario_->weather, [](const physics::WeatherSample& row) { return row.rain_mm_h > 0.0; });
  for (std::size_t i = 0; i < library_.size(); ++i) {
    const physics::MoistSurface moisture = moisture_of(library_[i]);
    const physics::WaterStore store = water_store_of(library_[i]);
    const bool gets_wet = !store.none() && (rains || store.initial_mm > 0.0);
    const bool around = library_[i].name == scenario_->thermal.surroundings_material;
    if ((moisture.dry() && !gets_wet) || !(used_[i] || around)) continue;
    moist.push_back(library_[i].name);
    if (!moisture.dry() && moisture.resistance_s_m == 0.0 && library_[i].dry_layers_valid) {
      wet.push_back(library_[i].name);
    }
  }
  if (moist.empty()) return;
  const auto warn = [&](std::string_view text) {
    warnings_.push_back(fmt::format("{}: '{}' evaporate{}, {}", scenario_->file.string(),
                                    fmt::join(moist, "', '"), moist.size() == 1 ? "s" : "", text));
  };
  if (scenario_->thermal.model == ThermalModel::emit2014) {
    warn(
        "which emit2014 leaves out: temperatures are those of dry layers, too warm by 5 to 30 K "
        "by day");
    return;
  }
  if (!wet.empty()) {
    warnings_.push_back(
        fmt::format("{}: '{}' stay{} as wet as stated over the whole run: drying "
                    "needs 'readily_evaporable_mm'",
                    scenario_->file.string(), fmt::join(wet, "', '"), wet.size() == 1 ? "s" : ""));
  }
  // The history is what matters, from its start to a day of frames.
  const std::vector<physics::WeatherSample>& rows = scenario_->weather;
  if (!rows.empty() && std::ranges::any_of(rows, [](const physics::WeatherSample& row) {
        return !row.relative_humidity_frac;
      })) {
    warn(
        fmt::format("but weather does not state the humidity (relative_humidity_frac) in every "
                    "row: a dew point of {:.1f} K counts there, that of 60 % at the mean air",
                    usual_dew_point_k(*scenario_)));
  }
  double coldest_k = scenario_->clear_sky.air_mean_k - scenario_->clear_sky.air_amplitude_k;
  if (!rows.empty()) {
    const std::int64_t from_ns = scenario_->thermal.history_start_ns;
    coldest_k = std::numeric_limits<double>::infinity();
    for (const physics::WeatherSample& row : rows) {
      constexpr std::int64_t kDayNs = 86'400'000'000'000;
      if (row.sim_time_ns < from_ns || row.sim_time_ns > kDayNs) continue;
      coldest_k = std::min(coldest_k, row.air_k);
    }
  }
  if (coldest_k < physics::kZeroCelsiusK) {
    warn(
        fmt::format("and the air goes down to {:.1f} K: below 273.15 K ice takes the place of "
                    "water, but neither freezing nor melting nor the rest of plants in winter is "
                    "modelled",
                    coldest_k));
  }
}

std::vector<std::uint32_t> MaterialLookup::finish(SceneGeometry& geometry) {
  std::vector<std::uint32_t> index_of(library_.size(), 0);
  geometry.materials.push_back(library_[default_position_]);
  for (std::size_t i = 0; i < library_.size(); ++i) {
    if (used_[i] && i != default_position_) {
      index_of[i] = static_cast<std::uint32_t>(geometry.materials.size());
      geometry.materials.push_back(library_[i]);
    }
  }
  for (std::size_t i = 0; i < library_.size(); ++i) {
    if (library_[i].clutter && !used_[i]) {
      warnings_.push_back(fmt::format(
          "{}: [[clutter]] of '{}' has no effect: nothing in the scene is of that material",
          scenario_->file.string(), library_[i].name));
    }
    if (used_[i] && library_[i].gloss && library_[i].gloss->sea) {
      const double wind_m_s = sea_wind_m_s(*library_[i].gloss, *scenario_);
      if (wind_m_s > kMeasuredSeaWindMS) {
        warnings_.push_back(fmt::format(
            "{}: the sea of '{}' is in a wind of {:.1f} m/s; its slopes were measured up to {:g} "
            "m/s, grow here up to {:g} m/s, and foam is left out",
            scenario_->file.string(), library_[i].name, wind_m_s, kMeasuredSeaWindMS,
            kMostSeaWindMS));
      }
    }
    if (used_[i] && !library_[i].dry_layers_valid && !library_[i].prescribed_k) {
      warnings_.push_back(fmt::format(
          "material '{}' is more than dry layers (dry_layers_valid = false): its "
          "temperatures are a guide only{}",
          library_[i].name, library_[i].uncertainty.empty() ? "" : "; " + library_[i].uncertainty));
    }
  }
  warn_of_moisture();
  for (std::size_t i = 0; i < mappings_.size(); ++i) {
    mappings_[i].index = index_of[mapping_positions_[i]];
  }
  geometry.mappings = std::move(mappings_);
  // Several objects of one file give the same warnings.
  std::sort(warnings_.begin(), warnings_.end());
  warnings_.erase(std::unique(warnings_.begin(), warnings_.end()), warnings_.end());
  geometry.warnings.insert(geometry.warnings.end(), warnings_.begin(), warnings_.end());
  return index_of;
}

}  // namespace emit::scene
