// SPDX-License-Identifier: Apache-2.0
// Lets one file define a struct for C++ and for GLSL. A member is a mat4, a vec4, a uvec4, or part of a group that
// fills 16 bytes: four scalars, two vec2, or a vec3 and a scalar. Padding has a name. Then std140 and std430 give the
// offsets that C++ gives. Each file asserts size and offsets for C++, and tests/renderer/gl/shared_structs_test.cpp
// compares them with those of the driver.
#pragma once
#ifdef __cplusplus
#include <cstddef>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#define EMIT_SHARED_BEGIN                                                                           \
  namespace emit::renderer::gpu {                                                                   \
  using glm::mat4; using glm::vec2; using glm::vec3; using glm::vec4; using glm::uvec2; using glm::uvec4; \
  using uint = unsigned int;
#define EMIT_SHARED_END }
// True at compile time when `member` of `type` lies `offset` bytes behind the start of the struct.
#define EMIT_SHARED_OFFSET(type, member, offset) static_assert(offsetof(type, member) == (offset))
#else
#define EMIT_SHARED_BEGIN
#define EMIT_SHARED_END
#endif
