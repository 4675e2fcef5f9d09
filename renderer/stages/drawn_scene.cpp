// SPDX-License-Identifier: Apache-2.0
#include "stages/drawn_scene.hpp"

#include <utility>

namespace emit::renderer {

DrawnScene::DrawnScene(scene::SceneGeometry scene, std::span<const std::int32_t> history_of_object,
                       std::uint32_t max_passes)
    : buffers(std::move(scene)),
      lists(buffers, history_of_object, max_passes, nullptr),
      record_buffer(gl::Buffer::dynamic(lists.max_records() * sizeof(DrawRecord))),
      light_record_buffer(gl::Buffer::dynamic(lists.max_light_records() * sizeof(LightRecord))),
      vertices(buffers, light_record_buffer) {}

DrawnScene::DrawnScene(SampledScene scene, std::span<const std::int32_t> history_of_object,
                       std::vector<EntityAnchor> anchors, std::span<const DrawnClutter> clutter,
                       bool software)
    : cull(software ? std::make_unique<TriangleCull>() : nullptr),
      buffers(std::move(scene), cull.get()),
      lists(buffers, history_of_object, 0, cull.get(), std::move(anchors), clutter),
      record_buffer(gl::Buffer::dynamic(lists.max_records() * sizeof(DrawRecord))),
      light_record_buffer(gl::Buffer::dynamic(lists.max_light_records() * sizeof(LightRecord))),
      vertices(buffers, light_record_buffer) {}

void DrawnScene::upload() const noexcept {
  // Send the records of the camera, the triangles that culling kept, and the records of the light.
  record_buffer.upload(lists.records());
  if (cull) buffers.upload_culled(cull->indices());
  light_record_buffer.upload(lists.light_records());
}

}  // namespace emit::renderer
