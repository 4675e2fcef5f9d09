// SPDX-License-Identifier: Apache-2.0
#include "tool/logger/measured_ground.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emit/config/load.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/nearest_name.hpp"
#include "emit/scene/base.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Result<scene::Material> library_material(const GroundOptions& options) {
  std::filesystem::path library = options.library;
  if (library.empty()) {
    auto shipped = config::find_data_file("materials/library.toml");
    if (!shipped) return tl::unexpected(std::move(shipped.error()));
    library = std::move(*shipped);
  }
  auto materials = config::load_materials(library);
  if (!materials) return tl::unexpected(std::move(materials.error()));
  const auto found = std::ranges::find(*materials, options.material, &scene::Material::name);
  if (found == materials->end()) {
    std::vector<std::string> names;
    for (const scene::Material& material : *materials) names.push_back(material.name);
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{} has no material '{}'{}", library.string(), options.material,
                                  physics::did_you_mean(options.material, names)));
  }
  if (!found->prescribed_k && !found->sheet) return std::move(*found);
  return make_error(
      ErrorCode::invalid_argument,
      fmt::format("material '{}' is no ground: it has no layers over a base", options.material));
}

double mean_air_k(const LoggerRecord& record) {
  double sum_k = 0.0;
  for (const reference::LoggerRow& row : record.rows) sum_k += row.air_k;
  return record.rows.empty() ? 0.0 : sum_k / static_cast<double>(record.rows.size());
}

/// Returns the temperature below the last layer, and where it comes from.
std::pair<double, std::string> base_of(const GroundOptions& options, const LoggerRecord& record,
                                       const scene::Material& material) {
  if (options.base_k) return {*options.base_k, "stated by option"};
  if (material.base_stated) return {material.base_k, "stated by the material"};
  const bool is_ground = material.base == scene::BaseKind::ground;
  if (is_ground && !(record.lat_deg && record.epoch_utc_ns)) {
    return {mean_air_k(record), "mean of the air: place or date are not known"};
  }
  scene::ScenarioDesc scenario;
  scenario.clear_sky.air_mean_k = mean_air_k(record);
  if (is_ground) {
    const physics::GeoPlace place = place_of(record);
    scenario.place.lat_rad = place.latitude.value();
    scenario.place.lon_rad = place.longitude.value();
    scenario.place.height_m = place.height.value();
    scenario.epoch_utc_ns = *record.epoch_utc_ns;
  }
  return {scene::base_temperature_k(material, scenario),
          is_ground ? "annual wave of the ground by latitude, height and date" : "mean of the air"};
}

/// Gives dry ground the evaporation that the record measured. A missing value counts as none.
void set_measured_evaporation(LoggerRecord& record, MeasuredGround& ground) {
  std::size_t missing = 0;
  for (std::size_t i = 0; i < record.latent_w_m2.size(); ++i) {
    const bool is_measured = !std::isnan(record.latent_w_m2[i]);
    record.rows[i].evaporation_w_m2 = is_measured ? record.latent_w_m2[i] : 0.0;
    if (!is_measured) ++missing;
  }
  if (record.latent_w_m2.empty() || missing == record.latent_w_m2.size()) return;
  ground.measured_evaporation = true;
  ground.origins.push_back("evaporation: of the record (latent_w_m2)");
  if (missing == 0) return;
  record.notes.push_back(
      fmt::format("latent_w_m2 is missing in {} of {} rows, which count as without evaporation",
                  missing, record.latent_w_m2.size()));
}

/// Gives moist ground its exchange of water, if the record has the humidity of the air. A missing
/// value takes the one before, or the first one.
void set_moisture(LoggerRecord& record, MeasuredGround& ground) {
  const physics::MoistSurface moisture = scene::moisture_of(ground.material);
  if (moisture.dry()) return set_measured_evaporation(record, ground);
  const auto first =
      std::ranges::find_if(record.rh_frac, [](double rh) { return !std::isnan(rh); });
  if (first == record.rh_frac.end()) {
    ground.origins.push_back("evaporation: none, because the record has no humidity (rh_pct)");
    return;
  }
  double rh_frac = *first;
  for (std::size_t i = 0; i < record.rows.size(); ++i) {
    if (!std::isnan(record.rh_frac[i])) rh_frac = std::min(1.0, record.rh_frac[i]);
    record.rows[i].vapour_pa = rh_frac * physics::saturation_over_water_pa(record.rows[i].air_k);
  }
  ground.setup.moisture = moisture;
  ground.origins.push_back(
      fmt::format("evaporation: humidity of the record, wetness {:g} and resistance {:g} s/m of "
                  "material '{}'",
                  moisture.wetness_frac, moisture.resistance_s_m, ground.material.name));
}

}  // namespace

Result<MeasuredGround> measured_ground(const GroundOptions& options, LoggerRecord& record) {
  auto material = library_material(options);
  if (!material) return tl::unexpected(std::move(material.error()));
  MeasuredGround out;
  out.material = std::move(*material);
  out.setup.layers = out.material.layers;
  out.setup.skin = scene::film_skin(out.material);
  out.setup.height_m = record.height_m.value_or(0.0);

  out.numbers.emissivity_frac = options.emissivity_frac.value_or(out.material.emissivity_frac);
  set_emissivity(record, out.numbers.emissivity_frac);
  out.absorptance_measured = !options.absorptance_frac && record.reflected_frac.has_value();
  out.numbers.absorptance_frac = options.absorptance_frac ? *options.absorptance_frac
                                 : record.reflected_frac
                                     ? std::clamp(1.0 - *record.reflected_frac, 0.0, 1.0)
                                     : out.material.solar_absorptance_frac;
  const auto [base_k, base_origin] = base_of(options, record, out.material);
  out.numbers.base_k = base_k;
  out.origins = {
      fmt::format("layers, roughness: library material '{}'", out.material.name),
      fmt::format("absorptance {:.3f}: {}", out.numbers.absorptance_frac,
                  options.absorptance_frac   ? "stated by option"
                  : out.absorptance_measured ? "reflected over incident sun, measured"
                                             : "of the material"),
      fmt::format("emissivity {:.3f}: {}", out.numbers.emissivity_frac,
                  options.emissivity_frac ? "stated by option" : "of the material"),
      fmt::format("base {:.1f} K: {}", out.numbers.base_k, base_origin),
      fmt::format(
          "film: {}",
          std::ranges::any_of(record.rows,
                              [](const reference::LoggerRow& row) { return row.film_w_m2_k > 0.0; })
              ? "of the record"
              : fmt::format(
                    "from wind, gusts of convection and temperatures, air of {:.0f} m above "
                    "the sea",
                    out.setup.height_m))};
  set_moisture(record, out);
  return out;
}

scene::Material with_numbers(scene::Material material, const reference::PlateNumbers& numbers) {
  material.solar_absorptance_frac = numbers.absorptance_frac;
  material.emissivity_frac = numbers.emissivity_frac;
  for (scene::Layer& layer : material.layers) {
    layer.conductivity_w_m_k *= numbers.inertia_factor;
    layer.specific_heat_j_kg_k *= numbers.inertia_factor;
  }
  material.base = scene::BaseKind::room;
  material.base_k = numbers.base_k;
  material.base_stated = true;
  // Modes that were fitted to other layers do not belong to these.
  material.modes.clear();
  material.foster_modes.clear();
  material.foster_fit.reset();
  return material;
}

}  // namespace emit::tool
