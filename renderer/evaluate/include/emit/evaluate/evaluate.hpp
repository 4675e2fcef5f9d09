// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "emit/physics/error.hpp"

/// Runs one physical model over a table: `emit evaluate MODEL IN.csv`. This is how a model is
/// checked by itself, on the CPU in double (the truth) or in float32 through the very shader
/// functions that draw the images.
namespace emit::evaluate {

enum class Precision : std::uint8_t { float32, float64 };
enum class Device : std::uint8_t { cpu, gpu };

struct EvaluateRequest {
  std::string model;
  std::filesystem::path table;
  std::filesystem::path cases;  ///< relaxation only: modes, weights and start values per case
  std::filesystem::path nodes;  ///< relaxation only: the drive, t_s and u_K per case
  Precision precision = Precision::float64;
  Device device = Device::cpu;
  int gpu_index = -1;  ///< as gl::EglContext::create()
};

/// A model as `--help` and the documentation list it.
struct ModelInfo {
  std::string_view name;
  std::string_view inputs;   ///< required columns, comma separated
  std::string_view outputs;  ///< columns of the result
  std::string_view meaning;
  bool float32 = true;  ///< runs in float32 (cpu) and on the GPU as well
};
[[nodiscard]] std::span<const ModelInfo> models();

/// The result as CSV text: a header and one line per input row in input order, 17 significant
/// digits in float64 and 9 in float32, `nan` where the model is undefined. Any thread; the GPU
/// variant creates and destroys its own context on the calling thread. Setup class: allocates.
///
/// Errors: `invalid_argument` is bad usage (unknown model, float64 on the GPU, missing column or
/// option: exit code 2); `not_found`, `io`, `parse` name file and line; `gpu` the device.
[[nodiscard]] physics::Result<std::string> evaluate(const EvaluateRequest& request);

}  // namespace emit::evaluate
