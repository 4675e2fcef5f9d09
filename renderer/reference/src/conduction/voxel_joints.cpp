// SPDX-License-Identifier: Apache-2.0
#include "voxel_joints.hpp"

#include <algorithm>
#include <cstdint>
#include <string>

namespace emit::reference {
namespace {

/// Thickness of the cells that stand for the resistance of a joint, inside of one of its bodies.
constexpr double kJointM = 2e-4;

/// Searches a shape for the joints of a scenario.
class JointSearch {
 public:
  JointSearch(const scene::ScenarioDesc& scenario, std::span<const scene::Material> materials,
              const VoxelShape& shape)
      : scenario_(scenario), materials_(materials), shape_(shape) {}

  /// Returns the joints at all rectangles where two bodies touch.
  std::vector<VoxelJoint> run() {
    if (scenario_.contacts.empty()) return {};
    const auto body = [&](std::size_t cell) {
      return std::array<std::uint32_t, 2>{shape_.object[cell], shape_.material[cell]};
    };
    shape_.for_cells([&](std::size_t i, std::size_t j, std::size_t k, std::size_t cell) {
      if (shape_.fill[cell] != ShapeFill::solid) return;
      const std::array<std::size_t, 3> at{i, j, k};
      const double depth = std::min(kJointM, 0.25 * layers_m(materials_[shape_.material[cell]]));
      // The cells of a joint lie in the body on its greater side.
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (at[axis] == 0) continue;
        std::array<std::size_t, 3> below = at;
        --below[axis];
        const std::size_t other = shape_.index(below[0], below[1], below[2]);
        if (shape_.fill[other] != ShapeFill::solid || body(other) == body(cell)) continue;
        const double r = resistance(body(cell), body(other));
        if (r > 0.0) joints_.push_back({axis, shape_.planes_m[axis][at[axis]], depth, at, r});
      }
      const std::size_t column = i + shape_.count(0) * j;
      if (!shape_.has_ground || shape_.planes_m[2][k] != shape_.ground_z_m ||
          shape_.ground[column] == VoxelShape::kNoGround) {
        return;
      }
      const double r =
          resistance(body(cell), {shape_.ground_object[column], shape_.ground[column]});
      if (r > 0.0) joints_.push_back({2, shape_.ground_z_m, depth, at, r});
    });
    return std::move(joints_);
  }

 private:
  /// Returns true if a side of a contact names an object or the material of a body.
  [[nodiscard]] bool named(const std::string& name, std::uint32_t object,
                           std::uint32_t material) const {
    return (object < scenario_.objects.size() && scenario_.objects[object].name == name) ||
           (material < materials_.size() && materials_[material].name == name);
  }
  /// Returns the resistance of the contact between two bodies, each given by object and material;
  /// 0 where no contact of the scenario names them.
  [[nodiscard]] double resistance(const std::array<std::uint32_t, 2>& a,
                                  const std::array<std::uint32_t, 2>& b) const {
    for (const scene::ContactDesc& contact : scenario_.contacts) {
      const auto& [first, second] = contact.between;
      if ((named(first, a[0], a[1]) && named(second, b[0], b[1])) ||
          (named(second, a[0], a[1]) && named(first, b[0], b[1]))) {
        return contact.resistance_m2k_w;
      }
    }
    return 0.0;
  }

  const scene::ScenarioDesc& scenario_;
  std::span<const scene::Material> materials_;
  const VoxelShape& shape_;
  std::vector<VoxelJoint> joints_;
};

}  // namespace

std::vector<VoxelJoint> find_joints(const scene::ScenarioDesc& scenario,
                                    std::span<const scene::Material> materials,
                                    const VoxelShape& shape) {
  return JointSearch(scenario, materials, shape).run();
}

}  // namespace emit::reference
