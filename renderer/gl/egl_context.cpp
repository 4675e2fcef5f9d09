// SPDX-License-Identifier: Apache-2.0
#include "gl/egl_context.hpp"

#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <fmt/format.h>

#include <array>
#include <string_view>
#include <utility>
#include <vector>

namespace emit::gl {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Returns why a library that libepoxy needs cannot be opened; empty: all are there. libepoxy would
/// end the process. A library that opens stays open, as it does in libepoxy.
std::string missing_library() {
  const auto opens = [](const char* name) {
    return ::dlopen(name, RTLD_LAZY | RTLD_LOCAL) != nullptr;
  };
  if (!opens("libEGL.so.1")) return ::dlerror();
  if (!opens("libGL.so.1") && !opens("libOpenGL.so.0")) return ::dlerror();
  return {};
}

bool has_extension(const char* list, std::string_view name) {
  if (list == nullptr) return false;
  std::string_view rest(list);
  while (!rest.empty()) {
    const std::size_t end = rest.find(' ');
    if (rest.substr(0, end) == name) return true;
    if (end == std::string_view::npos) break;
    rest.remove_prefix(end + 1);
  }
  return false;
}

/// Display that may give a context, and its name for messages.
struct Candidate {
  EGLDisplay display = EGL_NO_DISPLAY;
  std::string name;
};

/// Returns true if EGL lists devices.
bool lists_devices(const char* client) {
  return has_extension(client, "EGL_EXT_platform_device") &&
         has_extension(client, "EGL_EXT_device_enumeration");
}

/// Returns the EGL devices, hardware before software, then the surfaceless platform. With gpu_index
/// >= 0 it returns that device alone, with kSoftwareIndex the software devices. `tried` gets the
/// reason when the list is empty.
std::vector<Candidate> list_candidates(int gpu_index, std::string& tried) {
  std::vector<Candidate> candidates;
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  std::vector<Candidate> software;
  if (lists_devices(client)) {
    std::array<EGLDeviceEXT, 64> devices{};
    EGLint count = 0;
    if (eglQueryDevicesEXT(static_cast<EGLint>(devices.size()), devices.data(), &count) ==
        EGL_TRUE) {
      for (EGLint i = 0; i < count; ++i) {
        const EGLDeviceEXT device = devices[static_cast<std::size_t>(i)];
        const char* extensions = eglQueryDeviceStringEXT(device, EGL_EXTENSIONS);
        const bool is_software = has_extension(extensions, "EGL_MESA_device_software");
        // The un-suffixed eglGetPlatformDisplay aborts inside libepoxy before a display exists.
        const EGLDisplay display =
            eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, device, nullptr);
        Candidate candidate{display,
                            fmt::format("device {}{}", i, is_software ? " (software)" : "")};
        (is_software ? software : candidates).push_back(std::move(candidate));
      }
    }
  }
  if (gpu_index >= 0) {
    candidates.insert(candidates.end(), software.begin(), software.end());
    if (static_cast<std::size_t>(gpu_index) >= candidates.size()) {
      tried = fmt::format("gpu_index {} asked for, {} EGL devices present", gpu_index,
                          candidates.size());
      return {};
    }
    return {candidates[static_cast<std::size_t>(gpu_index)]};
  }
  if (gpu_index == EglContext::kSoftwareIndex) {
    if (software.empty()) tried = "EGL lists no software device";
    return software;
  }
  if (has_extension(client, "EGL_MESA_platform_surfaceless")) {
    candidates.push_back({eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, nullptr, nullptr),
                          "Mesa surfaceless"});
  }
  if (candidates.empty()) tried = "EGL offers neither device nor surfaceless platform";
  return candidates;
}

EGLContext make_context(EGLDisplay display, bool debug, std::string& why) {
  const threads::SoftwareThreads::Naming naming;  // names the threads that the driver starts here
  EGLint major = 0;
  EGLint minor = 0;
  if (display == EGL_NO_DISPLAY || eglInitialize(display, &major, &minor) != EGL_TRUE) {
    why = "eglInitialize failed";
    return EGL_NO_CONTEXT;
  }
  if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) {
    why = "no desktop OpenGL";
    return EGL_NO_CONTEXT;
  }
  // Drivers that insist on a config get one that supports pbuffers.
  EGLConfig config = nullptr;
  EGLint count = 0;
  const EGLint attributes[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE,
                               EGL_OPENGL_BIT, EGL_NONE};
  if (eglChooseConfig(display, attributes, &config, 1, &count) != EGL_TRUE || count == 0) {
    config = nullptr;  // needs EGL_KHR_no_config_context
  }
  // The reset notification makes a context that the device lost report it. Not every driver offers
  // it.
  std::array context_attributes{EGL_CONTEXT_MAJOR_VERSION,
                                4,
                                EGL_CONTEXT_MINOR_VERSION,
                                5,
                                EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                EGL_CONTEXT_OPENGL_DEBUG,
                                debug ? EGL_TRUE : EGL_FALSE,
                                EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY,
                                EGL_LOSE_CONTEXT_ON_RESET,
                                EGL_NONE};
  EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, context_attributes.data());
  if (context == EGL_NO_CONTEXT) {
    context_attributes[8] = EGL_NONE;
    context = eglCreateContext(display, config, EGL_NO_CONTEXT, context_attributes.data());
  }
  if (context == EGL_NO_CONTEXT) {
    why = fmt::format("no OpenGL 4.5 core context (EGL error 0x{:x})", eglGetError());
    return EGL_NO_CONTEXT;
  }
  if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) != EGL_TRUE) {
    why = "context cannot be current without a surface";
    eglDestroyContext(display, context);
    return EGL_NO_CONTEXT;
  }
  return context;
}

}  // namespace

struct EglContext::Impl {
  EGLDisplay display = EGL_NO_DISPLAY;
  EGLContext context = EGL_NO_CONTEXT;
  std::string device_name;
  bool software = false;
  threads::SoftwareThreads threads;

  ~Impl() {
    if (context == EGL_NO_CONTEXT) return;
    eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display, context);
    // The display is not terminated, because all contexts of the process on this device share it.
  }
};

EglContext::EglContext(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
int EglContext::device_count() {
  if (!missing_library().empty()) return 0;
  EGLint count = 0;
  if (!lists_devices(eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS)) ||
      eglQueryDevicesEXT(0, nullptr, &count) != EGL_TRUE) {
    return 0;
  }
  return count;
}

EglContext::~EglContext() = default;
EglContext::EglContext(EglContext&&) noexcept = default;
EglContext& EglContext::operator=(EglContext&&) noexcept = default;

physics::Result<EglContext> EglContext::create(int gpu_index, bool debug) {
  std::string tried = missing_library();
  std::vector<Candidate> candidates;
  if (tried.empty()) candidates = list_candidates(gpu_index, tried);
  for (const Candidate& candidate : candidates) {
    std::string why;
    const EGLContext context = make_context(candidate.display, debug, why);
    if (context == EGL_NO_CONTEXT) {
      tried += fmt::format("{}{}: {}", tried.empty() ? "" : "; ", candidate.name, why);
      continue;
    }
    auto impl = std::make_unique<Impl>();
    impl->display = candidate.display;
    impl->context = context;
    const auto text = [](GLenum name) {
      const GLubyte* value = glGetString(name);
      return value == nullptr ? std::string("?")
                              : std::string(reinterpret_cast<const char*>(value));
    };
    const std::string renderer = text(GL_RENDERER);
    impl->device_name = fmt::format("{} / OpenGL {}", renderer, text(GL_VERSION));
    impl->software = renderer.starts_with("llvmpipe") || renderer.starts_with("softpipe");
    if (impl->software) impl->threads = threads::SoftwareThreads::find();
    return EglContext(std::move(impl));
  }
  return make_error(
      ErrorCode::gpu,
      fmt::format("no OpenGL 4.5 device: {}. Install a GPU driver with EGL, or Mesa "
                  "(packages libegl1, libopengl0, libgl1-mesa-dri) for software rendering",
                  tried));
}

const std::string& EglContext::device_name() const noexcept {
  return impl_->device_name;
}

bool EglContext::software() const noexcept {
  return impl_->software;
}

const threads::SoftwareThreads& EglContext::threads() const noexcept {
  return impl_->threads;
}

}  // namespace emit::gl
