// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/equilibrium.hpp"

#include "emit/physics/surface_balance.hpp"
#include "gpu_rows.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {
namespace {

using physics::Result;

enum Column : std::size_t { kLambda, kD, kEps, kTa, kTc, kHc, kTair, kColumns };
constexpr std::array<std::string_view, kColumns> kNames = {"lambda", "d",  "eps", "Ta",
                                                           "Tc",     "hc", "Tair"};
using Columns = std::array<std::vector<double>, kColumns>;

/// Returns true when a row has an equilibrium: no value is outside physics.
bool is_defined(const Columns& in, std::size_t row) {
  return is_body(in[kLambda][row], in[kD][row]) && in[kEps][row] >= 0.0 && in[kTa][row] >= 0.0 &&
         in[kHc][row] >= 0.0;
}

template <class Real>
std::vector<Real> on_cpu(const Columns& in) {
  const std::size_t rows = in[kLambda].size();
  std::vector<Real> result(rows, kUndefined<Real>);
  for (std::size_t i = 0; i < rows; ++i) {
    const auto at = [&in, i](Column column) { return static_cast<Real>(in[column][i]); };
    const physics::SurfaceExchange<Real> exchange{at(kEps), at(kLambda) / at(kD), at(kTc), at(kHc),
                                                  at(kTair)};
    const auto balance =
        physics::surface_balance(physics::environment_input_w_m2(at(kEps), at(kTa)), exchange);
    if (is_defined(in, i) && balance.source_w_m2 > 0) {
      result[i] = physics::solve_equilibrium(balance).temperature_k;
    }
  }
  return result;
}

Result<std::vector<float>> on_gpu(const Columns& in, int gpu_index) {
  const std::size_t rows = in[kLambda].size();
  std::vector<float> packed;
  packed.reserve(rows * kColumns);
  for (std::size_t i = 0; i < rows; ++i) {
    for (const auto& column : in) packed.push_back(static_cast<float>(column[i]));
  }
  GpuRows job;
  job.shader = "passes/evaluate_equilibrium.comp";
  job.inputs = packed;
  job.input_stride = kColumns;
  job.output_stride = 2;  // temperature and source term
  job.gpu_index = gpu_index;
  const auto raw = run_gpu_rows(job);
  if (!raw) return tl::unexpected(raw.error());
  std::vector<float> result(rows, kUndefined<float>);
  for (std::size_t i = 0; i < rows; ++i) {
    if (is_defined(in, i) && (*raw)[2 * i + 1] > 0.0F) result[i] = (*raw)[2 * i];
  }
  return result;
}

}  // namespace

Result<std::string> run_equilibrium(const EvaluateRequest& request,
                                    const physics::CsvTable& table) {
  const auto columns = read_columns(table, kNames);
  if (!columns) return tl::unexpected(columns.error());
  if (request.device == Device::gpu) {
    auto result = on_gpu(*columns, request.gpu_index);
    if (!result) return tl::unexpected(std::move(result.error()));
    return write_csv(kEquilibriumOutputs, std::span(&*result, 1));
  }
  if (request.precision == Precision::float32) {
    const auto result = on_cpu<float>(*columns);
    return write_csv(kEquilibriumOutputs, std::span(&result, 1));
  }
  const auto result = on_cpu<double>(*columns);
  return write_csv(kEquilibriumOutputs, std::span(&result, 1));
}

}  // namespace emit::verify
