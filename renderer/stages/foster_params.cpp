// SPDX-License-Identifier: Apache-2.0
#include "stages/foster_params.hpp"

#include "emit/physics/check.hpp"

namespace emit::renderer {

void add_resistances(const std::optional<FosterHistory>& foster,
                     std::span<gpu::MaterialParams> params) noexcept {
  if (!foster) return;
  EMIT_CHECK_OP(params.size(), <=, foster->materials().size());
  // Copy the resistance of each mode.
  for (std::size_t m = 0; m < params.size(); ++m) {
    const physics::FosterNetwork& network = foster->materials()[m].network;
    for (std::size_t i = 0; i < network.count; ++i) {
      params[m].resistance_m2k_w[static_cast<glm::length_t>(i)] =
          static_cast<float>(network.modes[i].resistance_m2k_w);
    }
  }
}

gl::Buffer make_spin_up_buffer(const std::optional<FosterHistory>& foster) {
  // Use one entry of zeros without the model, because GL has no empty storage.
  const glm::vec4 nothing(0.0F);
  const std::span<const glm::vec4> table =
      foster ? foster->table() : std::span<const glm::vec4>(&nothing, 1);
  return gl::Buffer(table.size_bytes(), table.data(), GL_DYNAMIC_STORAGE_BIT);
}

}  // namespace emit::renderer
