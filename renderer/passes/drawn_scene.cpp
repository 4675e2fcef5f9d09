// SPDX-License-Identifier: Apache-2.0
#include "passes/drawn_scene.hpp"

#include <utility>

namespace emit::renderer {

DrawnScene::DrawnScene(SceneBuffers scene, std::span<const std::int32_t> history_of_object,
                       std::uint32_t max_passes)
    : buffers(std::move(scene)),
      lists(buffers, history_of_object, max_passes),
      record_buffer(gl::Buffer::dynamic(lists.max_records() * sizeof(DrawRecord))),
      light_record_buffer(gl::Buffer::dynamic(lists.max_light_records() * sizeof(LightRecord))),
      vertices(buffers, light_record_buffer) {}

void DrawnScene::upload() const noexcept {
  record_buffer.upload(lists.records());
  light_record_buffer.upload(lists.light_records());
}

}  // namespace emit::renderer
