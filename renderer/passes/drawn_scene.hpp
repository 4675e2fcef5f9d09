// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "gl/objects.hpp"
#include "passes/draw_lists.hpp"
#include "passes/raster_passes.hpp"
#include "passes/scene_buffers.hpp"

namespace emit::renderer {

/// Geometry on the device and what is drawn of it in a frame. Made anew when meshes change.
/// Owner: Renderer.
struct DrawnScene {
  /// `first_sample`: see DrawLists; empty without samples.
  DrawnScene(scene::SceneGeometry geometry, std::span<const std::int32_t> history_of_object,
             std::uint32_t max_passes, std::vector<std::uint32_t> first_sample);
  DrawnScene(const DrawnScene&) = delete;
  DrawnScene& operator=(const DrawnScene&) = delete;

  /// Sends the frame's instances and records to the device.
  void upload() const noexcept;

  SceneBuffers buffers;
  DrawLists lists;
  gl::Buffer instance_buffer;
  gl::Buffer record_buffer;
  gl::Buffer light_record_buffer;
  gl::BufferTexture instance_table;
  SceneVertexArrays vertices;
};

}  // namespace emit::renderer
