// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

namespace emit::renderer {

/// Value of DeviceOptions::gpu_index that takes Mesa's software renderer, whatever else is there.
inline constexpr int kSoftwareDevice = -2;

/// EGL device as the renderer would use it.
struct GraphicsDevice {
  std::string name;  ///< GL_RENDERER and GL_VERSION, or why it gives no context
  bool usable = false;
  bool software = false;  ///< Mesa draws on the processor
};

/// Tries a context on every EGL device, in the order of RendererOptions::gpu_index; on Mesa's
/// surfaceless platform where no device is listed. Setup only: each takes up to a second.
[[nodiscard]] std::vector<GraphicsDevice> graphics_devices();

}  // namespace emit::renderer
