// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/constants.hpp"
#include "emit/physics/foster.hpp"
#include "keys.hpp"

/// Keys of a scenario: place, time, weather, atmosphere, thermal simulation, bands, display.
namespace emit::config {

using physics::kDegree;
using scene::BandAtmosphere;
using scene::DisplayOptions;
using scene::Place;
using scene::StepSpacing;
using scene::ThermalMethod;
using scene::ThermalModel;
using scene::ThermalOptions;
using scene::WeatherSample;

ScenarioHead default_scenario_head() {
  ScenarioHead head;
  head.epoch_utc_ns = 1'403'344'800'000'000'000;  // 2014-06-21T10:00:00Z
  head.materials = {std::filesystem::path(kShippedLibrary)};
  head.default_material = "concrete";
  return head;
}

const KeyTable<ScenarioHead>& scenario_head_keys() {
  static const KeyTable<ScenarioHead> keys = {
      text<ScenarioHead>("name", EMIT_FIELD(name),
                         "Name of the scenario in messages and file attributes. Without it the "
                         "name of the file counts."),
      custom<ScenarioHead>(
          {"epoch_utc", "instant", "UTC", "1900 .. 2199",
           "Instant of simulation time 0, with an offset: `2014-06-21T06:00:00Z` or `...+02:00`. "
           "All other times are seconds from this instant.",
           false},
          [](ScenarioHead& out, const Node& node, Diagnostics& diagnostics) {
            read_instant(node, "epoch_utc", out.epoch_utc_ns, diagnostics);
          },
          [](const ScenarioHead& in) { return toml_instant(in.epoch_utc_ns); }),
      custom<ScenarioHead>(
          {"materials", "array of paths", "", "",
           "Files with materials. A material of the scenario itself replaces one of the same name.",
           false},
          [](ScenarioHead& out, const Node& node, Diagnostics& diagnostics) {
            if (node.kind != Node::Kind::array) {
              diagnostics.add(node.at, "'materials' must be an array of paths, not " +
                                           std::string(kind_name(node.kind)));
              return;
            }
            out.materials.clear();
            for (const Node& item : node.items) {
              std::filesystem::path library;
              const std::size_t faults = diagnostics.size();
              read_path(item, "materials", library, diagnostics);
              if (diagnostics.size() == faults) {
                out.materials.push_back(std::move(library));
              }
            }
          },
          [](const ScenarioHead& in) {
            std::string out = "[";
            for (const std::filesystem::path& library : in.materials) {
              out += (out.size() > 1 ? ", " : "") + toml_string(library.string());
            }
            return out + "]";
          }),
      text<ScenarioHead>("default_material", EMIT_FIELD(default_material),
                         "This material is used for glTF materials that nothing else maps."),
  };
  return keys;
}

const KeyTable<Place>& place_keys() {
  static const KeyTable<Place> keys = {
      number<Place>("lat_deg", "deg", between(-90, 90), EMIT_FIELD(lat_rad),
                    "Geodetic latitude of the world origin (WGS-84). North is positive.", kDegree),
      number<Place>("lon_deg", "deg", between(-180, 180), EMIT_FIELD(lon_rad),
                    "Longitude of the world origin. East is positive.", kDegree),
      number<Place>("height_m", "m", between(-500, 9000), EMIT_FIELD(height_m),
                    "Height of the world origin above the WGS-84 ellipsoid."),
  };
  return keys;
}

const KeyTable<WeatherSample>& weather_sample_keys() {
  static const KeyTable<WeatherSample> keys = {
      required(nanoseconds<WeatherSample>(
          "time_s", "s", 1e9, between(-limits::kMaxSimTimeS, limits::kMaxSimTimeS),
          EMIT_FIELD(sim_time_ns), "Simulation time. It increases from row to row.")),
      required(number<WeatherSample>(
          "dni_w_m2", "W m-2", between(limits::kDirectNormalWM2), EMIT_FIELD(direct_normal_w_m2),
          "Irradiance by the direct sun on a surface that faces it (DNI).")),
      required(number<WeatherSample>("dhi_w_m2", "W m-2", between(limits::kDiffuseHorizontalWM2),
                                     EMIT_FIELD(diffuse_horizontal_w_m2),
                                     "Irradiance by diffuse sunlight on level ground (DHI).")),
      required(number<WeatherSample>(
          "longwave_down_w_m2", "W m-2", between(limits::kLongwaveDownWM2),
          EMIT_FIELD(longwave_down_w_m2), "Long-wave irradiance by the sky on level ground.")),
      required(number<WeatherSample>("air_k", "K", between(limits::kAirK), EMIT_FIELD(air_k),
                                     "Air temperature.")),
      number<WeatherSample>("wind_m_s", "m s-1", between(limits::kWindMS), EMIT_FIELD(wind_m_s),
                            "Wind speed. Without it the wind is that of `film_w_m2_k`, which is "
                            "needed then."),
      number<WeatherSample>("wind_from_deg", "deg", between(limits::kWindFromDeg),
                            EMIT_FIELD(wind_from_rad),
                            "Direction from which the wind blows, clockwise from north. Without it "
                            "faces take the mean over all directions.",
                            kDegree),
      number<WeatherSample>("cloud_frac", "", between(limits::kCloudFrac), EMIT_FIELD(cloud_frac),
                            "Share of the direct sun that clouds take (beta of physics.md eq. 1). "
                            "It is 0 where `dni_w_m2` is measured."),
      number<WeatherSample>("environment_k", "K", between(limits::kEnvironmentK),
                            EMIT_FIELD(environment_k),
                            "Temperature of the surroundings. Without it emit2014 takes the air's, "
                            "and foster computes it (`thermal.surroundings_material`)."),
      number<WeatherSample>(
          "film_w_m2_k", "W m-2 K-1", between(limits::kFilmWM2K), EMIT_FIELD(film_w_m2_k),
          "Convection coefficient of all faces. Without it the air film of physics.md "
          "section 8 gives one for each. "
          "emit2014 does not use it."),
      number<WeatherSample>("relative_humidity_frac", "", between(limits::kHumidityFrac),
                            EMIT_FIELD(relative_humidity_frac),
                            "foster: relative humidity of the air, for materials that evaporate. "
                            "Without it the dew point is that of 60 % at the mean air."),
      number<WeatherSample>("rain_mm_h", "mm h-1", between(limits::kRainMmH), EMIT_FIELD(rain_mm_h),
                            "foster: rain since the row before, for materials that hold water. "
                            "See Evaporation."),
  };
  return keys;
}

const KeyTable<WeatherDraft>& weather_keys() {
  static const KeyTable<WeatherDraft> keys = {
      path<WeatherDraft>(
          "file", EMIT_FIELD(file),
          "CSV file with the columns of `[[weather.sample]]`, or a typical year (EPW, "
          "TMY3). Without file and samples the clear-sky models below make the "
          "weather."),
      number<WeatherDraft>("linke_turbidity", "", between(1, 10),
                           EMIT_FIELD(clear_sky.linke_turbidity),
                           "Clear-sky models: Linke turbidity of the Ineichen model."),
      open_default(number<WeatherDraft>(
          "air_mean_k", "K", between(limits::kAirK), EMIT_FIELD(clear_sky.air_mean_k),
          "Clear-sky models: daily mean of the air temperature. Without it that of "
          "the latitude, the height and the date.")),
      number<WeatherDraft>(
          "air_amplitude_k", "K", between(0, 40), EMIT_FIELD(clear_sky.air_amplitude_k),
          "Clear-sky models: amplitude of the daily cosine, which is warmest at 15:00 solar time."),
      open_default(number<WeatherDraft>(
          "dew_point_k", "K", between(180, 320), EMIT_FIELD(clear_sky.dew_point_k),
          "Clear-sky models: dew point, for the emissivity of the sky and the humidity of the air. "
          "Without it that of 60 % relative humidity.")),
      number<WeatherDraft>("wind_m_s", "m s-1", between(limits::kWindMS),
                           EMIT_FIELD(clear_sky.wind_m_s), "Clear-sky models: wind speed."),
      number<WeatherDraft>("wind_from_deg", "deg", between(0, 360),
                           EMIT_FIELD(clear_sky.wind_from_rad),
                           "Clear-sky models: direction from which the wind blows, clockwise from "
                           "north. Without it faces take the mean over all directions.",
                           kDegree),
      number<WeatherDraft>("cloud_frac", "", between(limits::kCloudFrac),
                           EMIT_FIELD(clear_sky.cloud_frac),
                           "Clear-sky models: share of the direct sun that clouds take, and of "
                           "the sky that they cover."),
      number<WeatherDraft>("cloud_base_m", "m", between(0, 12000),
                           EMIT_FIELD(clear_sky.cloud_base.height_m),
                           "Height of the clouds' base above the ground. Without it and "
                           "`cloud_base_k` the base is at 0.941 of the air's temperature."),
      number<WeatherDraft>("cloud_base_k", "K", between(150, 330),
                           EMIT_FIELD(clear_sky.cloud_base.kelvin),
                           "Temperature of the clouds' base. Without it that of air that cools by "
                           "6.5 K/km up to the base."),
      custom<WeatherDraft>(
          {"sample", "array of tables", "", "", "Weather in this file, see `[[weather.sample]]`.",
           false},
          [](WeatherDraft& out, const Node& node, Diagnostics& diagnostics) {
            read_array(node, "sample", weather_sample_keys(), WeatherSample{}, out.samples,
                       diagnostics);
          },
          [](const WeatherDraft& in) { return write_array(in.samples, weather_sample_keys()); }),
  };
  return keys;
}

namespace {

bool read_numbers(const Node& node, const std::string& name, const Range& range, double scale,
                  std::vector<double>& out, Diagnostics& diagnostics) {
  if (node.kind != Node::Kind::array || node.items.empty()) {
    diagnostics.add(node.at, "'" + name + "' must be an array of numbers");
    return false;
  }
  const std::size_t faults = diagnostics.size();
  for (const Node& item : node.items) {
    double value = 0.0;
    read_number(item, name, range, value, diagnostics);
    out.push_back(value * scale);
  }
  return diagnostics.size() == faults;
}

/// Key of an axis of an atmosphere table.
template <class Field>
Key<BandAtmosphere> axis_key(std::string name, std::string unit, Range range, Field field,
                             double scale, std::string meaning) {
  return custom<BandAtmosphere>(
      {name, "array of floats", std::move(unit), range.to_string() + ", ascending",
       std::move(meaning), false},
      [name, range, field, scale](BandAtmosphere& out, const Node& node, Diagnostics& diagnostics) {
        field(out).clear();
        read_numbers(node, name, range, scale, field(out), diagnostics);
      },
      [field, scale](const BandAtmosphere& in) -> std::optional<std::string> {
        if (in.table.empty()) {
          return std::nullopt;
        }
        std::string out = "[";
        for (const double value : field(in)) {
          out += (out.size() > 1 ? ", " : "") + unscaled_number(value, scale);
        }
        return out + "]";
      });
}

/// Key of the values of an atmosphere table, an array per elevation.
template <class Field>
Key<BandAtmosphere> plane_key(std::string name, std::string unit, Range range, Field field,
                              std::string meaning) {
  return custom<BandAtmosphere>(
      {name, "array of arrays of floats", std::move(unit), range.to_string(), std::move(meaning),
       false},
      [name, range, field](BandAtmosphere& out, const Node& node, Diagnostics& diagnostics) {
        field(out).clear();
        if (node.kind != Node::Kind::array || node.items.empty()) {
          diagnostics.add(node.at, "'" + name + "' must be an array of arrays of numbers");
          return;
        }
        for (const Node& item : node.items) {
          if (item.kind == Node::Kind::array &&
              item.items.size() != node.items.front().items.size()) {
            diagnostics.add(item.at, "'" + name + "' has rows of different length");
            return;
          }
          if (!read_numbers(item, name, range, 1.0, field(out), diagnostics)) {
            return;
          }
        }
      },
      [field](const BandAtmosphere& in) -> std::optional<std::string> {
        if (in.table.empty()) {
          return std::nullopt;
        }
        const std::vector<double>& values = field(in);
        const std::size_t ranges = in.table.range_m.size();
        std::string out = "[";
        for (std::size_t i = 0; i + ranges <= values.size(); i += ranges) {
          out += (i > 0 ? ", " : "") + toml_vector(values.data() + i, ranges);
        }
        return out + "]";
      });
}

}  // namespace

const KeyTable<BandAtmosphere>& band_atmosphere_keys() {
  static const KeyTable<BandAtmosphere> keys = {
      required(text<BandAtmosphere>("band", EMIT_FIELD(band), "Name of a band.")),
      custom<BandAtmosphere>(
          {"terms", "array of [a, k]", "1, km-1", "1 .. 4 terms, sum of a = 1, k >= 0",
           "Over range R the transmittance is tau = sum of a exp(-k R). Path radiance is (1 - "
           "tau) times the blackbody's at air temperature.",
           false},
          [](BandAtmosphere& out, const Node& node, Diagnostics& diagnostics) {
            if (node.kind != Node::Kind::array || node.items.empty() ||
                node.items.size() > limits::kMaxAtmosphereTerms) {
              diagnostics.add(node.at, "'terms' must be an array of 1 to 4 pairs [a, k]");
              return;
            }
            out.terms.clear();
            double sum = 0.0;
            const std::size_t faults = diagnostics.size();
            for (const Node& item : node.items) {
              double pair[2] = {0.0, 0.0};
              read_vector(item, "terms", 2, pair, diagnostics);
              if (!(pair[0] >= 0.0 && pair[0] <= 1.0 && pair[1] >= 0.0)) {
                diagnostics.add(item.at, "a term [a, k] needs a in 0 .. 1 and k >= 0");
              }
              sum += pair[0];
              out.terms.push_back({pair[0], pair[1]});
            }
            if (diagnostics.size() == faults && std::abs(sum - 1.0) > 1e-3) {
              diagnostics.add(node.at, "the amplitudes of 'terms' add up to " + toml_number(sum) +
                                           ", must be 1");
            }
          },
          [](const BandAtmosphere& in) -> std::optional<std::string> {
            if (in.terms.empty()) {
              return std::nullopt;
            }
            std::string out = "[";
            for (const scene::AtmosphereTerm& term : in.terms) {
              const double pair[2] = {term.amplitude_frac, term.extinction_per_km};
              out += (out.size() > 1 ? ", " : "") + toml_vector(pair, 2);
            }
            return out + "]";
          }),
      written_if<BandAtmosphere>(
          [](const BandAtmosphere& in) { return in.table.empty(); },
          number<BandAtmosphere>(
              "vertical_transmittance_frac", "", between(0, 1),
              EMIT_FIELD(vertical_transmittance_frac),
              "Transmittance from the ground to space at the zenith. The sky radiates (1 - "
              "tau^airmass) times a blackbody at air temperature.")),
      axis_key("range_m", "m", between(0, 1e7), EMIT_FIELD(table.range_m), 1.0,
               "Table in place of terms: its ranges. The last one stands for the way out of the "
               "atmosphere."),
      axis_key("elevation_deg", "deg", between(-90, 90), EMIT_FIELD(table.elevation_rad), kDegree,
               "Table: elevations of the line of sight, negative when it looks down. A single one "
               "holds for all."),
      plane_key("transmittance_frac", "", between(0, 1), EMIT_FIELD(table.transmittance_frac),
                "Table: transmittances, one row per elevation, one value per range."),
      plane_key("path_radiance_w_m2_sr", "W m-2 sr-1", between(0, 1e6),
                EMIT_FIELD(table.path_radiance_w_m2_sr),
                "Table: in-band radiance of the air itself, in the same order."),
  };
  return keys;
}

const KeyTable<AtmosphereDraft>& atmosphere_keys() {
  static const KeyTable<AtmosphereDraft> keys = {
      boolean<AtmosphereDraft>(
          "enabled", EMIT_FIELD(enabled),
          "With `false` the transmittance is 1 along every path, and the air does not radiate."),
      choice<AtmosphereDraft>(
          "model",
          std::vector<std::pair<std::string, std::string>>{
              {"auto", "auto"},
              {"tropical", "tropical"},
              {"midlatitude_summer", "midlatitude_summer"},
              {"midlatitude_winter", "midlatitude_winter"},
              {"subarctic_summer", "subarctic_summer"},
              {"subarctic_winter", "subarctic_winter"},
              {"us_standard", "us_standard"},
              {"none", "none"}},
          EMIT_FIELD(model),
          "Climate of the built-in air (see Built-in air). With `none` only `file` and "
          "`[[atmosphere.band]]` count."),
      number<AtmosphereDraft>("visibility_km", "km", between(2, 50), EMIT_FIELD(visibility_km),
                              "Visibility in the haze of the built-in air."),
      number<AtmosphereDraft>("water_ratio", "", between(0, 5), EMIT_FIELD(water_ratio),
                              "Water vapour of the built-in air, by that of its climate. Without "
                              "it: see Built-in air."),
      path<AtmosphereDraft>("file", EMIT_FIELD(file),
                            "CSV or tape7 file of the air (see Atmosphere tables). It comes before "
                            "the model. Bands that a table lacks need `model` written out."),
      custom<AtmosphereDraft>(
          {"band", "array of tables", "", "",
           "Terms or a table in this file, see `[[atmosphere.band]]`. They replace file and model "
           "for their bands.",
           false},
          [](AtmosphereDraft& out, const Node& node, Diagnostics& diagnostics) {
            read_array(node, "band", band_atmosphere_keys(), BandAtmosphere{}, out.bands,
                       diagnostics);
          },
          [](const AtmosphereDraft& in) { return write_array(in.bands, band_atmosphere_keys()); }),
      custom<AtmosphereDraft>(
          {"fog", "table", "", "", "Fog, mist or humid haze near the ground (`[atmosphere.fog]`).",
           false},
          [](AtmosphereDraft& out, const Node& node, Diagnostics& diagnostics) {
            if (!expect_table(node, "fog", diagnostics)) return;
            out.fog.emplace();
            read_table(node, fog_keys(), *out.fog, diagnostics);
          },
          [](const AtmosphereDraft& in) -> std::optional<std::string> {
            if (!in.fog) return std::nullopt;
            return inline_table(*in.fog, fog_keys());
          }),
  };
  return keys;
}

const KeyTable<physics::Fog>& fog_keys() {
  static const KeyTable<physics::Fog> keys = [] {
    std::vector<std::pair<std::string, physics::FogKind>> kinds;
    for (const auto& [name, kind] : physics::kFogKinds) kinds.emplace_back(name, kind);
    return KeyTable<physics::Fog>{
        required(choice<physics::Fog>("kind", kinds, EMIT_FIELD(kind),
                                      "Droplets, from the largest to the smallest (see Fog).")),
        required(
            number<physics::Fog>("visibility_m", "m", between(20, 10000), EMIT_FIELD(visibility_m),
                                 "Range at which 2 % of a contrast are left in visible light.")),
        required(number<physics::Fog>("top_m", "m", between(1, 2000), EMIT_FIELD(top_m),
                                      "Height of its top above the world's origin.")),
    };
  }();
  return keys;
}

ThermalOptions default_thermal() {
  ThermalOptions thermal;
  thermal.model = ThermalModel::foster;
  thermal.spin_up_ns = 172'800'000'000'000;  // two days
  return thermal;
}

const KeyTable<ThermalOptions>& thermal_keys() {
  static const KeyTable<ThermalOptions> keys = {
      choice<ThermalOptions>(
          "model",
          std::vector<std::pair<std::string, ThermalModel>>{{"emit2014", ThermalModel::emit2014},
                                                            {"foster", ThermalModel::foster}},
          EMIT_FIELD(model),
          "Surface model. foster: convection, sky, surroundings and all layers of the material by "
          "2 to 4 states. emit2014: the published model, equilibrium relaxed by modes."),
      choice<ThermalOptions>(
          "method",
          std::vector<std::pair<std::string, ThermalMethod>>{
              {"per-frame", ThermalMethod::per_frame}, {"cached", ThermalMethod::cached}},
          EMIT_FIELD(method),
          "cached: samples of the surface carry the history from interval to interval. "
          "per-frame: every pixel of every frame evaluates all steps again."),
      number<ThermalOptions>(
          "tolerance_k", "K", above_to(0, 50), EMIT_FIELD(tolerance_k),
          "Error of surface temperatures to aim at. foster splits history steps for it, cached "
          "refines surfaces for it. per-frame with emit2014 does not use it."),
      open_default(number<ThermalOptions>(
          "initial_k", "K", between(150, 1000), EMIT_FIELD(initial_k),
          "Temperature of surfaces at the start: of the spin-up with foster, of the history with "
          "emit2014. Without it: see Thermal history.")),
      open_default(nanoseconds<ThermalOptions>(
          "history_start_s", "s", 1e9, between(-limits::kMaxSimTimeS, limits::kMaxSimTimeS),
          EMIT_FIELD(history_start_ns),
          "Simulation time from which shadows act on surfaces. Without it: see Thermal history.")),
      open_default(nanoseconds<ThermalOptions>(
          "spin_up_s", "s", 1e9, between(0, 3.2e7), EMIT_FIELD(spin_up_ns),
          "foster: time of weather without shadows before the history. Without it: see Thermal "
          "history.")),
      text<ThermalOptions>("surroundings_material", EMIT_FIELD(surroundings_material),
                           "foster: material of the surroundings where the weather states no "
                           "`environment_k`. Without it `default_material` counts."),
      integer<ThermalOptions>("foster_modes", "", 0,
                              static_cast<std::int64_t>(physics::kMaxFosterModes),
                              EMIT_FIELD(foster_modes),
                              "foster: number of states per material, derived from its layers. 0 "
                              "takes the fitted modes of the material."),
      integer<ThermalOptions>("steps", "", limits::kHistorySteps, EMIT_FIELD(steps),
                              "Number of history steps. Each has a shadow map."),
      choice<ThermalOptions>(
          "spacing",
          std::vector<std::pair<std::string, StepSpacing>>{{"geometric", StepSpacing::geometric},
                                                           {"uniform", StepSpacing::uniform}},
          EMIT_FIELD(spacing),
          "uniform: all steps have one length. geometric: steps grow into the past."),
      number<ThermalOptions>("first_step_s", "s", above_to(0, 86400), EMIT_FIELD(first_step_s),
                             "Length of the newest step with geometric spacing. With cached it is "
                             "the length of the intervals too."),
      integer<ThermalOptions>("shadow_map_px", "px", limits::kShadowMapPx,
                              EMIT_FIELD(shadow_map_px), "Width and height of a shadow map."),
      integer<ThermalOptions>("max_cascades", "", limits::kCascades, EMIT_FIELD(max_cascades),
                              "Largest number of shadow maps per step. Scenes larger than one map "
                              "resolves need several."),
      integer<ThermalOptions>(
          "blocker_taps", "",
          limits::kShadowTaps, EMIT_FIELD(blocker_taps),
          "Number of samples in the search for the surface that casts the shadow."),
      integer<ThermalOptions>("filter_taps", "", limits::kShadowTaps, EMIT_FIELD(filter_taps),
                              "Number of samples of the soft-shadow filter."),
      number<ThermalOptions>(
          "obscurance_radius_m", "m", above_to(0, 100), EMIT_FIELD(obscurance_radius_m),
          "per-frame: surfaces within this radius hide the sky from each other."),
      integer<ThermalOptions>(
          "max_samples", "", 1000, 100000000, EMIT_FIELD(max_samples),
          "cached: largest number of thermal samples, about 1.5 kB each. Meshes that need more "
          "than half of them lose detail, and frames are flagged degraded."),
      number<ThermalOptions>("film_factor", "", between(0.1, 10), EMIT_FIELD(film_factor),
                             "foster: factor on the film of the air of every face. Published "
                             "correlations differ by 30 "
                             "%."),
      boolean<ThermalOptions>("lateral", EMIT_FIELD(lateral),
                              "cached with foster: heat is also conducted along the surface and "
                              "across convex edges. emit2014 conducts straight down."),
      boolean<ThermalOptions>(
          "exchange", EMIT_FIELD(exchange),
          "cached with foster: faces exchange radiation with each other. With `false` they see the "
          "temperature of the surroundings where others hide the sky."),
      path<ThermalOptions>("state_file", EMIT_FIELD(state_file),
                           "cached: file of the warmed-up surface. The first run writes it, runs "
                           "that start up to 15 minutes later read it. Others are refused."),
  };
  return keys;
}

const KeyTable<DisplayOptions>& display_keys() {
  static const KeyTable<DisplayOptions> keys = {
      number<DisplayOptions>("min_k", "K", between(0, 5000), EMIT_FIELD(min_k),
                             "Coldest temperature of the false-colour scale."),
      number<DisplayOptions>("max_k", "K", between(0, 5000), EMIT_FIELD(max_k),
                             "Warmest temperature of the false-colour scale. It is above `min_k`."),
  };
  return keys;
}

const KeyTable<BandDraft>& band_keys() {
  static const KeyTable<BandDraft> keys = {
      required(text<BandDraft>("name", EMIT_FIELD(desc.name),
                               "Name that channels and materials use. The band replaces a built-in "
                               "one of the same name.")),
      written_if(
          [](const BandDraft& in) { return in.desc.lo_um > 0.0; },
          number<BandDraft>("lo_um", "um", between(0.2, 100), EMIT_FIELD(desc.lo_um),
                            "Shortest wavelength. Without it the response begins the band.")),
      written_if([](const BandDraft& in) { return in.desc.hi_um > 0.0; },
                 number<BandDraft>("hi_um", "um", between(0.2, 100), EMIT_FIELD(desc.hi_um),
                                   "Longest wavelength. Without it the response ends the band.")),
      written_if([](const BandDraft& in) { return in.desc.photons; },
                 boolean<BandDraft>("photons", EMIT_FIELD(desc.photons),
                                    "The response is that per photon, as a photon detector has it. "
                                    "Without it the response is per power.")),
      curve<BandDraft>("response", EMIT_FIELD(desc.response),
                       "Relative spectral response, linear between its points. Without it the band "
                       "is a perfect rectangle."),
      path<BandDraft>("response_file", EMIT_FIELD(response_file),
                      "CSV file `wavelength_um,response_frac` in place of `response`."),
  };
  return keys;
}

}  // namespace emit::config
