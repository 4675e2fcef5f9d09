// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "gl/objects.hpp"
#include "draw/draw_lists.hpp"
#include "passes/raster_passes.hpp"
#include "draw/scene_buffers.hpp"

namespace emit::renderer {

/// Geometry on the device and what is drawn of it in a frame. Made anew when meshes change.
/// Owner: Renderer.
struct DrawnScene {
  /// `max_passes`: see DrawLists.
  DrawnScene(scene::SceneGeometry scene, std::span<const std::int32_t> history_of_object,
             std::uint32_t max_passes);
  /// `software`: the device's rasteriser is, so that small triangles cost it as much as large ones.
  DrawnScene(SampledScene scene, std::span<const std::int32_t> history_of_object, bool software);
  DrawnScene(const DrawnScene&) = delete;
  DrawnScene& operator=(const DrawnScene&) = delete;

  /// Sends the frame's records to the device.
  void upload() const noexcept;

  std::unique_ptr<TriangleCull> cull;  ///< null: the device does that
  SceneBuffers buffers;
  DrawLists lists;
  gl::Buffer record_buffer;
  gl::Buffer light_record_buffer;
  SceneVertexArrays vertices;
};

}  // namespace emit::renderer
