// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "draw/scene_buffers.hpp"
#include "gl/objects.hpp"

namespace emit::renderer {

/// Vertex arrays that read SceneBuffers. The camera's draws read all attributes; the draws into
/// shadow maps read positions and one LightRecord per instance. Thread: the one that owns the GL
/// context. Real time: the constructor is setup only, the rest is RT-safe.
class SceneVertexArrays {
 public:
  /// Components of a sample at a node: temperature offset, bow, share of the sun.
  static constexpr int kNodeFloats = 3;

  SceneVertexArrays(const SceneBuffers& scene, const gl::Buffer& light_records);
  /// Makes the vertex array of the camera's draws current.
  void bind_view() const noexcept { glBindVertexArray(view_.id()); }
  /// Makes the vertex array of the draws into shadow maps current.
  void bind_light() const noexcept { glBindVertexArray(light_.id()); }
  /// Sets the buffers that the camera's draws read the samples from, at the node of time before the
  /// frame and at the node after it: two floats per vertex in each.
  void read_nodes(const gl::Buffer& before, const gl::Buffer& after) const noexcept;
  /// Sets the buffers that the camera's draws read from what other samples send in band, at the
  /// same nodes: `bands` floats per vertex in each.
  void read_seen(const gl::Buffer& before, const gl::Buffer& after,
                 std::uint32_t bands) const noexcept;
  /// Lets the camera's draws read the temperatures of twins from the buffers of read_nodes(): those
  /// of the low twins from vertex `drawn` on, and those of the high ones from twice that.
  void read_twins(const gl::Buffer& before, const gl::Buffer& after,
                  std::size_t drawn) const noexcept;
  /// Sets the buffer that the camera's draws read the recent shade of entities from: one float per
  /// vertex.
  void read_shade(const gl::Buffer& shade) const noexcept;

 private:
  gl::VertexArray view_;
  gl::VertexArray light_;
};

}  // namespace emit::renderer
