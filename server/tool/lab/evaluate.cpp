// SPDX-License-Identifier: Apache-2.0
#include "emit/verify/evaluate.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <string_view>
#include <utility>
#include <vector>

#include "emit/config/slab_modes.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/lab/lab.hpp"
#include "tool/support/console.hpp"

namespace emit::tool {
namespace {

struct EvaluateOptions {
  std::string model;
  std::filesystem::path input;
  std::string precision = "float64";
  std::string device = "cpu";
  std::optional<std::filesystem::path> cases;
  std::optional<std::filesystem::path> nodes;
  std::optional<std::uint32_t> rays;
  std::string method;  ///< empty: the default method
  int gpu_index = -1;
  std::uint32_t refine = 1;
  std::string layers;   ///< surface-history: d:k:rc,...
  std::string initial;  ///< surface-history: z:T,...
  std::optional<double> base_k;
  std::optional<double> emissivity_frac;
  std::optional<double> film_w_m2_k;
  std::string history_model = "reference";
};

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

physics::Result<verify::HistoryOptions> history_options(const EvaluateOptions& command) {
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
      // The first layer stands for a material that states no modes of its own.
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

int run(const EvaluateOptions& command) {
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

/// List of the models with their columns, for --help.
std::string models_text() {
  std::string text;
  for (const auto& model : verify::models()) {
    text += "  " + std::string(model.name) + ": " + std::string(model.meaning) +
            (model.float32 ? "" : "; on the cpu in float64 only") + "\n      in  " +
            std::string(model.inputs) + "\n      out " + std::string(model.outputs) + "\n";
  }
  return text;
}

void add_options(CommandLine& line, EvaluateOptions& options) {
  line.footer(
      "Models:\n" + models_text() +
      "Example: emit evaluate equilibrium quartic_roots.csv --precision float32 --device gpu");
  line.option("model", options.model, "Name of the model, see below").required().type_name("MODEL");
  line.path("input", options.input, "CSV with a header row; columns in any order").required();
  line.option("--precision", options.precision, "float64 or float32")
      .one_of({"float32", "float64"})
      .show_default();
  line.option("--device", options.device, "cpu, or gpu: the shader code itself (float32)")
      .one_of({"gpu", "cpu"})
      .show_default();
  line.path("--cases", options.cases, "relaxation: CSV of the cases");
  line.path("--nodes", options.nodes, "relaxation: CSV of the history's nodes");
  line.option("--refine", options.refine, "conduction-*, surface-history: scales cells and steps")
      .one_of_numbers({1, 2, 4})
      .show_default();
  line.option("--layers", options.layers,
              "surface-history: layers from the surface, thickness m : conductivity W/m/K : "
              "heat capacity J/m3/K")
      .type_name("D:K:RC,...");
  line.option("--initial", options.initial,
              "surface-history: profile at the first row, depth m : temperature K, linear")
      .type_name("Z:T,...");
  line.option("--base-k", options.base_k, "surface-history: temperature below the last layer")
      .type_name("K");
  line.option("--emissivity", options.emissivity_frac,
              "surface-history: long-wave emissivity, 0..1")
      .type_name("E");
  line.option("--film-w-m2-k", options.film_w_m2_k, "surface-history: convection coefficient")
      .type_name("H");
  line.option("--model", options.history_model,
              "surface-history: reference, emit2014 (first layer, no convection) or foster")
      .one_of({"reference", "emit2014", "foster"})
      .show_default();
  line.option("--rays", options.rays,
              "sun-disc, wall-shadow, sky-view on the cpu: rays per row and measure")
      .type_name("N")
      .in_range(1, 1 << 30);
  line.option("--method", options.method,
              "sun-disc, wall-shadow, sky-view with --device gpu: thermal method whose "
              "visibility answers; default: cached")
      .one_of({"per-frame", "cached"});
  add_gpu(line, options.gpu_index);
}

}  // namespace

void add_evaluate(CommandLine& tool) {
  tool.command<EvaluateOptions>(kEvaluateText, add_options, run);
}

}  // namespace emit::tool
