// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/accuracy/accuracy_benches.hpp"
#include "emit/physics/apparent_temperature.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/sun.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/base.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/statistics.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;
using scene::Material;
using scene::ScenarioDesc;

struct UncertaintyOptions {
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> plot;
  std::string scenario = "airfield";
  std::vector<std::string> set;
  std::optional<double> time_s;
  int gpu_index = -1;
};

void for_rows(ScenarioDesc& scenario, const auto& change) {
  for (scene::WeatherSample& row : scenario.weather) change(row);
}
void for_materials(ScenarioDesc& scenario, const auto& change) {
  for (Material& material : scenario.materials) change(material);
}

/// Half-width of a number of a material: what its source states, else `otherwise`.
double spread_of(const Material& material, double scene::MaterialSpread::*member,
                 double otherwise) {
  const double stated = material.spread ? (*material.spread).*member : 0.0;
  return stated > 0.0 ? stated : otherwise;
}

/// Input with a known uncertainty. `change` moves it to its low (-1) or high (+1) end.
struct Input {
  const char* name;
  const char* range;
  const char* source;
  void (*change)(ScenarioDesc& scenario, double sign);
};
constexpr Input kInputs[] = {
    {"film of the air", "factor 1.3", "spread of published correlations (Palyvos 2008)",
     [](ScenarioDesc& s, double sign) { s.thermal.film_factor *= std::pow(1.3, sign); }},
    {"long-wave down", "12 W/m2", "clear-sky formulas against stations (Li et al. 2017)",
     [](ScenarioDesc& s, double sign) {
       for_rows(s, [&](auto& row) { row.longwave_down_w_m2 += 12.0 * sign; });
     }},
    {"sun, direct and diffuse", "5 %", "pyranometers of a station (Augustine et al. 2000)",
     [](ScenarioDesc& s, double sign) {
       for_rows(s, [&](auto& row) {
         row.direct_normal_w_m2 *= 1.0 + 0.05 * sign;
         row.diffuse_horizontal_w_m2 *= 1.0 + 0.05 * sign;
       });
     }},
    {"air temperature", "1 K", "a station at some distance",
     [](ScenarioDesc& s, double sign) { for_rows(s, [&](auto& row) { row.air_k += sign; }); }},
    {"wind", "0.5 m/s", "anemometer near its threshold",
     [](ScenarioDesc& s, double sign) {
       for_rows(s, [&](auto& row) { row.wind_m_s = std::max(0.0, row.wind_m_s + 0.5 * sign); });
     }},
    {"humidity", "0.1", "a station at some distance",
     [](ScenarioDesc& s, double sign) {
       for_rows(s, [&](auto& row) {
         row.relative_humidity_frac =
             std::clamp(row.relative_humidity_frac.value_or(0.6) + 0.1 * sign, 0.0, 1.0);
       });
     }},
    {"absorptance", "of the library, else 0.05", "material library",
     [](ScenarioDesc& s, double sign) {
       for_materials(s, [&](Material& m) {
         m.solar_absorptance_frac = std::clamp(
             m.solar_absorptance_frac +
                 sign * spread_of(m, &scene::MaterialSpread::solar_absorptance_frac, 0.05),
             0.0, 1.0);
       });
     }},
    {"emissivity, total and in band", "of the library, else 0.03", "material library",
     [](ScenarioDesc& s, double sign) {
       for_materials(s, [&](Material& m) {
         const double total = spread_of(m, &scene::MaterialSpread::emissivity_frac, 0.03);
         m.emissivity_frac = std::clamp(m.emissivity_frac + sign * total, 0.02, 1.0);
         for (scene::BandEmissivity& band : m.band_emissivity) {
           double own = total;
           if (m.spread) {
             for (const scene::BandEmissivity& stated : m.spread->band_emissivity) {
               if (stated.band == band.band) own = stated.emissivity_frac;
             }
           }
           band.emissivity_frac = std::clamp(band.emissivity_frac + sign * own, 0.02, 1.0);
         }
       });
     }},
    {"conductivity", "of the library, else 20 %", "material library",
     [](ScenarioDesc& s, double sign) {
       for_materials(s, [&](Material& m) {
         const double by = spread_of(m, &scene::MaterialSpread::conductivity_frac, 0.2);
         for (scene::Layer& layer : m.layers) layer.conductivity_w_m_k *= std::pow(1.0 + by, sign);
       });
     }},
    {"heat capacity", "of the library, else 10 %", "material library",
     [](ScenarioDesc& s, double sign) {
       for_materials(s, [&](Material& m) {
         const double by = spread_of(m, &scene::MaterialSpread::heat_capacity_frac, 0.1);
         for (scene::Layer& layer : m.layers)
           layer.specific_heat_j_kg_k *= std::pow(1.0 + by, sign);
       });
     }},
    {"deep ground", "4 K", "climate by latitude against eleven typical years",
     [](ScenarioDesc& s, double sign) {
       for_materials(s, [&](Material& m) {
         if (m.base == scene::BaseKind::ground) m.base_k += 4.0 * sign;
       });
     }},
    {"water vapour of the air", "20 %", "climate against a day's sounding",
     [](ScenarioDesc& s, double sign) {
       for (scene::BandAtmosphere& band : s.atmosphere.bands) {
         if (band.model) {
           band.model->water_ratio = std::min(5.0, band.model->water_ratio * std::pow(1.2, sign));
         }
       }
     }},
};

/// Turns the clear-sky models of a scenario into a table of weather that ends at an instant, so
/// that every number of it can be changed. Modes of materials follow from their layers for the same
/// reason.
void make_changeable(ScenarioDesc& scenario, std::int64_t end_ns) {
  scenario.thermal.state_file.clear();
  for_materials(scenario, [](Material& m) {
    if (m.layers.empty()) return;
    m.foster_modes.clear();
    m.foster_fit.reset();
  });
  if (!scenario.weather.empty()) {
    // Rows without humidity have that of the usual dew point.
    const double dew_point_k = scene::usual_dew_point_k(scenario);
    for_rows(scenario, [&](scene::WeatherSample& row) {
      if (row.relative_humidity_frac) return;
      row.relative_humidity_frac =
          physics::saturation_over_water_pa(std::min(dew_point_k, row.air_k)) /
          physics::saturation_over_water_pa(row.air_k);
    });
    return;
  }
  constexpr std::int64_t kStepNs = 600'000'000'000;
  const physics::GeoPlace place{physics::Radians(scenario.place.lat_rad),
                                physics::Radians(scenario.place.lon_rad),
                                physics::Metres(scenario.place.height_m)};
  const std::int64_t start_ns = scenario.thermal.history_start_ns - scenario.thermal.spin_up_ns;
  for (std::int64_t t = start_ns; t < end_ns + kStepNs; t += kStepNs) {
    const std::int64_t utc_ns = scenario.epoch_utc_ns + t;
    const physics::Forcing now = physics::forcing_from_clear_sky(
        scenario.clear_sky, place, physics::sun_position(utc_ns, place), utc_ns);
    scene::WeatherSample row;
    row.sim_time_ns = t;
    row.direct_normal_w_m2 = now.direct_normal_w_m2;
    row.diffuse_horizontal_w_m2 = now.diffuse_horizontal_w_m2;
    row.longwave_down_w_m2 = now.longwave_down_w_m2;
    row.air_k = now.air_k;
    row.wind_m_s = now.wind_m_s;
    row.cloud_frac = now.cloud_frac;
    row.wind_from_rad = scenario.clear_sky.wind_from_rad;
    row.relative_humidity_frac =
        std::min(1.0, now.vapour_pa / physics::saturation_over_water_pa(now.air_k));
    scenario.weather.push_back(row);
  }
}

/// Apparent temperatures of the surfaces of a picture, by band; NaN for sky.
struct Picture {
  std::vector<std::vector<float>> apparent_k;
  std::string device;
};

Result<Picture> picture_of(const ScenarioDesc& scenario, std::int64_t time_ns, int gpu_index) {
  renderer::OutputOptions output;
  output.depth = true;
  auto made = renderer::Renderer::create(scenario, {.gpu_index = gpu_index}, output);
  if (!made) return tl::unexpected(std::move(made.error()));
  renderer::Renderer& renderer = **made;
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = time_ns;
  request.sensor_pose = renderer.scenario_sensor_pose_at(time_ns);
  const auto going = [](double) { return !InterruptGuard::interrupted(); };
  if (auto ready = renderer.warm_up(request, going); !ready) {
    return tl::unexpected(std::move(ready.error()));
  }
  const int slot = renderer.submit(request);
  const renderer::FrameView& view = renderer.collect(static_cast<renderer::SlotIndex>(slot));
  if (view.device_failed) return make_error(ErrorCode::gpu, "the device failed");
  Picture out;
  out.device = renderer.device_name();
  for (std::size_t b = 0; b < scenario.bands.size(); ++b) {
    const physics::ApparentTemperature table(scene::spectral_band(scenario.bands[b]));
    std::vector<float>& k = out.apparent_k.emplace_back();
    for (std::size_t i = 0; i < view.depth_m.size(); ++i) {
      k.push_back(std::isfinite(view.depth_m[i]) ? table.k(view.radiance_w_m2_sr[b][i])
                                                 : std::numeric_limits<float>::quiet_NaN());
    }
  }
  renderer.release(static_cast<renderer::SlotIndex>(slot));
  return out;
}

/// Difference of two pictures over surfaces that both show, K.
struct Shift {
  double mean_k = 0.0;
  double rms_k = 0.0;
  double p99_k = 0.0;
};
Shift shift_of(const std::vector<float>& base_k, const std::vector<float>& changed_k) {
  Samples sizes_k;
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < base_k.size(); ++i) {
    const double difference_k = double{changed_k[i]} - base_k[i];
    if (std::isnan(difference_k)) continue;
    sizes_k.add(std::abs(difference_k));
    sum += difference_k;
    squares += difference_k * difference_k;
  }
  if (sizes_k.count() == 0) return {};
  const auto count = static_cast<double>(sizes_k.count());
  return {sum / count, std::sqrt(squares / count), sizes_k.percentile(0.99)};
}

/// Effect of an input in one band, at its low and its high end.
struct Effect {
  const Input* input;
  Shift low;
  Shift high;
  [[nodiscard]] double rms_k() const { return std::max(low.rms_k, high.rms_k); }
  /// False if the scenario has nothing that the input could change.
  [[nodiscard]] bool acts() const { return rms_k() > 0.0; }
};

/// All effects of a band, the largest first.
struct BandEffects {
  std::string band;
  std::vector<Effect> effects;
  [[nodiscard]] double all_k() const {
    double squares = 0.0;
    for (const Effect& effect : effects) squares += effect.rms_k() * effect.rms_k();
    return std::sqrt(squares);
  }
};

Result<std::vector<BandEffects>> study(const UncertaintyOptions& options, double& time_s,
                                       std::string& device) {
  auto base = load_scenario_choice({options.scenario, options.set});
  if (!base) return tl::unexpected(std::move(base.error()));
  if (base->thermal.model != scene::ThermalModel::foster) {
    return make_error(
        ErrorCode::config,
        "bench uncertainty needs thermal.model = \"foster\": the model emit2014 takes "
        "no film and no deep ground");
  }
  const std::int64_t time_ns = options.time_s
                                   ? static_cast<std::int64_t>(std::llround(*options.time_s * 1e9))
                                   : observation_ns(*base);
  time_s = static_cast<double>(time_ns) * 1e-9;
  make_changeable(*base, time_ns);
  Progress progress("bench uncertainty", 2 * std::size(kInputs) + 1);
  std::uint64_t done = 0;
  const auto plain = picture_of(*base, time_ns, options.gpu_index);
  if (!plain) return tl::unexpected(plain.error());
  device = plain->device;
  progress.advance_to(++done);
  std::vector<BandEffects> bands;
  for (const scene::SpectralBand& band : base->bands) bands.push_back({band.name, {}});
  for (const Input& input : kInputs) {
    std::vector<Effect> effects(bands.size(), Effect{&input, {}, {}});
    for (const double sign : {-1.0, 1.0}) {
      ScenarioDesc changed = *base;
      input.change(changed, sign);
      const auto picture = picture_of(changed, time_ns, options.gpu_index);
      if (!picture) return tl::unexpected(picture.error());
      for (std::size_t b = 0; b < bands.size(); ++b) {
        Shift& shift = sign < 0.0 ? effects[b].low : effects[b].high;
        shift = shift_of(plain->apparent_k[b], picture->apparent_k[b]);
      }
      progress.advance_to(++done);
    }
    for (std::size_t b = 0; b < bands.size(); ++b) bands[b].effects.push_back(effects[b]);
  }
  for (BandEffects& band : bands) {
    std::ranges::stable_sort(band.effects, std::greater{}, &Effect::rms_k);
  }
  return bands;
}

/// Bars of an input from its low to its high end, the largest first.
Tornado tornado_of(const UncertaintyOptions& options, double time_s, const BandEffects& band) {
  Tornado tornado{.title = fmt::format("{} at {:g} s, {} um: {:.2f} K RMS in all", options.scenario,
                                       time_s, band.band, band.all_k()),
                  .label = "mean shift of the surfaces, K; at the right the RMS over the picture",
                  .bars = {}};
  for (const Effect& effect : band.effects) {
    if (!effect.acts()) continue;
    tornado.bars.push_back(
        {.label = effect.input->name,
         .title = fmt::format("{}, {}: {:+.2f} to {:+.2f} K", effect.input->name,
                              effect.input->range, effect.low.mean_k, effect.high.mean_k),
         .at_low = effect.low.mean_k,
         .at_high = effect.high.mean_k,
         .note = fmt::format("{:.2f} K", effect.rms_k())});
  }
  return tornado;
}

/// One input in one band. `low` and `high` name the ends of its range, and `delta_low_k` and
/// `delta_high_k` are the mean shifts of the surfaces there; an input without effect shifts
/// nothing.
Json effect_json(const BandEffects& band, const Effect& effect) {
  const Input& input = *effect.input;
  return Json::object()
      .set("band", band.band)
      .set("input", input.name)
      .set("range", input.range)
      .set("source", input.source)
      .set("acts", effect.acts())
      .set("low", fmt::format("low end: {}", input.range))
      .set("high", fmt::format("high end: {}", input.range))
      .set("delta_low_k", effect.low.mean_k)
      .set("delta_high_k", effect.high.mean_k)
      .set("rms_low_k", effect.low.rms_k)
      .set("rms_high_k", effect.high.rms_k)
      .set("p99_low_k", effect.low.p99_k)
      .set("p99_high_k", effect.high.p99_k)
      .set("all_inputs_rms_k", band.all_k());
}

int run(const UncertaintyOptions& options) {
  const InterruptGuard interrupt;
  double time_s = 0.0;
  std::string device;
  const auto bands = study(options, time_s, device);
  if (!bands) return fail(bands.error());
  std::FILE* text = text_stream(options.json);
  fmt::print(text, "{} at {:g} s, {}, commit {}\n", options.scenario, time_s, device, kCommit);
  Json results = Json::array();
  std::vector<Tornado> plots;
  for (const BandEffects& band : *bands) {
    TextTable table({"input", "range", "mean low K", "mean high K", "rms K", "p99 K"});
    for (const Effect& effect : band.effects) {
      results.push(effect_json(band, effect));
      if (!effect.acts()) {
        table.add({effect.input->name, effect.input->range, "no effect", "", "", ""});
        continue;
      }
      table.add({effect.input->name, effect.input->range, fmt::format("{:+.2f}", effect.low.mean_k),
                 fmt::format("{:+.2f}", effect.high.mean_k), fmt::format("{:.2f}", effect.rms_k()),
                 fmt::format("{:.2f}", std::max(effect.low.p99_k, effect.high.p99_k))});
    }
    fmt::print(text, "\nband {}, all inputs in squares {:.2f} K RMS\n{}", band.band, band.all_k(),
               table.to_string());
    plots.push_back(tornado_of(options, time_s, band));
  }
  if (options.plot) {
    if (auto written = write_svg(*options.plot, plots); !written) return fail(written.error());
  }
  if (!options.json) return kExitOk;
  Json json = Json::object();
  json.set("device", device).set("commit", kCommit).set("suite", "uncertainty");
  json.set("scenario", options.scenario).set("time_s", time_s).set("results", std::move(results));
  if (auto written = write_json(*options.json, json); !written) return fail(written.error());
  return kExitOk;
}

void add_options(CommandLine& line, UncertaintyOptions& options) {
  line.option("scenario", options.scenario, "Shipped scenario (airfield, box, ...) or a .toml file")
      .show_default();
  add_set(line, options.set);
  line.option("--time-s", options.time_s,
              "Simulation time of the picture, s; default: the start of the camera's way");
  add_gpu(line, options.gpu_index);
  line.output_file("--plot", options.plot, "Tornado plot by band, as SVG");
  add_json(line, options.json);
}

}  // namespace

void add_bench_uncertainty(CommandLine& bench) {
  bench.command<UncertaintyOptions>(
      {.name = "uncertainty",
       .text = "What the uncertainty of weather, materials and air does to a picture: every input "
               "at both ends of its range, with a tornado plot",
       .example = "emit bench uncertainty block-on-road --plot tornado.svg"},
      add_options, run);
}

}  // namespace emit::tool
