// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/constants.hpp"
#include "keys.hpp"

/// Keys of a scenario: place, time, weather, atmosphere, thermal simulation, sensor.
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
                         "Name in messages and file attributes; the file's name if absent."),
      custom<ScenarioHead>(
          {"epoch_utc", "instant", "UTC", "1900 .. 2199",
           "Instant of sim time 0, with offset: `2014-06-21T06:00:00Z` or `...+02:00`. All other "
           "times are seconds from here.",
           false},
          [](ScenarioHead& out, const Node& node, Diagnostics& diagnostics) {
            read_instant(node, "epoch_utc", out.epoch_utc_ns, diagnostics);
          },
          [](const ScenarioHead& in) { return toml_instant(in.epoch_utc_ns); }),
      custom<ScenarioHead>(
          {"materials", "array of paths", "", "",
           "Material libraries. A material of the scenario itself replaces a library's of the same "
           "name.",
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
                         "Material of glTF materials that nothing else maps."),
  };
  return keys;
}

const KeyTable<Place>& place_keys() {
  static const KeyTable<Place> keys = {
      number<Place>("lat_deg", "deg", between(-90, 90), EMIT_FIELD(lat_rad),
                    "Geodetic latitude of the world origin (WGS-84), north positive.", kDegree),
      number<Place>("lon_deg", "deg", between(-180, 180), EMIT_FIELD(lon_rad),
                    "Longitude of the world origin, east positive.", kDegree),
      number<Place>("height_m", "m", between(-500, 9000), EMIT_FIELD(height_m),
                    "Height of the world origin above the ellipsoid."),
  };
  return keys;
}

const KeyTable<WeatherSample>& weather_sample_keys() {
  static const KeyTable<WeatherSample> keys = {
      required(nanoseconds<WeatherSample>("time_s", "s", 1e9, between(-1e9, 1e9),
                                          EMIT_FIELD(sim_time_ns), "Sim time; ascending.")),
      required(number<WeatherSample>("dni_w_m2", "W m-2", between(0, 2000),
                                     EMIT_FIELD(direct_normal_w_m2),
                                     "Direct sun on a surface that faces it.")),
      required(number<WeatherSample>("dhi_w_m2", "W m-2", between(0, 1500),
                                     EMIT_FIELD(diffuse_horizontal_w_m2),
                                     "Diffuse sunlight on level ground.")),
      required(number<WeatherSample>("longwave_down_w_m2", "W m-2", between(0, 1000),
                                     EMIT_FIELD(longwave_down_w_m2),
                                     "Thermal radiation of the sky on level ground.")),
      required(number<WeatherSample>("air_k", "K", between(180, 340), EMIT_FIELD(air_k),
                                     "Air temperature.")),
      required(number<WeatherSample>("wind_m_s", "m s-1", between(0, 100), EMIT_FIELD(wind_m_s),
                                     "Wind speed.")),
      required(number<WeatherSample>("cloud_frac", "", between(0, 1), EMIT_FIELD(cloud_frac),
                                     "Share of the direct sun that clouds take (beta of Eq. 1); 0 "
                                     "where dni_w_m2 is measured.")),
      number<WeatherSample>("environment_k", "K", between(100, 400), EMIT_FIELD(environment_k),
                            "Temperature of the surroundings; air temperature if absent."),
      number<WeatherSample>(
          "film_w_m2_k", "W m-2 K-1", between(0, 1000), EMIT_FIELD(film_w_m2_k),
          "Convection coefficient; a wind model if absent. Not used by emit2014."),
  };
  return keys;
}

const KeyTable<WeatherDraft>& weather_keys() {
  static const KeyTable<WeatherDraft> keys = {
      path<WeatherDraft>("file", EMIT_FIELD(file),
                         "CSV with the columns of `[[weather.sample]]`. In its place: samples "
                         "inline, or the clear-sky models below."),
      number<WeatherDraft>("linke_turbidity", "", between(1, 10),
                           EMIT_FIELD(clear_sky.linke_turbidity),
                           "Clear sky: Linke turbidity of the Ineichen model."),
      number<WeatherDraft>("air_mean_k", "K", between(180, 340), EMIT_FIELD(clear_sky.air_mean_k),
                           "Clear sky: daily mean of the air temperature."),
      number<WeatherDraft>(
          "air_amplitude_k", "K", between(0, 40), EMIT_FIELD(clear_sky.air_amplitude_k),
          "Clear sky: amplitude of the daily cosine, warmest at 15:00 solar time."),
      number<WeatherDraft>("dew_point_k", "K", between(180, 320), EMIT_FIELD(clear_sky.dew_point_k),
                           "Clear sky: dew point, for the sky's long-wave emissivity."),
      number<WeatherDraft>("wind_m_s", "m s-1", between(0, 100), EMIT_FIELD(clear_sky.wind_m_s),
                           "Clear sky: wind speed."),
      number<WeatherDraft>("cloud_frac", "", between(0, 1), EMIT_FIELD(clear_sky.cloud_frac),
                           "Clear sky: share of the direct sun that clouds take."),
      custom<WeatherDraft>(
          {"sample", "array of tables", "", "", "Forcing inline; see `[[weather.sample]]`.", false},
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

/// Axis of an inline atmosphere table.
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

/// Values of an inline atmosphere table: an array per elevation.
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
           "Transmittance over a range R: sum of a exp(-k R). Path radiance is (1 - tau) times "
           "that of a blackbody at air temperature.",
           false},
          [](BandAtmosphere& out, const Node& node, Diagnostics& diagnostics) {
            if (node.kind != Node::Kind::array || node.items.empty() || node.items.size() > 4) {
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
              "Ground to space at the zenith; the sky radiates (1 - tau^airmass) "
              "times a blackbody at air temperature.")),
      axis_key("range_m", "m", between(0, 1e7), EMIT_FIELD(table.range_m), 1.0,
               "In place of terms, a table (the CSV of `atmosphere.file` inline): ranges, the last "
               "one standing for the way out of the atmosphere."),
      axis_key("elevation_deg", "deg", between(-90, 90), EMIT_FIELD(table.elevation_rad), kDegree,
               "Table: elevations of the line of sight, negative looking down; a single one holds "
               "for all."),
      plane_key("transmittance_frac", "", between(0, 1), EMIT_FIELD(table.transmittance_frac),
                "Table: one row of values per elevation, one value per range."),
      plane_key("path_radiance_w_m2_sr", "W m-2 sr-1", between(0, 1e6),
                EMIT_FIELD(table.path_radiance_w_m2_sr),
                "Table: in-band radiance of the air itself, likewise."),
  };
  return keys;
}

const KeyTable<AtmosphereDraft>& atmosphere_keys() {
  static const KeyTable<AtmosphereDraft> keys = {
      boolean<AtmosphereDraft>("enabled", EMIT_FIELD(enabled),
                               "Off: transmittance 1 along every path and no path radiance."),
      choice<AtmosphereDraft>(
          "model",
          std::vector<std::pair<std::string, std::string>>{
              {"midlatitude_summer", "midlatitude_summer"},
              {"midlatitude_summer_hazy", "midlatitude_summer_hazy"},
              {"midlatitude_winter", "midlatitude_winter"},
              {"tropical", "tropical"},
              {"us_standard", "us_standard"},
              {"none", "none"}},
          EMIT_FIELD(model),
          "Built-in terms of the built-in bands: fits to LOWTRAN7, rural haze, visibility 23 km "
          "(hazy: 5 km). `none`: only what file and `[[atmosphere.band]]` give."),
      path<AtmosphereDraft>("file", EMIT_FIELD(file),
                            "CSV `band,range_m,elevation_deg,transmittance_frac,"
                            "path_radiance_w_m2_sr`: a grid of ranges and elevations per band, as "
                            "seen from the sensor; the last range stands for the way out (sky, "
                            "sun). Or `band,amplitude_frac,extinction_per_km,"
                            "vertical_transmittance_frac`, one row per exponential term. Comes "
                            "before the model; with a grid, bands it lacks need `model` written "
                            "out."),
      custom<AtmosphereDraft>(
          {"band", "array of tables", "", "",
           "Terms or a table inline; see `[[atmosphere.band]]`. Replaces file and model for its "
           "bands.",
           false},
          [](AtmosphereDraft& out, const Node& node, Diagnostics& diagnostics) {
            read_array(node, "band", band_atmosphere_keys(), BandAtmosphere{}, out.bands,
                       diagnostics);
          },
          [](const AtmosphereDraft& in) { return write_array(in.bands, band_atmosphere_keys()); }),
  };
  return keys;
}

const KeyTable<ThermalOptions>& thermal_keys() {
  static const KeyTable<ThermalOptions> keys = {
      choice<ThermalOptions>(
          "model",
          std::vector<std::pair<std::string, ThermalModel>>{{"emit2014", ThermalModel::emit2014},
                                                            {"foster", ThermalModel::foster}},
          EMIT_FIELD(model),
          "Surface model. emit2014: equilibrium of Eq. 1-6, relaxed by the modes of the material. "
          "foster: convection, sky and surroundings, and all layers as 2 to 4 flux-driven states."),
      choice<ThermalOptions>(
          "method",
          std::vector<std::pair<std::string, ThermalMethod>>{
              {"per-frame", ThermalMethod::per_frame}, {"cached", ThermalMethod::cached}},
          EMIT_FIELD(method),
          "How the history is evaluated. per-frame: all steps again for every "
          "pixel of every frame. cached: once, on samples of the surface that "
          "are carried on from interval to interval."),
      number<ThermalOptions>("tolerance_k", "K", above_to(0, 50), EMIT_FIELD(tolerance_k),
                             "Aimed-at error of surface temperatures. foster: history steps are "
                             "split until halving them changes less. cached: surfaces are "
                             "refined for it. per-frame, emit2014: not used."),
      number<ThermalOptions>("initial_k", "K", between(150, 1000), EMIT_FIELD(initial_k),
                             "Surface temperature at the start of the history."),
      nanoseconds<ThermalOptions>("history_start_s", "s", 1e9, between(-1e9, 1e9),
                                  EMIT_FIELD(history_start_ns),
                                  "Sim time from which the thermal simulation runs."),
      nanoseconds<ThermalOptions>(
          "spin_up_s", "s", 1e9, between(0, 3.2e7), EMIT_FIELD(spin_up_ns),
          "foster: unshadowed weather before the history, from a steady profile between initial_k "
          "and the base; 172800 (two days) if absent. A weather table has to reach back as far: "
          "its "
          "first row holds before. emit2014: not used."),
      text<ThermalOptions>(
          "surroundings_material", EMIT_FIELD(surroundings_material),
          "foster: what lies around where weather states no environment_k; its "
          "open, level surface sets the temperature, its reflectance the reflected "
          "sun. default_material if absent."),
      integer<ThermalOptions>("foster_modes", "", 0, 4, EMIT_FIELD(foster_modes),
                              "foster: states per material, derived from its layers. 0: its fitted "
                              "modes."),
      integer<ThermalOptions>("steps", "", 1, 4096, EMIT_FIELD(steps),
                              "History steps; one shadow map each."),
      choice<ThermalOptions>(
          "spacing",
          std::vector<std::pair<std::string, StepSpacing>>{{"geometric", StepSpacing::geometric},
                                                           {"uniform", StepSpacing::uniform}},
          EMIT_FIELD(spacing), "geometric: steps grow into the past. uniform: all alike."),
      number<ThermalOptions>(
          "first_step_s", "s", above_to(0, 86400), EMIT_FIELD(first_step_s),
          "Length of the newest step of geometric spacing; cached: of the intervals "
          "it goes on in."),
      integer<ThermalOptions>("shadow_map_px", "px", 16, 8192, EMIT_FIELD(shadow_map_px),
                              "Width and height of a shadow map."),
      integer<ThermalOptions>(
          "max_cascades", "",
          1, 4, EMIT_FIELD(max_cascades),
          "Most shadow maps per step, for scenes larger than one map resolves."),
      integer<ThermalOptions>("blocker_taps", "", 1, 64, EMIT_FIELD(blocker_taps),
                              "Samples of the search for what casts the shadow."),
      integer<ThermalOptions>("filter_taps", "", 1, 128, EMIT_FIELD(filter_taps),
                              "Samples of the soft-shadow filter."),
      number<ThermalOptions>("obscurance_radius_m", "m", above_to(0, 100),
                             EMIT_FIELD(obscurance_radius_m),
                             "per-frame: radius within which surfaces hide the sky from each "
                             "other."),
      integer<ThermalOptions>(
          "max_samples", "", 1000, 100000000, EMIT_FIELD(max_samples),
          "cached: most thermal samples, 0.5 kB each and 1 kB for the surface between them. Where "
          "meshes' own vertices would take more than half, they lose detail up to two pixels wide, "
          "and frames are flagged degraded; what is left of them is always sampled."),
      boolean<ThermalOptions>("lateral", EMIT_FIELD(lateral),
                              "cached, foster: heat is also conducted along the surface and across "
                              "convex edges. emit2014 conducts straight down."),
      boolean<ThermalOptions>("exchange", EMIT_FIELD(exchange),
                              "cached, foster: faces exchange radiation with each other; false: "
                              "they see the surroundings' temperature where others hide the sky, "
                              "as with per-frame and emit2014."),
      path<ThermalOptions>("state_file", EMIT_FIELD(state_file),
                           "cached: keeps the warmed-up surface. Written by the first run, read by "
                           "those after it; one that does not fit scene, materials, place, date, "
                           "weather, thermal options, sensor or first frame is refused."),
  };
  return keys;
}

const KeyTable<DisplayOptions>& display_keys() {
  static const KeyTable<DisplayOptions> keys = {
      number<DisplayOptions>("min_k", "K", between(0, 5000), EMIT_FIELD(min_k),
                             "Coldest temperature of the false-colour scale."),
      number<DisplayOptions>("max_k", "K", between(0, 5000), EMIT_FIELD(max_k),
                             "Warmest temperature of the false-colour scale; above min_k."),
  };
  return keys;
}

const KeyTable<BandDraft>& band_keys() {
  static const KeyTable<BandDraft> keys = {
      required(text<BandDraft>("name", EMIT_FIELD(desc.name),
                               "Name that channels and materials use. A built-in band of that name "
                               "is replaced.")),
      written_if([](const BandDraft& in) { return in.desc.lo_um > 0.0; },
                 number<BandDraft>("lo_um", "um", between(0.2, 100), EMIT_FIELD(desc.lo_um),
                                   "Short end; the first wavelength of the response if absent.")),
      written_if([](const BandDraft& in) { return in.desc.hi_um > 0.0; },
                 number<BandDraft>("hi_um", "um", between(0.2, 100), EMIT_FIELD(desc.hi_um),
                                   "Long end; the last wavelength of the response if absent.")),
      custom<BandDraft>(
          {"response", "array of [um, frac]", "um, 1", "2 or more, ascending, frac in 0 .. 1",
           "Relative spectral response, linear in between; a perfect rectangle if absent.", false},
          [](BandDraft& out, const Node& node, Diagnostics& diagnostics) {
            if (node.kind != Node::Kind::array) {
              diagnostics.add(node.at, "'response' must be an array of pairs [um, frac]");
              return;
            }
            out.desc.response.clear();
            for (const Node& item : node.items) {
              double pair[2] = {0.0, 0.0};
              read_vector(item, "response", 2, pair, diagnostics);
              out.desc.response.push_back({pair[0], pair[1]});
            }
          },
          [](const BandDraft& in) -> std::optional<std::string> {
            if (in.desc.response.empty()) {
              return std::nullopt;
            }
            std::string out = "[";
            for (const scene::ResponseSample& sample : in.desc.response) {
              const double pair[2] = {sample.wavelength_um, sample.response_frac};
              out += (out.size() > 1 ? ", " : "") + toml_vector(pair, 2);
            }
            return out + "]";
          }),
      path<BandDraft>("response_file", EMIT_FIELD(response_file),
                      "CSV `wavelength_um,response_frac` in place of `response`."),
  };
  return keys;
}

}  // namespace emit::config
