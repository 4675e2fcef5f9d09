// SPDX-License-Identifier: Apache-2.0
#include "emit/renderer/devices.hpp"

#include "gl/egl_context.hpp"

namespace emit::renderer {

static_assert(kSoftwareDevice == gl::EglContext::kSoftwareIndex);

std::vector<GraphicsDevice> graphics_devices() {
  std::vector<GraphicsDevice> out;
  const int count = gl::EglContext::device_count();
  for (int index = count == 0 ? -1 : 0; index < count; ++index) {
    const auto context = gl::EglContext::create(index, false);
    if (context) {
      out.push_back({context->device_name(), true, context->software()});
    } else {
      out.push_back({context.error().text, false, false});
    }
  }
  return out;
}

}  // namespace emit::renderer
