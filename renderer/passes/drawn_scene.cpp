// SPDX-License-Identifier: Apache-2.0
#include "passes/drawn_scene.hpp"

#include <utility>

namespace emit::renderer {

DrawnScene::DrawnScene(scene::SceneGeometry geometry,
                       std::span<const std::int32_t> history_of_object, std::uint32_t max_passes,
                       std::vector<std::uint32_t> first_sample)
    : buffers(std::move(geometry)),
      lists(buffers, history_of_object, max_passes, std::move(first_sample)),
      instance_buffer(
          gl::Buffer::dynamic(lists.max_instance_params() * sizeof(gpu::InstanceParams))),
      record_buffer(gl::Buffer::dynamic(lists.max_records() * sizeof(DrawRecord))),
      light_record_buffer(gl::Buffer::dynamic(lists.max_light_records() * sizeof(LightRecord))),
      instance_table(GL_RGBA32F, instance_buffer),
      vertices(buffers, record_buffer, light_record_buffer) {}

void DrawnScene::upload() const noexcept {
  instance_buffer.upload(lists.instance_params());
  record_buffer.upload(lists.records());
  light_record_buffer.upload(lists.light_records());
}

}  // namespace emit::renderer
