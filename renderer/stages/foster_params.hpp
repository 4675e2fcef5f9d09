// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <span>

#include "gl/objects.hpp"
#include "history/foster_history.hpp"
#include "shared/frame_params.glsl.h"

/// The part of the extended thermal model that shaders read.
namespace emit::renderer {

/// Adds the resistances of the modes to the material table.
void add_resistances(const std::optional<FosterHistory>& foster,
                     std::span<gpu::MaterialParams> params) noexcept;

[[nodiscard]] gl::Buffer make_spin_up_buffer(const std::optional<FosterHistory>& foster);

}  // namespace emit::renderer
