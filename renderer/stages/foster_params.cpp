// SPDX-License-Identifier: Apache-2.0
#include "stages/foster_params.hpp"

#include <algorithm>

#include "emit/physics/check.hpp"

namespace emit::renderer {

std::uint32_t foster_groups(std::span<const FosterMaterial> materials) noexcept {
  const bool few = std::ranges::all_of(materials, [](const FosterMaterial& material) {
    return material.network.count <= physics::kFewFosterModes;
  });
  return few ? 1 : EMIT_FOSTER_TEXELS;
}

void add_resistances(const std::optional<FosterHistory>& foster,
                     std::span<gpu::MaterialParams> params) noexcept {
  if (!foster) return;
  EMIT_CHECK_OP(params.size(), <=, foster->materials().size());
  // Copy the resistance of each mode.
  for (std::size_t m = 0; m < params.size(); ++m) {
    const physics::FosterNetwork& network = foster->materials()[m].network;
    physics::FosterState<double> resistance_m2k_w{};
    for (std::size_t i = 0; i < network.count; ++i) {
      resistance_m2k_w[i] = network.modes[i].resistance_m2k_w;
    }
    const StateTexels texels = texels_of(resistance_m2k_w);
    std::ranges::copy(texels, params[m].resistance_m2k_w);
  }
}

gl::Buffer make_spin_up_buffer(const std::optional<FosterHistory>& foster) {
  // Use one entry of zeros without the model, because GL has no empty storage.
  const StateTexels nothing{};
  const std::span<const StateTexels> table =
      foster ? foster->table() : std::span<const StateTexels>(&nothing, 1);
  return gl::Buffer(table.size_bytes(), table.data(), GL_DYNAMIC_STORAGE_BIT);
}

}  // namespace emit::renderer
