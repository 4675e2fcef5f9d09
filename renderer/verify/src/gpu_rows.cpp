// SPDX-License-Identifier: Apache-2.0
#include "gpu_rows.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "emit/physics/check.hpp"
#include "gl/egl_context.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"

namespace emit::verify {
namespace {

// Number of rows per dispatch, within every driver's limits of work groups and buffer size.
constexpr std::size_t kRowsPerDispatch = 1U << 20;
constexpr std::size_t kGroupSize = 64;

enum Binding : GLuint { kInputs = 0, kOutputs = 1, kConstants = 2 };

}  // namespace

physics::Result<std::vector<float>> run_gpu_rows(const GpuRows& rows) {
  EMIT_CHECK_OP(rows.input_stride, >, 0U);
  EMIT_CHECK_OP(rows.output_stride, >, 0U);
  auto context = gl::EglContext::create(rows.gpu_index, false);
  if (!context) return tl::unexpected(std::move(context.error()));
  auto program = gl::Program::compute(rows.shader);
  if (!program) return tl::unexpected(std::move(program.error()));

  const std::size_t count = rows.inputs.size() / rows.input_stride;
  std::vector<float> results(count * rows.output_stride);
  gl::Buffer constants;
  GLint64 block_limit = 0;
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &block_limit);
  if (static_cast<GLint64>(rows.constants.size_bytes()) > block_limit) {
    return physics::make_error(
        physics::ErrorCode::unsupported,
        fmt::format("the tables need {} bytes on the device, {} allows {}: use --device cpu",
                    rows.constants.size_bytes(), context->device_name(), block_limit));
  }
  if (!rows.constants.empty()) {
    constants = gl::Buffer::from(rows.constants);
    constants.bind_storage(kConstants);
  }
  program->use();
  for (std::size_t first = 0; first < count; first += kRowsPerDispatch) {
    const std::size_t chunk = std::min(kRowsPerDispatch, count - first);
    const gl::Buffer inputs =
        gl::Buffer::from(rows.inputs.subspan(first * rows.input_stride, chunk * rows.input_stride));
    const gl::Buffer outputs(chunk * rows.output_stride * sizeof(float), nullptr, 0);
    inputs.bind_storage(kInputs);
    outputs.bind_storage(kOutputs);
    glUniform1ui(0, static_cast<GLuint>(chunk));
    glDispatchCompute(static_cast<GLuint>((chunk + kGroupSize - 1) / kGroupSize), 1, 1);
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    glGetNamedBufferSubData(outputs.id(), 0, static_cast<GLsizeiptr>(outputs.bytes()),
                            results.data() + first * rows.output_stride);
  }
  if (const GLenum error = glGetError(); error != GL_NO_ERROR) {
    return physics::make_error(physics::ErrorCode::gpu,
                               fmt::format("shader '{}' failed on {}: GL error 0x{:04X}",
                                           rows.shader, context->device_name(), error));
  }
  return results;
}

}  // namespace emit::verify
