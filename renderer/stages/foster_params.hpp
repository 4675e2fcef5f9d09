// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <span>

#include "gl/objects.hpp"
#include "history/foster_history.hpp"
#include "shared/frame_params.glsl.h"

/// Data of the extended thermal model ("foster") that shaders read. `foster` is empty when the
/// scenario uses the published model.
namespace emit::renderer {

/// Returns how many texels of four numbers the shaders need for the states of a pixel: 1 where no
/// material has more than kFewFosterModes modes, else EMIT_FOSTER_TEXELS.
[[nodiscard]] std::uint32_t foster_groups(std::span<const FosterMaterial> materials) noexcept;

/// Writes the resistances of the modes into the material table. RT-safe.
/// @pre The extended model has at least as many materials as `params`.
void add_resistances(const std::optional<FosterHistory>& foster,
                     std::span<gpu::MaterialParams> params) noexcept;

/// Buffer of the spin-up table; one entry of zeros without the extended model. Setup only.
[[nodiscard]] gl::Buffer make_spin_up_buffer(const std::optional<FosterHistory>& foster);

}  // namespace emit::renderer
