// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <string>

#include "emit/physics/error.hpp"
#include "threads/software_threads.hpp"

namespace emit::gl {

/// Headless OpenGL 4.5 core context through EGL, current on the thread that created it.
/// Owner: Renderer or a GPU evaluator. Thread: one, for life.
class EglContext {
 public:
  /// gpu_index >= 0: that EGL device (hardware devices are counted first, then software ones).
  /// -1: the first hardware device that gives a 4.5 context, else Mesa's surfaceless platform.
  /// Errors (gpu): no device or no 4.5 context, naming every platform and device that was tried.
  [[nodiscard]] static physics::Result<EglContext> create(int gpu_index, bool debug);
  ~EglContext();
  EglContext(EglContext&&) noexcept;
  EglContext& operator=(EglContext&&) noexcept;

  /// GL_RENDERER and GL_VERSION.
  [[nodiscard]] const std::string& device_name() const noexcept;
  /// True: Mesa draws on the processor.
  [[nodiscard]] bool software() const noexcept;
  /// On which it does; none of a graphics processor.
  [[nodiscard]] const threads::SoftwareThreads& threads() const noexcept;

 private:
  struct Impl;
  explicit EglContext(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::gl
