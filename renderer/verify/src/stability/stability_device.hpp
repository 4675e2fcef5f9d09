// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"
#include "gl/egl_context.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"

namespace emit::verify {

/// Compute shader that draws its inputs itself and runs chunk after chunk of cases. The results are
/// a fixed number of 32-bit words per case at binding 1. Constants are at binding 2; the uniforms
/// first_case, case_count and seed at locations 0 to 2.
/// Thread: the one with the context.
class SweepProgram {
 public:
  static constexpr std::uint32_t kCasesPerChunk = 1U << 20;

  /// Builds the program. Errors: gpu.
  [[nodiscard]] static physics::Result<SweepProgram> create(std::string_view shader,
                                                            std::span<const gl::Define> defines,
                                                            std::size_t words_per_case);

  /// Sets the constants at binding 2.
  void set_constants(std::span<const float> constants);
  void set_layout(std::span<const float, 4> layout) const;  ///< sets the layout at location 3
  /// Sets the steps [first, last) at locations 4 and 5, for shaders that continue from their last
  /// results.
  void set_steps(std::uint32_t first, std::uint32_t last) const;

  /// Runs one chunk. `words` gets count * words_per_case words. Errors: gpu.
  /// @pre count <= kCasesPerChunk
  [[nodiscard]] physics::Result<void> run(std::uint32_t first_case, std::uint32_t count,
                                          std::uint32_t seed, std::vector<float>& words);

 private:
  SweepProgram(gl::Program program, std::size_t words_per_case);

  gl::Program program_;
  std::size_t words_per_case_;
  gl::Buffer outputs_;
  gl::Buffer constants_;
};

}  // namespace emit::verify
