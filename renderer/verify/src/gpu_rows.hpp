// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::verify {

/// Float32 rows for one compute shader. Row i of `inputs` (stride `input_stride`) becomes row i of
/// the result (stride `output_stride`). The shader reads binding 0 and writes binding 1.
/// `constants` (may be empty) is at binding 2, and the number of rows at uniform location 0.
struct GpuRows {
  std::string_view shader;  ///< path relative to renderer/shaders
  std::span<const float> inputs;
  std::size_t input_stride = 1;
  std::size_t output_stride = 1;
  std::span<const float> constants;
  int gpu_index = -1;
};

/// Creates a context, runs the shader and destroys the context. Errors: gpu; unsupported where the
/// constants exceed a storage block.
/// @pre input_stride > 0 and output_stride > 0
[[nodiscard]] physics::Result<std::vector<float>> run_gpu_rows(const GpuRows& rows);

}  // namespace emit::verify
