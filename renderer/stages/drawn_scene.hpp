// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "draw/draw_lists.hpp"
#include "draw/scene_buffers.hpp"
#include "gl/objects.hpp"
#include "passes/scene_vertex_arrays.hpp"

namespace emit::renderer {

/// Geometry on the device and its draws of one frame. It is made anew when the meshes change.
/// Owner: ThermalStage. Thread: the one that owns the GL context. Real time: constructors are setup
/// only, upload() is RT-safe.
struct DrawnScene {
  /// Scene whose meshes are drawn whole. `max_passes` and `history_of_object` are those of
  /// DrawLists.
  DrawnScene(scene::SceneGeometry scene, std::span<const std::int32_t> history_of_object,
             std::uint32_t max_passes);
  /// Scene of thermal samples, without shadow maps. `anchors` are those of DrawLists. `software`
  /// says that the rasteriser runs on a CPU, where a small triangle costs as much as a large one;
  /// then triangles are culled here. `clutter` is that of DrawLists.
  DrawnScene(SampledScene scene, std::span<const std::int32_t> history_of_object,
             std::vector<EntityAnchor> anchors, std::span<const DrawnClutter> clutter,
             bool software);
  DrawnScene(const DrawnScene&) = delete;
  DrawnScene& operator=(const DrawnScene&) = delete;

  /// Sends the records of the frame to the device.
  void upload() const noexcept;

  std::unique_ptr<TriangleCull> cull;  ///< null: the device culls triangles itself
  SceneBuffers buffers;
  DrawLists lists;
  gl::Buffer record_buffer;
  gl::Buffer light_record_buffer;
  SceneVertexArrays vertices;
};

}  // namespace emit::renderer
