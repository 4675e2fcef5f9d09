// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

/// Runs one physical model over a table: `emit evaluate MODEL IN.csv`. This is how a model is
/// checked by itself, on the CPU in double (the truth) or in float32 through the very shader
/// functions that draw the images.
namespace emit::verify {

enum class Precision : std::uint8_t { float32, float64 };
enum class Device : std::uint8_t { cpu, gpu };

/// Options of `surface-history`; all required but the model and the modes.
struct HistoryLayer {
  double thickness_m = 0.0;
  double conductivity_w_m_k = 0.0;
  double heat_capacity_j_m3_k = 0.0;
};
struct HistoryPoint {
  double depth_m = 0.0;
  double temperature_k = 0.0;
};
struct HistoryMode {
  double tau_s = 0.0;
  double weight_frac = 0.0;
};
enum class HistoryModel : std::uint8_t { reference, emit2014, foster };
struct HistoryOptions {
  std::vector<HistoryLayer> layers;  ///< outermost first
  std::optional<double> base_k;
  std::optional<double> emissivity_frac;
  std::optional<double> film_w_m2_k;
  std::vector<HistoryPoint> initial;  ///< profile at the first row, linear in between
  HistoryModel model = HistoryModel::reference;
  std::vector<HistoryMode> modes;  ///< emit2014 only: relaxation modes of the first layer
};

struct EvaluateRequest {
  std::string model;
  std::filesystem::path table;
  std::filesystem::path cases;  ///< relaxation only: modes, weights and start values per case
  std::filesystem::path nodes;  ///< relaxation only: the drive, t_s and u_K per case
  Precision precision = Precision::float64;
  Device device = Device::cpu;
  /// Visibility models on the CPU: rays per row and measure; the error falls with their number.
  std::optional<std::uint32_t> rays;
  /// Visibility models on the GPU: "per-frame" or "cached"; empty: the default method.
  std::string method;
  int gpu_index = -1;        ///< as gl::EglContext::create()
  std::uint32_t refine = 1;  ///< conduction and surface-history: 1, 2 or 4 scales cells and steps
  HistoryOptions history;
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

}  // namespace emit::verify
