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

/// Evaluation of one physical model over a table, as `emit evaluate MODEL IN.csv` does it. It
/// checks a model by itself: on the CPU in double (the truth), or in float32 through the same
/// shader functions that draw the images.
namespace emit::verify {

/// Number format of the computation.
enum class Precision : std::uint8_t { float32, float64 };
/// Processor of the computation.
enum class Device : std::uint8_t { cpu, gpu };

/// Layer of a body in the model `surface-history`.
struct HistoryLayer {
  double thickness_m = 0.0;
  double conductivity_w_m_k = 0.0;
  double heat_capacity_j_m3_k = 0.0;
};
/// Point of an initial temperature profile.
struct HistoryPoint {
  double depth_m = 0.0;
  double temperature_k = 0.0;
};
/// Relaxation mode.
struct HistoryMode {
  double tau_s = 0.0;
  double weight_frac = 0.0;
};
/// Method of `surface-history`.
enum class HistoryModel : std::uint8_t { reference, emit2014, foster };
/// Options of `surface-history`. All are required except the model and the modes.
struct HistoryOptions {
  std::vector<HistoryLayer> layers;  ///< outermost first
  std::optional<double> base_k;
  std::optional<double> emissivity_frac;
  std::optional<double> film_w_m2_k;
  /// Profile at the time of the first row, linear between points.
  std::vector<HistoryPoint> initial;
  HistoryModel model = HistoryModel::reference;
  std::vector<HistoryMode> modes;  ///< emit2014 only: relaxation modes of the first layer
};

/// One evaluation.
struct EvaluateRequest {
  std::string model;
  std::filesystem::path table;
  std::filesystem::path cases;  ///< relaxation only: modes, weights and start values per case
  std::filesystem::path nodes;  ///< relaxation only: nodes of the drive, t_s and u_K per case
  Precision precision = Precision::float64;
  Device device = Device::cpu;
  /// Visibility models on the CPU: number of rays per row and measure. The error falls with their
  /// number.
  std::optional<std::uint32_t> rays;
  /// Visibility models on the GPU: "per-frame" or "cached". Empty: the default method.
  std::string method;
  int gpu_index = -1;        ///< index as in gl::EglContext::create()
  std::uint32_t refine = 1;  ///< conduction and surface-history: 1, 2 or 4 scales cells and steps
  HistoryOptions history;
};

/// Description of a model, for `--help` and the documentation.
struct ModelInfo {
  std::string_view name;
  std::string_view inputs;   ///< required columns, comma separated
  std::string_view outputs;  ///< columns of the result
  std::string_view meaning;
  bool float32 = true;  ///< true when it also runs in float32 (CPU) and on the GPU
};
/// Returns the descriptions of all models. Thread: any.
[[nodiscard]] std::span<const ModelInfo> models();

/// Evaluates a model and returns the result as CSV text: a header, then one line per input row, in
/// their order. Numbers have 17 significant digits in float64 and 9 in float32; `nan` marks rows
/// where the model is undefined.
/// Thread: any; the GPU variant creates and destroys its own context on the calling thread.  Real
/// time: setup only, it allocates.
/// Errors: invalid_argument for wrong usage (unknown model, float64 on the GPU, missing column or
/// option; exit code 2); not_found, io, parse name file and line; gpu names the device.
[[nodiscard]] physics::Result<std::string> evaluate(const EvaluateRequest& request);

}  // namespace emit::verify
