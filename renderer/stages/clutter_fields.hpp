// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

#include "draw/draw_lists.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "gl/objects.hpp"

namespace emit::renderer {

/// Fields of the clutter of a scene on the device (passes/clutter.glsl), one behind the other in a
/// buffer texture. Owner: Renderer. Thread: the one that owns the GL context. Real time: build() is
/// setup only, the rest is RT-safe.
class ClutterFields {
 public:
  /// Largest number of different fields: they have 9 MB each.
  static constexpr std::size_t kMost = EMIT_CLUTTER_FIELDS;

  /// Makes the field of each material with clutter. Materials of the same field share it. Errors:
  /// config (more than kMost different fields); gpu (the device takes no buffer texture of their
  /// size).
  [[nodiscard]] static physics::Result<ClutterFields> build(
      std::span<const scene::Material> materials);

  [[nodiscard]] bool empty() const noexcept { return buffer_.id() == 0; }
  /// True if the emissivity of some material varies.
  [[nodiscard]] bool change_emissivity() const noexcept { return emissivity_; }
  /// Returns by material how its draws use the fields.
  [[nodiscard]] std::span<const DrawnClutter> of_materials() const noexcept { return drawn_; }
  void bind() const noexcept { texture_.bind(EMIT_TEX_CLUTTER); }

 private:
  std::vector<DrawnClutter> drawn_;
  bool emissivity_ = false;
  gl::Buffer buffer_;
  gl::BufferTexture texture_;
};

}  // namespace emit::renderer
