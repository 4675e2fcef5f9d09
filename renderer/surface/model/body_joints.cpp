// SPDX-License-Identifier: Apache-2.0
#include <string>

#include "surface/model/surface_model.hpp"

namespace emit::renderer {

double BodyJoints::resistance_m2k_w(std::uint32_t object, const scene::Material& material,
                                    std::uint32_t other_object,
                                    const scene::Material& other_material) const noexcept {
  const auto named = [&](const std::string& name, std::uint32_t index,
                         const scene::Material& of_body) {
    return (index < objects.size() && objects[index] == name) || of_body.name == name;
  };
  for (const scene::ContactDesc& contact : contacts) {
    const auto& [first, second] = contact.between;
    if ((named(first, object, material) && named(second, other_object, other_material)) ||
        (named(second, object, material) && named(first, other_object, other_material))) {
      return contact.resistance_m2k_w;
    }
  }
  return 0.0;
}

}  // namespace emit::renderer
