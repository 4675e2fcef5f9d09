// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <string>

#include "emit/physics/error.hpp"
#include "threads/software_threads.hpp"

namespace emit::gl {

/// Headless OpenGL 4.5 core context through EGL. It is current on the thread that created it.
/// Owner: Renderer or a GPU evaluator.
/// Thread: one, for life.  Real time: setup only.
class EglContext {
 public:
  /// Index of whatever software device there is.
  static constexpr int kSoftwareIndex = -2;

  /// Creates a context.
  /// @param gpu_index  0 or more: the EGL device of that index (hardware devices are counted first,
  ///   then software ones); -1: the first hardware device that gives a 4.5 context, otherwise
  ///   Mesa's surfaceless platform; kSoftwareIndex: a software device
  /// @param debug      true: a debug context
  /// Errors (gpu): no device, or no 4.5 context; the text names every platform and device that was
  /// tried.
  [[nodiscard]] static physics::Result<EglContext> create(int gpu_index, bool debug);
  /// Returns the number of EGL devices, of hardware and software; their indices go from 0.
  [[nodiscard]] static int device_count();
  ~EglContext();
  EglContext(EglContext&&) noexcept;
  EglContext& operator=(EglContext&&) noexcept;

  /// Returns GL_RENDERER and GL_VERSION.
  [[nodiscard]] const std::string& device_name() const noexcept;
  /// Returns true when Mesa draws on the processor.
  [[nodiscard]] bool software() const noexcept;
  /// Returns Mesa's threads when it draws on the processor. The set is empty for a graphics
  /// processor.
  [[nodiscard]] const threads::SoftwareThreads& threads() const noexcept;

 private:
  struct Impl;
  explicit EglContext(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::gl
