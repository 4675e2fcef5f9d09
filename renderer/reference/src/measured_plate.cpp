// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/measured_plate.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "emit/physics/air_film.hpp"
#include "emit/physics/climate/gusts.hpp"
#include "emit/physics/constants.hpp"
#include "emit/reference/layer_mesh.hpp"
#include "emit/reference/layer_solver.hpp"
#include "emit/reference/surface_forcing.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kDayS = 86'400.0;
constexpr double kShortestS = 72'000.0;
constexpr std::size_t kFewestRows = 20;
/// Longest time step. Equal steps make the temperature a smooth function of the numbers.
constexpr double kStepS = 600.0;

/// Ranges of the numbers in a fit, and the steps of its derivatives.
struct Range {
  double low;
  double high;
  double step;
  const char* name;
};
constexpr std::array<Range, 4> kRanges{{{0.0, 1.0, 0.01, "absorptance"},
                                        {0.05, 20.0, 0.02, "inertia"},
                                        {0.05, 20.0, 0.02, "film"},
                                        {150.0, 400.0, 1.0, "base"}}};

/// Returns the film of level ground, W m-2 K-1, before its factor.
double level_film_w_m2_k(const physics::AirFilm& film, const physics::FilmSkin& skin,
                         double excess_k) {
  return physics::film_w_m2_k(film, glm::dvec3(0.0, 0.0, 1.0), skin, excess_k);
}

/// Face under the weather between two rows.
class PlateFace final : public FaceModel {
 public:
  PlateFace(const PlateNumbers& numbers, const PlateSetup& setup)
      : numbers_(&numbers),
        skin_(setup.skin),
        moisture_(setup.moisture),
        pressure_pa_(physics::standard_pressure_pa(setup.height_m)) {}
  void between(const LoggerRow& a, const physics::AirFilm& a_air, const LoggerRow& b,
               const physics::AirFilm& b_air, double start_s, double end_s) {
    a_ = &a;
    b_ = &b;
    a_air_ = &a_air;
    b_air_ = &b_air;
    start_s_ = start_s;
    end_s_ = end_s;
  }
  [[nodiscard]] FaceFlux at(double time_s, double face_k) const noexcept override {
    const double f = std::clamp((time_s - start_s_) / (end_s_ - start_s_), 0.0, 1.0);
    const auto mix = [&](double LoggerRow::*m) { return std::lerp(a_->*m, b_->*m, f); };
    const double excess_k = face_k - mix(&LoggerRow::air_k);
    constexpr double kSmallK = 0.01;
    const double film_w_m2_k = film_at(f, excess_k);
    const double rise = (film_at(f, excess_k + kSmallK) - film_w_m2_k) / kSmallK;
    const double latent_w_m2 = latent_at(f, face_k, film_w_m2_k);
    const double latent_rise =
        (latent_at(f, face_k + kSmallK, film_at(f, excess_k + kSmallK)) - latent_w_m2) / kSmallK;
    const double black =
        numbers_->emissivity_frac * physics::kStefanBoltzmannWPerM2K4 * face_k * face_k * face_k;
    return {numbers_->absorptance_frac * mix(&LoggerRow::sun_w_m2) +
                numbers_->emissivity_frac * mix(&LoggerRow::longwave_down_w_m2) - black * face_k -
                film_w_m2_k * excess_k - latent_w_m2 - mix(&LoggerRow::evaporation_w_m2),
            -4.0 * black - film_w_m2_k - rise * excess_k - latent_rise};
  }

 private:
  [[nodiscard]] double film_at(double f, double excess_k) const noexcept {
    return numbers_->film_factor *
           level_film_w_m2_k(physics::between_films(*a_air_, *b_air_, f), skin_, excess_k);
  }
  [[nodiscard]] double latent_at(double f, double face_k, double film_w_m2_k) const noexcept {
    if (moisture_.dry() || !(film_w_m2_k > 0.0)) return 0.0;
    const auto mix = [&](double LoggerRow::*m) { return std::lerp(a_->*m, b_->*m, f); };
    const FaceMoisture face{
        .vapour_pa = mix(&LoggerRow::vapour_pa),
        .pressure_pa = pressure_pa_,
        .wetness_frac = moisture_.wetness_frac,
        .resistance_s_m = light_resistance_s_m(moisture_, mix(&LoggerRow::sun_w_m2))};
    return face.latent_w_m2(face_k, mix(&LoggerRow::air_k), film_w_m2_k);
  }
  const PlateNumbers* numbers_;
  physics::FilmSkin skin_;
  physics::MoistSurface moisture_;
  double pressure_pa_;
  double start_s_ = 0.0;
  double end_s_ = 1.0;
  const LoggerRow* a_ = nullptr;
  const LoggerRow* b_ = nullptr;
  const physics::AirFilm* a_air_ = nullptr;
  const physics::AirFilm* b_air_ = nullptr;
};

Result<void> check(const PlateSetup& setup, std::span<const LoggerRow> rows) {
  const auto wrong = [](const std::string& text) {
    return make_error(ErrorCode::invalid_argument, text);
  };
  if (setup.layers.empty()) return wrong("the material has no layers");
  if (rows.size() < kFewestRows) {
    return wrong(fmt::format("{} rows, at least {} are needed", rows.size(), kFewestRows));
  }
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (rows[i].time_s > rows[i - 1].time_s) continue;
    return wrong(fmt::format("time_s does not ascend at row {} ({} s)", i + 1, rows[i].time_s));
  }
  const double length_s = rows.back().time_s - rows.front().time_s;
  if (length_s >= kShortestS) return {};
  return wrong(fmt::format("the record covers {:.1f} h, at least {:g} h are needed",
                           length_s / 3600.0, kShortestS / 3600.0));
}

Result<void> check(const PlateNumbers& numbers) {
  PlateNumbers copy = numbers;
  for (const PlateNumber which :
       {PlateNumber::absorptance, PlateNumber::inertia, PlateNumber::film, PlateNumber::base}) {
    const Range& range = kRanges[static_cast<std::size_t>(which)];
    const double value = value_of(copy, which);
    if (value >= range.low && value <= range.high) continue;
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("{} is {}, must be {} .. {}", range.name, value, range.low, range.high));
  }
  if (numbers.emissivity_frac > 0.0 && numbers.emissivity_frac <= 1.0) return {};
  return make_error(
      ErrorCode::invalid_argument,
      fmt::format("emissivity is {}, must be above 0 and at most 1", numbers.emissivity_frac));
}

std::vector<physics::AirFilm> airs_of(const PlateSetup& setup, std::span<const LoggerRow> rows) {
  std::vector<physics::AirFilm> airs;
  airs.reserve(rows.size());
  for (const LoggerRow& row : rows) airs.push_back(physics::air_film(air_flow(setup, row)));
  return airs;
}

/// Ground whose first day is repeated before the record.
///
/// `advance(solver, i, j, shift_s)` brings the solver from row i to row j; the times of the rows
/// are moved by `shift_s`, and a day that is repeated goes from its last row to row 0. `at_row(i)`
/// is called at every row of the record itself.
/// @pre both checks passed
Result<void> run_days(const PlateSetup& setup, std::span<const LoggerRow> rows,
                      const PlateNumbers& numbers, const auto& advance, const auto& at_row) {
  std::vector<SolidLayer> layers = solid_layers(setup.layers);
  for (SolidLayer& layer : layers) {
    layer.conductivity_w_m_k *= numbers.inertia_factor;
    layer.heat_capacity_j_m3_k *= numbers.inertia_factor;
  }
  const auto mesh = LayerMesh::build(layers, {BaseKind::fixed_temperature, numbers.base_k},
                                     {.shortest_time_s = 60.0});
  if (!mesh) return tl::unexpected(mesh.error());
  const double start_s = rows.front().time_s;
  std::size_t day_rows = 1;
  while (day_rows < rows.size() && rows[day_rows].time_s <= start_s + kDayS) ++day_rows;
  double air_k = 0.0;
  for (std::size_t i = 0; i < day_rows; ++i) air_k += rows[i].air_k;
  air_k /= static_cast<double>(day_rows);
  // The step from the end of a day to its beginning is as long as its first one.
  const double cycle_s = rows[day_rows - 1].time_s - start_s + (rows[1].time_s - start_s);

  LayerSolver solver(*mesh, {.fixed_step_s = kStepS});
  solver.start(steady_profile(layers, air_k, numbers.base_k),
               start_s - cycle_s * setup.spin_up_days);
  for (std::uint32_t day = setup.spin_up_days; day > 0; --day) {
    const double shift_s = -cycle_s * day;
    for (std::size_t i = 1; i < day_rows; ++i) advance(solver, i - 1, i, shift_s);
    advance(solver, day_rows - 1, 0, shift_s + cycle_s);
  }
  at_row(solver, 0);
  for (std::size_t i = 1; i < rows.size(); ++i) {
    advance(solver, i - 1, i, 0.0);
    at_row(solver, i);
  }
  return {};
}

/// @pre both checks passed
Result<std::vector<double>> run_plate(const PlateSetup& setup, std::span<const LoggerRow> rows,
                                      std::span<const physics::AirFilm> airs,
                                      const PlateNumbers& numbers) {
  PlateFace face(numbers, setup);
  std::vector<double> out_k;
  out_k.reserve(rows.size());
  auto done = run_days(
      setup, rows, numbers,
      [&](LayerSolver& solver, std::size_t i, std::size_t j, double shift_s) {
        face.between(rows[i], airs[i], rows[j], airs[j], solver.time_s(), rows[j].time_s + shift_s);
        solver.advance(rows[j].time_s + shift_s, face);
      },
      [&](const LayerSolver& solver, std::size_t) { out_k.push_back(solver.face_k()); });
  if (!done) return tl::unexpected(std::move(done.error()));
  return out_k;
}

/// Returns the number of rows over which residuals are correlated, at least 1: one and twice the
/// sum of their autocorrelations up to the first that is not positive.
double correlation_rows(const Eigen::VectorXd& residuals) {
  const Eigen::VectorXd centred = residuals.array() - residuals.mean();
  const double variance = centred.squaredNorm();
  if (variance <= 0.0) return 1.0;
  double sum = 1.0;
  for (Eigen::Index lag = 1; lag < centred.size() / 2; ++lag) {
    const double together =
        centred.head(centred.size() - lag).dot(centred.tail(centred.size() - lag)) / variance;
    if (together <= 0.0) break;
    sum += 2.0 * together;
  }
  return sum;
}

/// Returns the quantile of Student's distribution for the two-sided 99 % interval of `count`
/// numbers together, by the normal quantile and its expansion in 1 / freedom.
double quantile_99(std::size_t count, double freedom) {
  // Normal quantiles at 1 - 0.005 / count.
  constexpr std::array<double, 4> kNormal{2.575829, 2.807034, 2.935199, 3.023341};
  const double z = kNormal[count - 1];
  const double z2 = z * z;
  return z * (1.0 + (z2 + 1.0) / (4.0 * freedom) +
              ((5.0 * z2 + 16.0) * z2 + 3.0) / (96.0 * freedom * freedom) +
              (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / (384.0 * std::pow(freedom, 3.0)));
}

/// Least squares of the numbers that are free.
class Search {
 public:
  Search(const PlateSetup& setup, std::span<const LoggerRow> rows,
         std::span<const PlateNumber> free)
      : setup_(setup),
        rows_(rows),
        free_(free),
        airs_(airs_of(setup, rows)),
        count_(static_cast<Eigen::Index>(free.size())) {}

  Result<PlateFit> run(const PlateNumbers& start) {
    PlateFit fit;
    fit.numbers = start;
    auto residuals = residuals_at(fit.numbers);
    if (!residuals) return tl::unexpected(residuals.error());
    Eigen::MatrixXd slopes;
    double damping = 1e-3;
    constexpr std::uint32_t kMostIterations = 50;
    constexpr double kSmallStep = 1e-4;
    constexpr double kSmallGain = 1e-9;
    while (fit.iterations < kMostIterations && !fit.converged) {
      ++fit.iterations;
      auto found = slopes_at(fit.numbers, *residuals);
      if (!found) return tl::unexpected(found.error());
      slopes = std::move(*found);
      const Eigen::MatrixXd normal = slopes.transpose() * slopes;
      for (Eigen::Index k = 0; k < count_; ++k) {
        if (normal(k, k) > 1e-12 * static_cast<double>(rows_.size())) continue;
        return make_error(ErrorCode::invalid_argument,
                          fmt::format("the record does not depend on the {}", name(k)));
      }
      bool better = false;
      while (!better && damping < 1e8) {
        Eigen::MatrixXd damped = normal;
        damped.diagonal() *= 1.0 + damping;
        const Eigen::VectorXd step = damped.ldlt().solve(-slopes.transpose() * *residuals);
        const PlateNumbers next = moved(fit.numbers, step);
        auto after = residuals_at(next);
        if (!after) return tl::unexpected(after.error());
        better = after->squaredNorm() <= residuals->squaredNorm();
        if (!better) {
          damping *= 8.0;
          continue;
        }
        // The step stays long at an end of a range, where nothing moves.
        fit.converged =
            step.cwiseAbs().maxCoeff() < kSmallStep ||
            residuals->squaredNorm() - after->squaredNorm() < kSmallGain * residuals->squaredNorm();
        fit.numbers = next;
        *residuals = std::move(*after);
        damping = std::max(damping / 8.0, 1e-9);
      }
      // No step makes the sum of squares smaller: this is the optimum to rounding.
      if (!better) fit.converged = true;
    }
    auto found = slopes_at(fit.numbers, *residuals);
    if (!found) return tl::unexpected(found.error());
    if (auto done = judge(*residuals, *found, fit); !done) return tl::unexpected(done.error());
    return fit;
  }

 private:
  [[nodiscard]] const Range& range(Eigen::Index k) const {
    return kRanges[static_cast<std::size_t>(free_[static_cast<std::size_t>(k)])];
  }
  [[nodiscard]] const char* name(Eigen::Index k) const { return range(k).name; }
  /// A unit of a number in the search: its own, or the logarithm of a factor.
  [[nodiscard]] bool is_factor(Eigen::Index k) const {
    const PlateNumber which = free_[static_cast<std::size_t>(k)];
    return which == PlateNumber::inertia || which == PlateNumber::film;
  }
  [[nodiscard]] PlateNumbers moved(const PlateNumbers& from, const Eigen::VectorXd& steps) const {
    PlateNumbers out = from;
    for (Eigen::Index k = 0; k < count_; ++k) {
      double& value = value_of(out, free_[static_cast<std::size_t>(k)]);
      const double step = std::clamp(steps[k], -50.0, 50.0) * range(k).step;
      value = is_factor(k) ? value * std::exp(step) : value + step;
      value = std::clamp(value, range(k).low, range(k).high);
    }
    return out;
  }
  Result<Eigen::VectorXd> residuals_at(const PlateNumbers& numbers) const {
    const auto model_k = run_plate(setup_, rows_, airs_, numbers);
    if (!model_k) return tl::unexpected(model_k.error());
    Eigen::VectorXd out(static_cast<Eigen::Index>(rows_.size()));
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      out[static_cast<Eigen::Index>(i)] = (*model_k)[i] - rows_[i].surface_k;
    }
    return out;
  }
  /// Derivatives in units of the ranges' steps.
  Result<Eigen::MatrixXd> slopes_at(const PlateNumbers& numbers,
                                    const Eigen::VectorXd& residuals) const {
    Eigen::MatrixXd out(residuals.size(), count_);
    for (Eigen::Index k = 0; k < count_; ++k) {
      Eigen::VectorXd step = Eigen::VectorXd::Zero(count_);
      PlateNumbers copy = numbers;
      const double value = value_of(copy, free_[static_cast<std::size_t>(k)]);
      // Step down at the upper end of a range.
      const double by = value + range(k).step > range(k).high ? -0.1 : 0.1;
      step[k] = by;
      const auto there = residuals_at(moved(numbers, step));
      if (!there) return tl::unexpected(there.error());
      out.col(k) = (*there - residuals) / by;
    }
    return out;
  }
  Result<void> judge(const Eigen::VectorXd& residuals, const Eigen::MatrixXd& slopes,
                     PlateFit& fit) const {
    const auto rows = static_cast<double>(rows_.size());
    fit.rms_k = std::sqrt(residuals.squaredNorm() / rows);
    fit.bias_k = residuals.mean();
    fit.max_k = residuals.cwiseAbs().maxCoeff();
    fit.model_k.reserve(rows_.size());
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      fit.model_k.push_back(rows_[i].surface_k + residuals[static_cast<Eigen::Index>(i)]);
    }
    const double correlated = correlation_rows(residuals);
    fit.independent_rows = rows / correlated;
    const double freedom = std::max(2.0, fit.independent_rows - static_cast<double>(count_));
    const double variance =
        residuals.squaredNorm() / rows * correlated * fit.independent_rows / freedom;
    const Eigen::LDLT<Eigen::MatrixXd> normal((slopes.transpose() * slopes).eval());
    const Eigen::MatrixXd inverse = normal.solve(Eigen::MatrixXd::Identity(count_, count_));
    const double quantile = quantile_99(free_.size(), freedom);
    PlateNumbers numbers = fit.numbers;
    for (Eigen::Index k = 0; k < count_; ++k) {
      if (!(inverse(k, k) > 0.0) || !std::isfinite(inverse(k, k))) {
        return make_error(ErrorCode::invalid_argument,
                          fmt::format("the record does not determine the {}", name(k)));
      }
      const double error = std::sqrt(variance * inverse(k, k)) * range(k).step;
      const double half = quantile * error;
      const PlateNumber which = free_[static_cast<std::size_t>(k)];
      const double value = value_of(numbers, which);
      const PlateRange kept = range_of(which);
      const double low = is_factor(k) ? value * std::exp(-half) : value - half;
      const double high = is_factor(k) ? value * std::exp(half) : value + half;
      fit.estimates.push_back({which, value, is_factor(k) ? value * error : error,
                               std::max(kept.low, low), std::min(kept.high, high)});
    }
    return {};
  }

  const PlateSetup& setup_;
  std::span<const LoggerRow> rows_;
  std::span<const PlateNumber> free_;
  std::vector<physics::AirFilm> airs_;
  Eigen::Index count_;
};

}  // namespace

double& value_of(PlateNumbers& numbers, PlateNumber which) noexcept {
  switch (which) {
    case PlateNumber::absorptance:
      return numbers.absorptance_frac;
    case PlateNumber::inertia:
      return numbers.inertia_factor;
    case PlateNumber::film:
      return numbers.film_factor;
    case PlateNumber::base:
      break;
  }
  return numbers.base_k;
}

PlateRange range_of(PlateNumber which) noexcept {
  const Range& range = kRanges[static_cast<std::size_t>(which)];
  return {range.low, range.high};
}

const char* name_of(PlateNumber which) noexcept {
  return kRanges[static_cast<std::size_t>(which)].name;
}

Result<std::vector<double>> plate_history_k(const PlateSetup& setup,
                                            std::span<const LoggerRow> rows,
                                            const PlateNumbers& numbers) {
  if (auto good = check(setup, rows); !good) return tl::unexpected(good.error());
  if (auto good = check(numbers); !good) return tl::unexpected(good.error());
  return run_plate(setup, rows, airs_of(setup, rows), numbers);
}

Result<std::vector<double>> ground_heat_w_m2(const PlateSetup& setup,
                                             std::span<const LoggerRow> rows,
                                             const PlateNumbers& numbers) {
  if (auto good = check(setup, rows); !good) return tl::unexpected(good.error());
  if (auto good = check(numbers); !good) return tl::unexpected(good.error());
  std::vector<double> heat_j_m2;    // less what leaves by the base
  std::vector<double> leaves_w_m2;  // by the base
  std::vector<double> nodes_k;
  auto done = run_days(
      setup, rows, numbers,
      [&](LayerSolver& solver, std::size_t i, std::size_t j, double shift_s) {
        solver.advance_held(rows[j].time_s + shift_s, rows[i].surface_k, rows[j].surface_k);
      },
      [&](const LayerSolver& solver, std::size_t) {
        const LayerMesh& mesh = solver.mesh();
        nodes_k.resize(mesh.nodes());
        solver.copy_nodes_k(nodes_k);
        heat_j_m2.push_back(solver.heat_in_j_m2());
        leaves_w_m2.push_back(mesh.conductance_w_m2_k().back() *
                              (nodes_k[nodes_k.size() - 2] - nodes_k.back()));
      });
  if (!done) return tl::unexpected(std::move(done.error()));
  std::vector<double> out_w_m2(rows.size());
  for (std::size_t i = 1; i < rows.size(); ++i) {
    out_w_m2[i] = (heat_j_m2[i] - heat_j_m2[i - 1]) / (rows[i].time_s - rows[i - 1].time_s) +
                  0.5 * (leaves_w_m2[i - 1] + leaves_w_m2[i]);
  }
  out_w_m2[0] = out_w_m2[1];
  return out_w_m2;
}

physics::AirFlow air_flow(const PlateSetup& setup, const LoggerRow& row) noexcept {
  physics::AirFlow flow;
  flow.air_k = row.air_k;
  flow.pressure_pa = physics::standard_pressure_pa(setup.height_m);
  flow.undirected_m_s = std::hypot(
      row.wind_m_s, physics::convective_gust_m_s({.global_sun_w_m2 = row.sun_w_m2,
                                                  .longwave_down_w_m2 = row.longwave_down_w_m2,
                                                  .air_k = row.air_k,
                                                  .pressure_pa = flow.pressure_pa}));
  flow.stated_w_m2_k = row.film_w_m2_k;
  flow.stated_frac = row.film_w_m2_k > 0.0 ? 1.0 : 0.0;
  return flow;
}

std::vector<double> measured_films_w_m2_k(const PlateSetup& setup, std::span<const LoggerRow> rows,
                                          const PlateNumbers& numbers) {
  const std::vector<physics::AirFilm> airs = airs_of(setup, rows);
  std::vector<double> out_w_m2_k;
  out_w_m2_k.reserve(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double excess_k = rows[i].surface_k - rows[i].air_k;
    out_w_m2_k.push_back(numbers.film_factor * level_film_w_m2_k(airs[i], setup.skin, excess_k));
  }
  return out_w_m2_k;
}

Result<PlateFit> fit_plate(const PlateSetup& setup, std::span<const LoggerRow> rows,
                           const PlateNumbers& start, std::span<const PlateNumber> free) {
  if (auto good = check(setup, rows); !good) return tl::unexpected(good.error());
  if (auto good = check(start); !good) return tl::unexpected(good.error());
  if (free.empty() || free.size() > kRanges.size()) {
    return make_error(ErrorCode::invalid_argument, "one to four numbers can be fitted");
  }
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (std::ranges::count(free, free[i]) == 1) continue;
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{} is to be fitted twice", name_of(free[i])));
  }
  return Search(setup, rows, free).run(start);
}

}  // namespace emit::reference
