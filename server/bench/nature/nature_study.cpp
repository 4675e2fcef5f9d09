// SPDX-License-Identifier: Apache-2.0
#include "bench/nature/nature_study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>

#include "emit/physics/air_film.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/foster.hpp"

namespace emit::tool {
namespace {

using physics::Result;
using reference::LoggerRow;
using reference::PlateNumber;

constexpr std::array<PlateNumber, 2> kFitted{PlateNumber::inertia, PlateNumber::base};

/// Input with a published uncertainty. `change` moves it to its low (-1) or high (+1) end.
struct Input {
  const char* name;
  const char* range;
  const char* source;
  bool ground;  ///< a number of the ground that the fitted case fits
  void (*change)(LoggerRecord& record, MeasuredGround& ground, double sign);
};

void for_rows(LoggerRecord& record, const auto& change) {
  for (LoggerRow& row : record.rows) change(row);
}

void change_evaporation(LoggerRecord& record, MeasuredGround& /*ground*/, double sign) {
  for_rows(record, [&](LoggerRow& row) { row.evaporation_w_m2 *= 1.0 + 0.2 * sign; });
}

constexpr const char* kSurfrad = "Augustine et al., Bull. Amer. Meteor. Soc. 81 (2000): stations";
constexpr Input kInputs[] = {
    {"film of the air", "factor 1.3", "spread of published correlations (Palyvos 2008)", false,
     [](LoggerRecord&, MeasuredGround& ground, double sign) {
       ground.numbers.film_factor *= std::pow(1.3, sign);
     }},
    {"long-wave down", "9 W/m2", kSurfrad, false,
     [](LoggerRecord& record, MeasuredGround&, double sign) {
       for_rows(record, [&](LoggerRow& row) { row.longwave_down_w_m2 += 9.0 * sign; });
     }},
    {"long-wave up (the measurement)", "9 W/m2; a thermometer 0.5 K", kSurfrad, false,
     [](LoggerRecord& record, MeasuredGround&, double sign) {
       if (record.longwave_up_w_m2.empty()) {
         for_rows(record, [&](LoggerRow& row) { row.surface_k += 0.5 * sign; });
       }
       for (double& up_w_m2 : record.longwave_up_w_m2) up_w_m2 += 9.0 * sign;
     }},
    {"sun on level ground", "5 %", kSurfrad, false,
     [](LoggerRecord& record, MeasuredGround&, double sign) {
       for_rows(record, [&](LoggerRow& row) { row.sun_w_m2 *= 1.0 + 0.05 * sign; });
     }},
    {"absorptance", "0.1; 0.03 if measured", "material library; two pyranometers", false,
     [](LoggerRecord&, MeasuredGround& ground, double sign) {
       const double by_frac = ground.absorptance_measured ? 0.03 : 0.1;
       double& absorptance_frac = ground.numbers.absorptance_frac;
       absorptance_frac = std::clamp(absorptance_frac + by_frac * sign, 0.0, 1.0);
     }},
    {"emissivity", "0.03", "material library", false,
     [](LoggerRecord&, MeasuredGround& ground, double sign) {
       double& emissivity_frac = ground.numbers.emissivity_frac;
       emissivity_frac = std::clamp(emissivity_frac + 0.03 * sign, 0.05, 1.0);
     }},
    {"air", "0.5 K", "thermometer in a shield", false,
     [](LoggerRecord& record, MeasuredGround&, double sign) {
       for_rows(record, [&](LoggerRow& row) { row.air_k += 0.5 * sign; });
     }},
    {"evaporation", "20 %, if measured", "closure of eddy covariance (Wilson et al. 2002)", false,
     change_evaporation},
    {"wind", "0.5 m/s", "propeller anemometer near its threshold", false,
     [](LoggerRecord& record, MeasuredGround&, double sign) {
       for_rows(record,
                [&](LoggerRow& row) { row.wind_m_s = std::max(0.0, row.wind_m_s + 0.5 * sign); });
     }},
    {"inertia of the ground", "factor 1.4",
     "material library: moisture moves conductivity by a factor of 2", true,
     [](LoggerRecord&, MeasuredGround& ground, double sign) {
       ground.numbers.inertia_factor *= std::pow(1.4, sign);
     }},
    {"base", "4 K", "climate by latitude against eleven typical years", true,
     [](LoggerRecord&, MeasuredGround& ground, double sign) {
       ground.numbers.base_k += 4.0 * sign;
     }},
};

/// Model and measurement of one run.
struct Run {
  reference::PlateNumbers numbers;
  std::vector<double> model_k;
  std::vector<double> error_k;  ///< model less measurement
};

/// A record that does not show the numbers keeps them, and `fit_out` has no estimates.
Result<Run> run_model(const LoggerRecord& record, const MeasuredGround& ground, bool is_fitted,
                      reference::PlateFit* fit_out = nullptr) {
  Run run{ground.numbers, {}, {}};
  bool shows_numbers = false;
  if (is_fitted) {
    auto fit = reference::fit_plate(ground.setup, record.rows, ground.numbers, kFitted);
    shows_numbers = fit.has_value();
    if (shows_numbers) {
      run.numbers = fit->numbers;
      run.model_k = fit->model_k;
      if (fit_out != nullptr) *fit_out = std::move(*fit);
    }
  }
  if (!shows_numbers) {
    auto model_k = reference::plate_history_k(ground.setup, record.rows, ground.numbers);
    if (!model_k) return tl::unexpected(std::move(model_k.error()));
    run.model_k = std::move(*model_k);
  }
  run.error_k = run.model_k;
  for (std::size_t i = 0; i < run.error_k.size(); ++i) {
    run.error_k[i] -= record.rows[i].surface_k;
  }
  return run;
}

/// Returns the modes of the material: fitted ones, else those of its layers.
Result<physics::FosterNetwork> network_of(const scene::Material& material) {
  physics::FosterNetwork network;
  for (const scene::FosterMode& mode : material.foster_modes) {
    network.modes[network.count++] = {mode.tau_s, mode.resistance_m2k_w};
  }
  if (network.count > 0) return network;
  std::vector<physics::StackLayer> stack;
  for (const scene::Layer& layer : material.layers) {
    stack.push_back({layer.thickness_m, layer.conductivity_w_m_k,
                     layer.density_kg_m3 * layer.specific_heat_j_kg_k});
  }
  return physics::network_of_stack(stack);
}

/// Level ground with the step of the real-time model: states per mode, and the film of the step
/// before.
class RealTimePlate {
 public:
  RealTimePlate(const MeasuredGround& ground, const physics::FosterNetwork& network)
      : ground_(ground), network_(network) {
    const reference::PlateNumbers& n = ground.numbers;
    surface_ = physics::foster_surface(network, n.emissivity_frac, n.base_k, n.base_k);
  }
  /// Begins steady with that temperature of the surface.
  void start(double face_k) {
    states_ = physics::foster_steady(
        (face_k - ground_.numbers.base_k) / network_.resistance_m2k_w(), surface_);
  }
  void advance(const LoggerRow& begin, const LoggerRow& end, double step_s) {
    if (step_s != step_s_) gains_ = physics::foster_gains(step_s, network_);
    step_s_ = step_s;
    const double before_k = face_k();
    physics::foster_step(states_, drive(begin, before_k), drive(end, before_k), gains_, surface_);
  }
  [[nodiscard]] double face_k() const {
    return surface_.reference_k + physics::foster_offset_k(states_, surface_);
  }

 private:
  [[nodiscard]] physics::FosterDrive<double> drive(const LoggerRow& row, double before_k) const {
    const reference::PlateNumbers& n = ground_.numbers;
    const double film_w_m2_k =
        n.film_factor *
        physics::film_w_m2_k(physics::air_film(reference::air_flow(ground_.setup, row)),
                             {0.0, 0.0, 1.0}, ground_.setup.skin, before_k - row.air_k);
    physics::FosterDrive<double> out{.absorbed_w_m2 = n.absorptance_frac * row.sun_w_m2 +
                                                      n.emissivity_frac * row.longwave_down_w_m2 -
                                                      row.evaporation_w_m2,
                                     .film_w_m2_k = film_w_m2_k,
                                     .air_offset_k = row.air_k - surface_.reference_k};
    physics::add_moisture(
        ground_.setup.moisture,
        physics::moist_air(row.air_k, physics::standard_pressure_pa(ground_.setup.height_m),
                           row.vapour_pa),
        row.sun_w_m2, out);
    return out;
  }

  const MeasuredGround& ground_;
  physics::FosterNetwork network_;
  physics::FosterSurface<double> surface_;
  physics::FosterState<double> states_{};
  physics::FosterGains<double> gains_;
  double step_s_ = 0.0;
};

/// Returns the surface of the real-time model at every row, after days like the record.
Result<std::vector<double>> real_time_history_k(const LoggerRecord& record,
                                                const MeasuredGround& ground) {
  const auto network = network_of(ground.material);
  if (!network) return tl::unexpected(network.error());
  RealTimePlate plate(ground, *network);
  const std::vector<LoggerRow>& rows = record.rows;
  const double air_k =
      std::accumulate(rows.begin(), rows.end(), 0.0,
                      [](double sum, const LoggerRow& row) { return sum + row.air_k; }) /
      static_cast<double>(rows.size());
  plate.start(air_k);
  std::vector<double> out_k;
  for (std::uint32_t day = 0; day <= ground.setup.spin_up_days; ++day) {
    if (day > 0) plate.advance(rows.back(), rows.front(), rows[1].time_s - rows[0].time_s);
    out_k.assign(1, plate.face_k());
    for (std::size_t i = 1; i < rows.size(); ++i) {
      plate.advance(rows[i - 1], rows[i], rows[i].time_s - rows[i - 1].time_s);
      out_k.push_back(plate.face_k());
    }
  }
  return out_k;
}

/// Runs one case, and its changes of every input.
Result<NatureCase> study_case(const LoggerRecord& record, const MeasuredGround& ground,
                              bool is_fitted, reference::PlateFit* fit_out,
                              const std::function<void()>& on_run) {
  auto base = run_model(record, ground, is_fitted, fit_out);
  if (!base) return tl::unexpected(std::move(base.error()));
  on_run();
  NatureCase out;
  out.numbers = base->numbers;
  std::vector<double> below(base->model_k.size());
  std::vector<double> above(base->model_k.size());
  for (const Input& input : kInputs) {
    if (input.ground && is_fitted) continue;
    if (input.change == change_evaporation && !ground.measured_evaporation) {
      on_run();  // both ends count as done
      on_run();
      continue;
    }
    InputEffect effect{input.name, std::string("+-") + input.range, input.source, 0, 0, {}, {}};
    std::vector<double> lowest(below.size());
    std::vector<double> highest(below.size());
    for (const double sign : {-1.0, 1.0}) {
      LoggerRecord changed = record;
      MeasuredGround other = ground;
      if (is_fitted) other.numbers = base->numbers;
      input.change(changed, other, sign);
      set_emissivity(changed, other.numbers.emissivity_frac);
      const auto run = run_model(changed, other, is_fitted);
      if (!run) return tl::unexpected(run.error());
      on_run();
      (sign < 0.0 ? effect.low_numbers : effect.high_numbers) = run->numbers;
      double squares = 0.0;
      for (std::size_t i = 0; i < lowest.size(); ++i) {
        const double by_k = run->error_k[i] - base->error_k[i];
        lowest[i] = std::min(lowest[i], by_k);
        highest[i] = std::max(highest[i], by_k);
        squares += by_k * by_k;
        effect.max_k = std::max(effect.max_k, std::abs(by_k));
      }
      effect.rms_k =
          std::max(effect.rms_k, std::sqrt(squares / static_cast<double>(lowest.size())));
    }
    for (std::size_t i = 0; i < lowest.size(); ++i) {
      below[i] = std::hypot(below[i], lowest[i]);
      above[i] = std::hypot(above[i], highest[i]);
    }
    out.effects.push_back(std::move(effect));
  }
  std::size_t within = 0;
  for (std::size_t i = 0; i < below.size(); ++i) {
    out.low_k.push_back(base->model_k[i] - below[i]);
    out.high_k.push_back(base->model_k[i] + above[i]);
    const double measured_k = record.rows[i].surface_k;
    if (measured_k >= out.low_k[i] && measured_k <= out.high_k[i]) ++within;
  }
  out.within_frac = static_cast<double>(within) / static_cast<double>(below.size());
  out.difference = difference_of(record, base->model_k);
  out.model_k = std::move(base->model_k);
  std::ranges::sort(out.effects, std::greater{}, &InputEffect::rms_k);
  return out;
}

}  // namespace

Result<NatureDay> study_day(const std::filesystem::path& file, const LoggerOptions& record_options,
                            const GroundOptions& ground_options,
                            const std::function<void()>& on_run) {
  NatureDay day;
  auto record = read_logger(file, record_options);
  if (!record) return tl::unexpected(std::move(record.error()));
  day.record = std::move(*record);
  auto ground = measured_ground(ground_options, day.record);
  if (!ground) return tl::unexpected(std::move(ground.error()));
  day.ground = std::move(*ground);
  const auto named = [&](const physics::Error& error) {
    return tl::unexpected(
        physics::Error{error.code, fmt::format("{}: {}", file.string(), error.text)});
  };
  auto library = study_case(day.record, day.ground, false, nullptr, on_run);
  if (!library) return named(library.error());
  day.library = std::move(*library);
  auto fitted = study_case(day.record, day.ground, true, &day.fit, on_run);
  if (!fitted) return named(fitted.error());
  day.fitted = std::move(*fitted);
  if (day.fit.estimates.empty()) {
    day.record.notes.push_back(
        "inertia and base cannot be fitted: the record does not depend on them. Their figures are "
        "those of nothing fitted");
  }
  const auto real_time_k = real_time_history_k(day.record, day.ground);
  if (!real_time_k) return named(real_time_k.error());
  day.real_time = difference_of(day.record, *real_time_k);
  const auto heat = day_heat(day.record, day.ground);
  if (!heat) return named(heat.error());
  day.heat = *heat;
  day.signs = ground_signs(day.record, day.ground, day.heat);
  std::ranges::move(fit_signs(day.record, day.ground, day.fit), std::back_inserter(day.signs));
  return day;
}

std::size_t study_runs() noexcept {
  const auto of_ground = static_cast<std::size_t>(
      std::ranges::count_if(kInputs, [](const Input& input) { return input.ground; }));
  return 2 + 4 * std::size(kInputs) - 2 * of_ground;
}

}  // namespace emit::tool
