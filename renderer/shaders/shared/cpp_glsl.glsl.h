// SPDX-License-Identifier: Apache-2.0
// Lets one struct file serve C++ and GLSL. Members are mat4, vec4, uvec4 or groups of four scalars
// (std430 keeps those in step with C++); renderer tests compare every offset with the driver's.
#pragma once
#ifdef __cplusplus
#include <cstddef>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#define EMIT_SHARED_BEGIN namespace emit::renderer::gpu { using glm::mat4; using glm::vec4; using glm::uvec4; using uint = unsigned int;
#define EMIT_SHARED_END }
#else
#define EMIT_SHARED_BEGIN
#define EMIT_SHARED_END
#endif
