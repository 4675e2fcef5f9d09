// SPDX-License-Identifier: Apache-2.0
#include "stability_device.hpp"

#include <fmt/format.h>

#include "emit/physics/check.hpp"

namespace emit::verify {
namespace {

constexpr std::uint32_t kGroupSize = 64;
enum Binding : GLuint { kOutputs = 1, kConstants = 2 };
enum Location : GLint {
  kFirstCase = 0,
  kCaseCount = 1,
  kSeed = 2,
  kLayout = 3,
  kFirstStep = 4,
  kLastStep = 5
};

}  // namespace

SweepProgram::SweepProgram(gl::Program program, std::size_t words_per_case)
    : program_(std::move(program)),
      words_per_case_(words_per_case),
      outputs_(kCasesPerChunk * words_per_case * sizeof(float), nullptr, 0) {}

physics::Result<SweepProgram> SweepProgram::create(std::string_view shader,
                                                   std::span<const gl::Define> defines,
                                                   std::size_t words_per_case) {
  auto program = gl::Program::compute(shader, defines);
  if (!program) return tl::unexpected(std::move(program.error()));
  return SweepProgram(std::move(*program), words_per_case);
}

void SweepProgram::set_constants(std::span<const float> constants) {
  constants_ = gl::Buffer::from(constants);
}

void SweepProgram::set_layout(std::span<const float, 4> layout) const {
  glProgramUniform4fv(program_.id(), kLayout, 1, layout.data());
}

void SweepProgram::set_steps(std::uint32_t first, std::uint32_t last) const {
  glProgramUniform1ui(program_.id(), kFirstStep, first);
  glProgramUniform1ui(program_.id(), kLastStep, last);
}

physics::Result<void> SweepProgram::run(std::uint32_t first_case, std::uint32_t count,
                                        std::uint32_t seed, std::vector<float>& words) {
  EMIT_CHECK_OP(count, <=, kCasesPerChunk);
  words.resize(count * words_per_case_);
  program_.use();
  outputs_.bind_storage(kOutputs);
  if (constants_.bytes() != 0) constants_.bind_storage(kConstants);
  glUniform1ui(kFirstCase, first_case);
  glUniform1ui(kCaseCount, count);
  glUniform1ui(kSeed, seed);
  glDispatchCompute((count + kGroupSize - 1) / kGroupSize, 1, 1);
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glGetNamedBufferSubData(outputs_.id(), 0, static_cast<GLsizeiptr>(words.size() * sizeof(float)),
                          words.data());
  if (const GLenum error = glGetError(); error != GL_NO_ERROR) {
    return physics::make_error(physics::ErrorCode::gpu,
                               fmt::format("stability sweep: GL error 0x{:04X}", error));
  }
  return {};
}

}  // namespace emit::verify
