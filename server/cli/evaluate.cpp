// SPDX-License-Identifier: Apache-2.0
#include "emit/evaluate/evaluate.hpp"

#include <cstdio>

#include "commands.hpp"
#include "console.hpp"

namespace emit::cli {

int run_evaluate(const EvaluateCommand& command) {
  evaluate::EvaluateRequest request;
  request.model = command.model;
  request.table = command.input;
  request.cases = command.cases.value_or(std::filesystem::path());
  request.nodes = command.nodes.value_or(std::filesystem::path());
  request.precision =
      command.precision == "float32" ? evaluate::Precision::float32 : evaluate::Precision::float64;
  request.device = command.device == "gpu" ? evaluate::Device::gpu : evaluate::Device::cpu;
  request.gpu_index = command.gpu_index;
  const auto result = evaluate::evaluate(request);
  if (!result) {
    const bool usage = result.error().code == physics::ErrorCode::invalid_argument;
    return fail(usage ? kExitUsage : kExitFailure, result.error().text);
  }
  // Nothing but the result goes to standard output.
  const bool written = std::fwrite(result->data(), 1, result->size(), stdout) == result->size() &&
                       std::fflush(stdout) == 0;
  return written ? kExitOk : fail(kExitFailure, "standard output: write failed");
}

std::string evaluate_models_text() {
  std::string text;
  for (const auto& model : evaluate::models()) {
    text += "  " + std::string(model.name) + ": " + std::string(model.meaning) + "\n      in  " +
            std::string(model.inputs) + "\n      out " + std::string(model.outputs) + "\n";
  }
  return text;
}

}  // namespace emit::cli
