// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "emit/physics/climate/climate.hpp"
#include "emit/physics/constants.hpp"
#include "emit/scene/base.hpp"
#include "overrides.hpp"
#include "resolve/complete_weather.hpp"
#include "resolve/resolve.hpp"
#include "tables/weather_year.hpp"

namespace emit::config {

using physics::Result;
using scene::ScenarioDesc;

const Node& section(const Node& root, std::string_view name, Diagnostics& diagnostics) {
  static const Node kEmpty;
  const Node* node = root.find(name);
  if (node == nullptr || !expect_table(*node, std::string(name), diagnostics)) {
    return kEmpty;
  }
  return *node;
}

const std::vector<Node>& section_array(const Node& root, const std::string& name,
                                       Diagnostics& diagnostics) {
  static const std::vector<Node> kEmpty;
  const Node* node = root.find(name);
  if (node == nullptr || !expect_table_array(*node, name, diagnostics)) {
    return kEmpty;
  }
  return node->items;
}

const Location& key_location(const Node& table, std::string_view key) noexcept {
  const Node* node = table.find(key);
  return node != nullptr ? node->at : table.at;
}

void report_file_error(const physics::Error& error, const Node& table, std::string_view key,
                       Diagnostics& diagnostics) {
  diagnostics.add(key_location(table, key), fmt::format("'{}': {}", key, error.text));
}

namespace {

/// History of foster with `cached` without thermal.history_start_s: shade of 3.5 days, in steps
/// that grow into the past.
constexpr std::int64_t kShadedHistoryNs = 302'400'000'000'000;
constexpr std::uint32_t kShadedHistorySteps = 64;
/// History otherwise: the paper's 3.5 hours. Each step of `per-frame` costs a shadow map per frame.
constexpr std::int64_t kShortHistoryNs = 12'600'000'000'000;

/// Keys of [weather] beside `file` and `sample`: parameters of the clear-sky models.
bool is_clear_sky_key(std::string_view key) {
  return key != "file" && key != "sample" && !key.starts_with("cloud_base_") &&
         std::any_of(weather_keys().begin(), weather_keys().end(),
                     [key](const auto& known) { return known.spec.name == key; });
}

/// Completes a table of weather. Clear-sky keys beside a table that needs none of the models have
/// no effect, which is a fault.
void complete_table(const Node& table, const std::filesystem::path& file, ScenarioDesc& scenario,
                    Diagnostics& diagnostics) {
  const StatedClearSky stated{.air_mean = table.has("air_mean_k"),
                              .air_amplitude = table.has("air_amplitude_k"),
                              .dew_point = table.has("dew_point_k"),
                              .wind = table.has("wind_m_s"),
                              .cloud = table.has("cloud_frac")};
  const std::string name =
      file.empty() ? fmt::format("{}: [[weather.sample]]", scenario.file.string()) : file.string();
  if (complete_weather(name, stated, scenario)) return;
  for (const Member& member : table.members) {
    if (!is_clear_sky_key(member.key)) continue;
    diagnostics.add(member.key_at,
                    fmt::format("'{}' has no effect: the weather comes from {}", member.key,
                                file.empty() ? "[[weather.sample]]" : "a file"));
  }
}

/// Reads a weather file of any format.
Result<std::vector<scene::WeatherSample>> load_weather(const std::filesystem::path& file,
                                                       ScenarioDesc& scenario) {
  if (!is_weather_year(file)) return load_weather_csv(file);
  const auto year = load_weather_year(file);
  if (!year) return tl::unexpected<physics::Error>(year.error());
  return weather_of_year(*year, file.string(), scenario, scenario.warnings);
}

/// Fills the parameters of the clear-sky models that the scenario does not state from place and
/// date, and says so.
void take_climate(const Node& table, physics::ClearSky& sky, ScenarioDesc& scenario) {
  const physics::GeoPlace place{physics::Radians(scenario.place.lat_rad),
                                physics::Radians(scenario.place.lon_rad),
                                physics::Metres(scenario.place.height_m)};
  std::string taken;
  const auto take = [&](std::string_view key, double& value, double climate) {
    if (table.has(key)) return;
    value = climate;
    taken += fmt::format("{}weather.{} = {:.1f}", taken.empty() ? "" : ", ", key, value);
  };
  take("air_mean_k", sky.air_mean_k,
       physics::zonal_climate(place).at_k(physics::day_of_year(scenario.epoch_utc_ns)));
  take("dew_point_k", sky.dew_point_k, physics::usual_dew_point_k(sky.air_mean_k));
  if (taken.empty()) return;
  scenario.warnings.push_back(
      fmt::format("{}: the weather is not stated in full: place and date give {}",
                  scenario.file.string(), taken));
}

/// Gives samples without a wind that of their film. Reports samples with neither.
void complete_wind(const Node& array, std::vector<scene::WeatherSample>& samples,
                   Diagnostics& diagnostics) {
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (array.items[i].has("wind_m_s")) continue;
    if (!samples[i].film_w_m2_k) {
      diagnostics.add(array.items[i].at, "'wind_m_s' is needed where 'film_w_m2_k' is not given");
      continue;
    }
    samples[i].wind_m_s = wind_of_film_m_s(*samples[i].film_w_m2_k);
  }
}

/// Reads the weather. The thermal options say how far back it has to reach.
void resolve_weather(const Node& root, ScenarioDesc& scenario, Diagnostics& diagnostics) {
  const Node& table = section(root, "weather", diagnostics);
  WeatherDraft draft;
  const std::size_t faults = diagnostics.size();
  read_table(table, weather_keys(), draft, diagnostics);
  if (draft.file.empty() && !table.has("sample") && diagnostics.size() == faults) {
    take_climate(table, draft.clear_sky, scenario);
  }
  scenario.clear_sky = draft.clear_sky;
  const bool has_file = !draft.file.empty();
  const bool has_samples = table.has("sample");
  if (has_file && has_samples) {
    diagnostics.add(key_location(table, "file"), "use only one of 'file' and [[weather.sample]]");
    return;
  }
  if (has_file) {
    auto loaded = load_weather(draft.file, scenario);
    if (!loaded) {
      report_file_error(loaded.error(), table, "file", diagnostics);
      return;
    }
    scenario.weather = std::move(*loaded);
  } else {
    scenario.weather = std::move(draft.samples);
    if (has_samples && diagnostics.size() == faults) {
      complete_wind(*table.find("sample"), scenario.weather, diagnostics);
    }
    for (std::size_t i = 1; i < scenario.weather.size() && diagnostics.size() == faults; ++i) {
      if (scenario.weather[i].sim_time_ns <= scenario.weather[i - 1].sim_time_ns) {
        diagnostics.add(key_location(table.find("sample")->items[i], "time_s"),
                        "'time_s' is not later than in the sample before");
      }
    }
  }
  const bool model = !has_file && !has_samples;
  if (!model && diagnostics.size() == faults) {
    complete_table(table, draft.file, scenario, diagnostics);
  }
  if (model &&
      draft.clear_sky.dew_point_k > draft.clear_sky.air_mean_k + draft.clear_sky.air_amplitude_k) {
    diagnostics.add(
        key_location(table, "dew_point_k"),
        fmt::format("'dew_point_k' ({}) is above the warmest air ({})", draft.clear_sky.dew_point_k,
                    draft.clear_sky.air_mean_k + draft.clear_sky.air_amplitude_k));
  }
}

void resolve_display(const Node& root, ScenarioDesc& scenario, Diagnostics& diagnostics) {
  const Node& table = section(root, "display", diagnostics);
  read_table(table, display_keys(), scenario.display, diagnostics);
  if (scenario.display.min_k >= scenario.display.max_k) {
    diagnostics.add(key_location(table, table.has("max_k") ? "max_k" : "min_k"),
                    fmt::format("'max_k' ({}) must be above 'min_k' ({})", scenario.display.max_k,
                                scenario.display.min_k));
  }
}

/// Names of the sections, which are keys of the root too.
std::vector<std::string_view> section_names() {
  std::vector<std::string_view> names;
  for (const SectionDoc& doc : scenario_sections()) {
    if (!doc.path.empty() && doc.path.find('.') == std::string::npos) {
      names.push_back(doc.path);
    }
  }
  return names;
}

void resolve_head(const Node& root, ScenarioDesc& scenario, ScenarioHead& head,
                  Diagnostics& diagnostics) {
  head = default_scenario_head();
  head.name = scenario.file.stem().string();
  head.default_material.clear();
  if (!root.has("materials")) {
    head.materials.clear();
    auto shipped = find_data_file("materials/library.toml");
    if (shipped) {
      head.materials.push_back(*shipped);
    } else if (!root.has("material")) {
      diagnostics.add(root.at, "no materials: " + shipped.error().text);
    }
  }
  read_table(root, scenario_head_keys(), head, diagnostics, section_names(), place_of_daemon_key);
  scenario.name = head.name;
  scenario.epoch_utc_ns = head.epoch_utc_ns;
}

/// Chooses start, steps and spin-up of the history where the scenario leaves them open. The
/// extended model on samples has a history of shade that is long enough to need no spin-up
/// without it.
void complete_history(const Node& thermal, scene::ThermalOptions& options) {
  const bool start_stated = thermal.has("history_start_s");
  const bool extended = options.model == scene::ThermalModel::foster;
  const bool shaded = extended && options.method == scene::ThermalMethod::cached && !start_stated &&
                      !thermal.has("steps");
  if (shaded) {
    options.history_start_ns = -kShadedHistoryNs;
    options.steps = kShadedHistorySteps;
    if (!thermal.has("spacing")) options.spacing = scene::StepSpacing::geometric;
  } else if (!start_stated) {
    options.history_start_ns = -kShortHistoryNs;
  }
  if (!thermal.has("spin_up_s") && (shaded || !extended)) options.spin_up_ns = 0;
}

void check_surroundings(const Node& thermal, const ScenarioDesc& scenario,
                        Diagnostics& diagnostics) {
  const std::string& name = scenario.thermal.surroundings_material;
  if (!name.empty()) {
    check_material_name(name, scenario.materials, key_location(thermal, "surroundings_material"),
                        diagnostics);
  }
}

void resolve_default_material(const Node& root, const ScenarioHead& head, ScenarioDesc& scenario,
                              Diagnostics& diagnostics) {
  const bool given = root.has("default_material");
  scenario.default_material =
      given ? head.default_material : default_scenario_head().default_material;
  if (given) {
    check_material_name(scenario.default_material, scenario.materials,
                        key_location(root, "default_material"), diagnostics);
  } else if (std::ranges::find(scenario.materials, scenario.default_material,
                               &scene::Material::name) == scenario.materials.end()) {
    diagnostics.add(root.at, fmt::format("there is no material '{}': set default_material",
                                         scenario.default_material));
  }
}

/// Place and time decide where the sun stands. A scenario that does not give them runs with those
/// of the shipped scenarios, which is worth a warning.
void warn_of_default_place_and_time(const Node& root, const Node& place, ScenarioDesc& scenario) {
  const auto warn = [&scenario](std::string_view key, const std::string& value) {
    scenario.warnings.push_back(
        fmt::format("{}: '{}' is not given: {} is taken, which sets where the sun stands",
                    scenario.file.string(), key, value));
  };
  if (!root.has("epoch_utc")) warn("epoch_utc", toml_instant(scenario.epoch_utc_ns));
  if (!place.has("lat_deg")) {
    warn("place.lat_deg", unscaled_number(scenario.place.lat_rad, physics::kDegree));
  }
  if (!place.has("lon_deg")) {
    warn("place.lon_deg", unscaled_number(scenario.place.lon_rad, physics::kDegree));
  }
}

/// Reports parts whose material varies: their heat belongs to its mean alone.
void check_parts_vary_not(const Node& root, const ScenarioDesc& scenario,
                          Diagnostics& diagnostics) {
  for (const scene::ObjectDesc& object : scenario.objects) {
    for (const scene::PartDesc& part : object.parts) {
      const auto material =
          std::ranges::find(scenario.materials, part.material, &scene::Material::name);
      if (material == scenario.materials.end() || !scene::varies_in_heat(*material)) continue;
      diagnostics.add(key_location(root, "clutter"),
                      fmt::format("material '{}' varies: part '{}' of object '{}' cannot have it",
                                  material->name, part.name, object.name));
    }
  }
}

/// Clouds are drawn in the sky alone: a camera above them would see the ground through them.
void warn_of_camera_above_clouds(ScenarioDesc& scenario) {
  if (!scenario.clouds) return;
  const bool above =
      std::ranges::any_of(scenario.sensor.trajectory, [&scenario](const scene::Keyframe& key) {
        return key.pose.position_world_m.z >= scenario.clouds->base_m;
      });
  if (!above) return;
  scenario.warnings.push_back(
      fmt::format("{}: the sensor rises above the clouds ({} m), which hide nothing below it",
                  scenario.file.string(), toml_number(scenario.clouds->base_m)));
}

/// Temperatures are linear within a live step: an edge of shade that moves far in one is smeared.
void warn_of_clouds_that_outrun_steps(ScenarioDesc& scenario) {
  if (!scenario.clouds) return;
  const double moved_m = scenario.clouds->drift_m_s * scenario.thermal.first_step_s;
  if (moved_m <= 0.5 * scenario.clouds->shortest_m) return;
  scenario.warnings.push_back(
      fmt::format("{}: the clouds move {:.0f} m in a step of heat (thermal.first_step_s = {} s), "
                  "more than half "
                  "of clouds.shortest_m ({} m), which smears their shade in time; take {:.2g} s",
                  scenario.file.string(), moved_m, toml_number(scenario.thermal.first_step_s),
                  toml_number(scenario.clouds->shortest_m),
                  0.5 * scenario.clouds->shortest_m / scenario.clouds->drift_m_s));
}

/// Smoke drifts with the wind, whose direction has to be known.
void warn_of_smoke_without_wind(ScenarioDesc& scenario) {
  if (scenario.gas.smokes.empty()) return;
  const bool known = scenario.weather.empty()
                         ? scenario.clear_sky.wind_from_rad.has_value()
                         : std::ranges::all_of(scenario.weather, [](const auto& sample) {
                             return sample.wind_from_rad.has_value();
                           });
  if (known) return;
  scenario.warnings.push_back(fmt::format(
      "{}: smoke does not drift: the weather states no direction of the wind ('wind_from_deg')",
      scenario.file.string()));
}

}  // namespace

Result<std::vector<scene::Material>> load_materials(const std::filesystem::path& file,
                                                    std::span<const std::string> overrides) {
  // A library is what a scenario of nothing but materials would hold.
  Result<Node> parsed = parse_toml_file(file);
  if (!parsed) return tl::unexpected<physics::Error>(parsed.error());
  Diagnostics diagnostics;
  for (const Member& member : parsed->members) {
    if (member.key != "material") {
      diagnostics.add(member.key_at, unknown_key_text(member.key, {"material"}));
    }
  }
  for (const std::string& text : overrides) {
    if (addresses_element_of(text, "material")) {
      apply_override(*parsed, text, diagnostics);
    } else {
      diagnostics.add(parsed->at, fmt::format("override '{}' names no material", text));
    }
  }
  const std::vector<Node> nodes = collect_material_nodes(*parsed, {}, diagnostics);
  // The bands of a library are those of the scenarios that name it; spectra are folded over the
  // built-in ones, behind mid-latitude air in summer.
  std::vector<std::string> bands = known_band_names({});
  for (const Node& node : nodes) {
    const Node* of_bands = node.find("band_emissivity_frac");
    if (of_bands == nullptr || of_bands->kind != Node::Kind::table) continue;
    for (const Member& member : of_bands->members) bands.push_back(member.key);
  }
  auto materials = resolve_materials(nodes, bands, diagnostics);
  ScenarioDesc usual;
  usual.bands = built_in_bands();
  std::vector<std::string> warnings;  // whoever shows the materials has the errors in them
  fold_spectra(nodes, usual, UncoveredBand::skip, materials, warnings, diagnostics);
  check_glosses(nodes, {}, {}, materials, diagnostics);
  if (!diagnostics.empty()) return tl::unexpected<physics::Error>(diagnostics.error());
  return materials;
}

Result<ScenarioDesc> load_scenario(const std::filesystem::path& file,
                                   std::span<const std::string> overrides,
                                   const LoadOptions& options) {
  Result<Node> parsed = parse_toml_file(file);
  if (!parsed) {
    return tl::unexpected<physics::Error>(parsed.error());
  }
  Node& root = *parsed;
  if (kind_of(root) == FileKind::daemon) {
    const Node* named = root.find("scenario");
    return physics::make_error(
        physics::ErrorCode::config,
        fmt::format(
            "{0}: this is a configuration of the daemon, not a scenario; `emitd --config {0}` runs "
            "it{1}",
            file.string(),
            named != nullptr && named->kind == Node::Kind::text
                ? fmt::format(", and its key 'scenario' names the scenario '{}'", named->text)
                : std::string()));
  }
  Diagnostics diagnostics;
  apply_environment(root, scenario_sections(), options, diagnostics);
  for (const std::string& text : overrides) {
    if (!addresses_element_of(text, "material")) {
      apply_override(root, text, diagnostics);
    }
  }

  ScenarioDesc scenario;
  scenario.file = file;
  ScenarioHead head;
  resolve_head(root, scenario, head, diagnostics);

  // Overrides may address library materials too, so they wait until all tables are together.
  Node pool;
  Node list;
  list.kind = Node::Kind::array;
  list.items = collect_material_nodes(root, head.materials, diagnostics);
  pool.members.push_back({"material", root.at, std::move(list)});
  for (const std::string& text : overrides) {
    if (addresses_element_of(text, "material")) {
      apply_override(pool, text, diagnostics);
    }
  }

  scenario.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 0.0};
  const Node& place = section(root, "place", diagnostics);
  read_table(place, place_keys(), scenario.place, diagnostics);
  warn_of_default_place_and_time(root, place, scenario);
  const Node& thermal = section(root, "thermal", diagnostics);
  scenario.thermal = default_thermal();
  read_table(thermal, thermal_keys(), scenario.thermal, diagnostics);
  complete_history(thermal, scenario.thermal);
  resolve_weather(root, scenario, diagnostics);
  resolve_clouds(root, scenario, diagnostics);
  scenario.thermal.initial_stated = thermal.has("initial_k");
  if (!scenario.thermal.initial_stated) scenario.thermal.initial_k = scene::mean_air_k(scenario);
  resolve_display(root, scenario, diagnostics);

  const std::vector<scene::SpectralBand> declared = resolve_declared_bands(root, diagnostics);
  const std::vector<std::string> known = known_band_names(declared);
  scenario.channels = resolve_channels(root, known, diagnostics);
  scenario.bands = bands_in_use(scenario.channels, declared);
  scenario.atmosphere = resolve_atmosphere(root, scenario, diagnostics);
  // Weather that was measured has the fog in it; the models of the clear sky get its shade.
  if (scenario.atmosphere.fog && scenario.weather.empty()) {
    scenario.clear_sky.fog = physics::fog_shade(*scenario.atmosphere.fog);
  }

  const std::vector<Node>& material_nodes = pool.members[0].value.items;
  scenario.materials = resolve_materials(material_nodes, known, diagnostics);
  scenario.objects =
      resolve_objects(root, scenario.materials, options.require_scene_files, diagnostics);
  fold_spectra(material_nodes, scenario, UncoveredBand::refuse, scenario.materials,
               scenario.warnings, diagnostics);
  check_glosses(material_nodes, scenario, declared, scenario.materials, diagnostics);
  complete_band_emissivities(scenario.bands, scenario.materials);
  resolve_clutter(root, scenario.thermal, known, scenario.materials, diagnostics);
  // The renderer gets only bands that a channel shows, and emissivities in those bands.
  std::vector<std::string> handed_over = known_band_names({});
  for (const scene::SpectralBand& band : scenario.bands) {
    handed_over.push_back(band.name);
  }
  for (scene::Material& material : scenario.materials) {
    std::erase_if(material.band_emissivity, [&handed_over](const scene::BandEmissivity& entry) {
      return std::find(handed_over.begin(), handed_over.end(), entry.band) == handed_over.end();
    });
  }
  scene::resolve_bases(scenario);
  resolve_default_material(root, head, scenario, diagnostics);
  check_surroundings(thermal, scenario, diagnostics);
  scenario.sensor = resolve_sensor(root, diagnostics);
  warn_of_camera_above_clouds(scenario);
  warn_of_clouds_that_outrun_steps(scenario);
  check_parts_vary_not(root, scenario, diagnostics);
  scenario.contacts = resolve_contacts(root, scenario.objects, scenario.materials, diagnostics);
  scenario.gas = resolve_gas(root, scenario.objects, known, diagnostics);
  warn_of_smoke_without_wind(scenario);
  // Channels may be carried by entities.
  check_channels(root, scenario, options.require_scene_files, diagnostics);
  if (!diagnostics.empty()) {
    return tl::unexpected<physics::Error>(diagnostics.error());
  }
  return scenario;
}

}  // namespace emit::config
