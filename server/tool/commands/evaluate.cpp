// SPDX-License-Identifier: Apache-2.0
#include "emit/verify/evaluate.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <utility>
#include <vector>

#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "emit/config/slab_modes.hpp"

namespace emit::tool {
namespace {

/// "a:b,c:d" as rows of `columns` numbers; an empty text has no rows.
physics::Result<std::vector<std::vector<double>>> parse_rows(std::string_view option,
                                                             std::string_view text,
                                                             std::size_t columns) {
  std::vector<std::vector<double>> rows;
  while (!text.empty()) {
    const std::string_view item = text.substr(0, text.find(','));
    text.remove_prefix(std::min(text.size(), item.size() + 1));
    std::vector<double> row;
    std::string_view rest = item;
    bool valid = true;
    while (valid) {
      const std::string_view cell = rest.substr(0, rest.find(':'));
      double value = 0.0;
      const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
      valid = error == std::errc() && end == cell.data() + cell.size();
      row.push_back(value);
      if (cell.size() == rest.size()) break;
      rest.remove_prefix(cell.size() + 1);
    }
    if (!valid || row.size() != columns) {
      return physics::make_error(physics::ErrorCode::invalid_argument,
                                 std::string(option) + ": '" + std::string(item) + "' is not " +
                                     std::to_string(columns) + " numbers with ':' between them");
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

physics::Result<verify::HistoryOptions> history_options(const EvaluateCommand& command) {
  verify::HistoryOptions history;
  history.base_k = command.base_k;
  history.emissivity_frac = command.emissivity_frac;
  history.film_w_m2_k = command.film_w_m2_k;
  const auto layers = parse_rows("--layers", command.layers, 3);
  if (!layers) return tl::unexpected(layers.error());
  for (const auto& row : *layers) history.layers.push_back({row[0], row[1], row[2]});
  const auto initial = parse_rows("--initial", command.initial, 2);
  if (!initial) return tl::unexpected(initial.error());
  for (const auto& row : *initial) history.initial.push_back({row[0], row[1]});
  if (command.history_model == "foster") history.model = verify::HistoryModel::foster;
  if (command.history_model == "emit2014") {
    history.model = verify::HistoryModel::emit2014;
    if (!history.layers.empty()) {
      // As for a material that states no modes of its own.
      const verify::HistoryLayer& first = history.layers.front();
      const auto positive = [](double value) { return value > 0.0 && std::isfinite(value); };
      if (positive(first.thickness_m) && positive(first.conductivity_w_m_k) &&
          positive(first.heat_capacity_j_m3_k)) {
        for (const auto& mode : config::slab_modes(
                 {first.thickness_m, first.conductivity_w_m_k, first.heat_capacity_j_m3_k, 1.0})) {
          history.modes.push_back({mode.tau_s, mode.weight_frac});
        }
      }
    }
  }
  return history;
}

}  // namespace

int run_evaluate(const EvaluateCommand& command) {
  verify::EvaluateRequest request;
  request.model = command.model;
  request.table = command.input;
  request.cases = command.cases.value_or(std::filesystem::path());
  request.nodes = command.nodes.value_or(std::filesystem::path());
  request.precision =
      command.precision == "float32" ? verify::Precision::float32 : verify::Precision::float64;
  request.device = command.device == "gpu" ? verify::Device::gpu : verify::Device::cpu;
  request.rays = command.rays;
  request.method = command.method;
  request.gpu_index = command.gpu_index;
  request.refine = command.refine;
  auto history = history_options(command);
  if (!history) return fail_call(history.error());
  request.history = std::move(*history);
  const auto result = verify::evaluate(request);
  if (!result) return fail_call(result.error());
  // Nothing but the result goes to standard output.
  const bool written = std::fwrite(result->data(), 1, result->size(), stdout) == result->size() &&
                       std::fflush(stdout) == 0;
  return written ? kExitOk : fail(kExitFailure, "standard output: write failed");
}

std::string evaluate_models_text() {
  std::string text;
  for (const auto& model : verify::models()) {
    text += "  " + std::string(model.name) + ": " + std::string(model.meaning) +
            (model.float32 ? "" : "; on the cpu in float64 only") + "\n      in  " +
            std::string(model.inputs) + "\n      out " + std::string(model.outputs) + "\n";
  }
  return text;
}

}  // namespace emit::tool
