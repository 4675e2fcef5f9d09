// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "emit/physics/surface_balance.hpp"
#include "gpu_rows.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

enum Column : std::size_t {
  kSd,
  kSi,
  kRe,
  kRlw,
  kAlb,
  kBeta,
  kFd,
  kFi,
  kEps,
  kLambda,
  kD,
  kTc,
  kHc,
  kTair,
  kColumns
};
constexpr std::array<std::string_view, kColumns> kNames = {"S_d",  "S_i", "R_e", "R_LW", "alb",
                                                           "beta", "f_d", "f_i", "eps",  "lambda",
                                                           "d",    "Tc",  "hc",  "Tair"};
enum Output : std::size_t { kEabs, kTa, kTs, kTsConv, kOutputs };

/// Columns of the table, in which the solar absorptance replaces `alb`.
using Columns = std::array<std::vector<double>, kColumns>;
template <class Real>
using Results = std::array<std::vector<Real>, kOutputs>;

Result<Columns> read(const physics::CsvTable& table) {
  auto columns = read_columns(table, kNames);
  if (!columns) return tl::unexpected(std::move(columns.error()));
  const auto readings = table.texts("alb_reading");
  if (!readings) return tl::unexpected(readings.error());
  for (std::size_t i = 0; i < table.rows(); ++i) {
    double& value = (*columns)[kAlb][i];
    if ((*readings)[i] == "albedo") {
      value = 1.0 - value;
    } else if ((*readings)[i] != "absorptivity") {
      return make_error(ErrorCode::parse,
                        fmt::format("{}:{}: column 'alb_reading': '{}' is neither 'albedo' nor "
                                    "'absorptivity'",
                                    table.name(), table.line_of(i), (*readings)[i]));
    }
  }
  return columns;
}

bool is_defined(const Columns& in, std::size_t row) {
  return is_body(in[kLambda][row], in[kD][row]) && in[kEps][row] >= 0.0;
}

/// Stores one row of results. Undefined values become NaN in the same way for every device.
template <class Real>
void store(const Columns& in, std::size_t row, Real absorbed_w_m2, Real radiative_k,
           Real plain_source, Real plain_k, Real film_source, Real film_k, Results<Real>& out) {
  out[kEabs][row] = absorbed_w_m2;
  if (absorbed_w_m2 >= 0 && in[kEps][row] > 0.0) out[kTa][row] = radiative_k;
  if (!is_defined(in, row)) return;
  if (plain_source > 0) out[kTs][row] = plain_k;
  if (film_source > 0 && in[kHc][row] >= 0.0) out[kTsConv][row] = film_k;
}

template <class Real>
Results<Real> undefined(std::size_t rows) {
  Results<Real> results;
  for (auto& column : results) column.assign(rows, kUndefined<Real>);
  return results;
}

template <class Real>
Results<Real> on_cpu(const Columns& in) {
  const std::size_t rows = in[kSd].size();
  auto out = undefined<Real>(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    const auto at = [&in, i](Column column) { return static_cast<Real>(in[column][i]); };
    const physics::SurfaceFluxes<Real> fluxes{at(kSd),   at(kSi), at(kRe), at(kRlw),
                                              at(kBeta), at(kFd), at(kFi)};
    const Real absorbed = physics::absorbed_flux_w_m2(fluxes, at(kAlb), at(kEps));
    physics::SurfaceExchange<Real> exchange{at(kEps), at(kLambda) / at(kD), at(kTc), Real(0),
                                            Real(0)};
    const auto plain = physics::surface_balance(absorbed, exchange);
    exchange.film_w_m2_k = at(kHc);
    exchange.air_k = at(kTair);
    const auto film = physics::surface_balance(absorbed, exchange);
    store(in, i, absorbed, physics::radiative_temperature_k(absorbed, at(kEps)), plain.source_w_m2,
          physics::solve_equilibrium(plain).temperature_k, film.source_w_m2,
          physics::solve_equilibrium(film).temperature_k, out);
  }
  return out;
}

Result<Results<float>> on_gpu(const Columns& in, int gpu_index) {
  const std::size_t rows = in[kSd].size();
  std::vector<float> packed;
  packed.reserve(rows * kColumns);
  for (std::size_t i = 0; i < rows; ++i) {
    for (const auto& column : in) packed.push_back(static_cast<float>(column[i]));
  }
  constexpr std::size_t kStride = 6;
  GpuRows job;
  job.shader = "passes/evaluate_balance.comp";
  job.inputs = packed;
  job.input_stride = kColumns;
  job.output_stride = kStride;
  job.gpu_index = gpu_index;
  const auto raw = run_gpu_rows(job);
  if (!raw) return tl::unexpected(raw.error());
  auto out = undefined<float>(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    const float* r = raw->data() + kStride * i;
    store(in, i, r[0], r[1], r[2], r[3], r[4], r[5], out);
  }
  return out;
}

}  // namespace

Result<std::string> run_balance(const EvaluateRequest& request, const physics::CsvTable& table) {
  const auto columns = read(table);
  if (!columns) return tl::unexpected(columns.error());
  if (request.device == Device::gpu) {
    const auto result = on_gpu(*columns, request.gpu_index);
    if (!result) return tl::unexpected(result.error());
    return write_csv(kBalanceOutputs, *result);
  }
  if (request.precision == Precision::float32) {
    return write_csv(kBalanceOutputs, on_cpu<float>(*columns));
  }
  return write_csv(kBalanceOutputs, on_cpu<double>(*columns));
}

}  // namespace emit::verify
