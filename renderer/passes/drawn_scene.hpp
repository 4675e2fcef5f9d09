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
  /// `max_passes`: see DrawLists.
  DrawnScene(SceneBuffers scene, std::span<const std::int32_t> history_of_object,
             std::uint32_t max_passes);
  DrawnScene(const DrawnScene&) = delete;
  DrawnScene& operator=(const DrawnScene&) = delete;

  /// Sends the frame's records to the device.
  void upload() const noexcept;

  SceneBuffers buffers;
  DrawLists lists;
  gl::Buffer record_buffer;
  gl::Buffer light_record_buffer;
  SceneVertexArrays vertices;
};

}  // namespace emit::renderer
