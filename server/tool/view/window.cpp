// SPDX-License-Identifier: Apache-2.0
#include "tool/view/window.hpp"

#include <epoxy/gl.h>
#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace emit::tool::view {
namespace {

using physics::ErrorCode;
using physics::make_error;

constexpr const char* kVertexShader = R"(#version 330 core
out vec2 uv;
void main() {
  vec2 corner = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));
  uv = vec2(corner.x, 1.0 - corner.y);
  gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}
)";
constexpr const char* kFragmentShader = R"(#version 330 core
in vec2 uv;
out vec4 color;
uniform sampler2D picture;
void main() { color = vec4(texture(picture, uv).rgb, 1.0); }
)";

constexpr std::array<std::pair<int, Key>, 37> kKeys{{
    {GLFW_KEY_LEFT, Key::left},
    {GLFW_KEY_RIGHT, Key::right},
    {GLFW_KEY_UP, Key::up},
    {GLFW_KEY_DOWN, Key::down},
    {GLFW_KEY_W, Key::forward},
    {GLFW_KEY_S, Key::back},
    {GLFW_KEY_A, Key::strafe_left},
    {GLFW_KEY_D, Key::strafe_right},
    {GLFW_KEY_E, Key::rise},
    {GLFW_KEY_Q, Key::sink},
    {GLFW_KEY_SPACE, Key::pause},
    {GLFW_KEY_LEFT_BRACKET, Key::earlier},
    {GLFW_KEY_RIGHT_BRACKET, Key::later},
    {GLFW_KEY_PAGE_DOWN, Key::earlier},
    {GLFW_KEY_PAGE_UP, Key::later},
    {GLFW_KEY_MINUS, Key::min_down},
    {GLFW_KEY_KP_SUBTRACT, Key::min_down},
    {GLFW_KEY_EQUAL, Key::min_up},
    {GLFW_KEY_KP_ADD, Key::min_up},
    {GLFW_KEY_COMMA, Key::max_down},
    {GLFW_KEY_KP_DIVIDE, Key::max_down},
    {GLFW_KEY_PERIOD, Key::max_up},
    {GLFW_KEY_KP_MULTIPLY, Key::max_up},
    {GLFW_KEY_R, Key::auto_range},
    {GLFW_KEY_T, Key::quantity},
    {GLFW_KEY_HOME, Key::home},
    {GLFW_KEY_H, Key::home},
    {GLFW_KEY_1, Key::overlay_1},
    {GLFW_KEY_2, Key::overlay_2},
    {GLFW_KEY_3, Key::overlay_3},
    {GLFW_KEY_4, Key::overlay_4},
    {GLFW_KEY_5, Key::overlay_5},
    {GLFW_KEY_6, Key::overlay_6},
    {GLFW_KEY_M, Key::color_map},
    {GLFW_KEY_L, Key::quality_level},
    {GLFW_KEY_X, Key::explain},
    {GLFW_KEY_ESCAPE, Key::close},
}};

std::string glfw_reason() {
  const char* text = nullptr;
  glfwGetError(&text);
  return text != nullptr ? text : "unknown reason";
}

GLuint compile(GLenum stage, const char* source) {
  const GLuint shader = glCreateShader(stage);
  glShaderSource(shader, 1, &source, nullptr);
  glCompileShader(shader);
  return shader;
}

class GlfwWindow final : public Window {
 public:
  explicit GlfwWindow(GLFWwindow* window) : window_(window) {}
  ~GlfwWindow() override {
    glDeleteTextures(1, &texture_);
    glDeleteVertexArrays(1, &vertex_array_);
    glDeleteProgram(program_);
    glfwDestroyWindow(window_);
    glfwTerminate();
  }

  physics::Result<void> setup() {
    program_ = glCreateProgram();
    const GLuint vertex = compile(GL_VERTEX_SHADER, kVertexShader);
    const GLuint fragment = compile(GL_FRAGMENT_SHADER, kFragmentShader);
    glAttachShader(program_, vertex);
    glAttachShader(program_, fragment);
    glLinkProgram(program_);
    glDeleteShader(vertex);
    glDeleteShader(fragment);
    GLint linked = GL_FALSE;
    glGetProgramiv(program_, GL_LINK_STATUS, &linked);
    if (linked != GL_TRUE) {
      std::array<char, 1024> log{};
      glGetProgramInfoLog(program_, static_cast<GLsizei>(log.size()), nullptr, log.data());
      return make_error(ErrorCode::gpu, fmt::format("view: shader: {}", log.data()));
    }
    glGenVertexArrays(1, &vertex_array_);
    glGenTextures(1, &texture_);
    glBindTexture(GL_TEXTURE_2D, texture_);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glfwSetWindowUserPointer(window_, this);
    glfwSetKeyCallback(window_, on_key);
    // A press that is over before the next poll() counts.
    glfwSetInputMode(window_, GLFW_STICKY_MOUSE_BUTTONS, GLFW_TRUE);
    glfwSetScrollCallback(window_, on_scroll);
    return {};
  }

  WindowInput poll() override {
    glfwPollEvents();
    double x = 0.0;
    double y = 0.0;
    glfwGetCursorPos(window_, &x, &y);
    const bool pressed = glfwGetMouseButton(window_, GLFW_MOUSE_BUTTON_LEFT) == GLFW_PRESS;
    if (pressed && dragging_) {
      const double scale = picture_per_window();
      input_.drag_x_px += (x - drag_x_) * scale;
      input_.drag_y_px += (y - drag_y_) * scale;
    }
    dragging_ = pressed;
    input_.left_down = pressed;
    const bool right = glfwGetMouseButton(window_, GLFW_MOUSE_BUTTON_RIGHT) == GLFW_PRESS;
    input_.right_press = right && !right_down_;
    right_down_ = right;
    drag_x_ = x;
    drag_y_ = y;
    input_.closed = glfwWindowShouldClose(window_) == GLFW_TRUE;
    return std::exchange(input_, WindowInput{});
  }

  void set_title(const std::string& title) override { glfwSetWindowTitle(window_, title.c_str()); }

  void show(const image::RgbImage& picture, image::RgbImage* read_back) override {
    picture_width_ = picture.width_px;
    picture_height_ = picture.height_px;
    int width = 0;
    int height = 0;
    glfwGetFramebufferSize(window_, &width, &height);
    const auto [x, y, w, h] = area(width, height);
    glBindTexture(GL_TEXTURE_2D, texture_);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGB8, static_cast<GLsizei>(picture.width_px),
                 static_cast<GLsizei>(picture.height_px), 0, GL_RGB, GL_UNSIGNED_BYTE,
                 picture.rgb.data());
    glViewport(0, 0, width, height);
    glClearColor(0.1F, 0.1F, 0.1F, 1.0F);
    glClear(GL_COLOR_BUFFER_BIT);
    glViewport(static_cast<GLint>(x), static_cast<GLint>(y), static_cast<GLsizei>(w),
               static_cast<GLsizei>(h));
    glUseProgram(program_);
    glBindVertexArray(vertex_array_);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    if (read_back != nullptr) copy_window(width, height, *read_back);
    glfwSwapBuffers(window_);
  }

  std::optional<PicturePosition> cursor() const override {
    if (picture_width_ == 0 || glfwGetWindowAttrib(window_, GLFW_HOVERED) != GLFW_TRUE) return {};
    int width = 0;
    int height = 0;
    glfwGetWindowSize(window_, &width, &height);
    double x = 0.0;
    double y = 0.0;
    glfwGetCursorPos(window_, &x, &y);
    const auto [left, bottom, w, h] = area(width, height);
    const double px = (x - left) / w * picture_width_;
    const double py = (y - bottom) / h * picture_height_;
    if (!(px >= 0.0 && py >= 0.0 && px < picture_width_ && py < picture_height_)) return {};
    return PicturePosition{static_cast<std::uint32_t>(px), static_cast<std::uint32_t>(py)};
  }

 private:
  struct Area {
    double x, y, width, height;
  };
  /// Returns the largest centred rectangle of the image's aspect. It is symmetric, so up or down
  /// does not matter.
  [[nodiscard]] Area area(int width, int height) const {
    const double scale = std::min(static_cast<double>(width) / std::max(1U, picture_width_),
                                  static_cast<double>(height) / std::max(1U, picture_height_));
    const double w = std::max(1.0, std::floor(scale * picture_width_));
    const double h = std::max(1.0, std::floor(scale * picture_height_));
    return {std::floor(0.5 * (width - w)), std::floor(0.5 * (height - h)), w, h};
  }

  [[nodiscard]] double picture_per_window() const {
    int width = 0;
    int height = 0;
    glfwGetWindowSize(window_, &width, &height);
    return static_cast<double>(picture_width_) / area(width, height).width;
  }

  static void copy_window(int width, int height, image::RgbImage& out) {
    out.width_px = static_cast<std::uint32_t>(width);
    out.height_px = static_cast<std::uint32_t>(height);
    const std::size_t row = 3 * static_cast<std::size_t>(width);
    std::vector<std::uint8_t> upside_down(row * static_cast<std::size_t>(height));
    glReadBuffer(GL_BACK);
    glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, upside_down.data());
    out.rgb.resize(upside_down.size());
    for (std::size_t y = 0; y < static_cast<std::size_t>(height); ++y) {
      const auto from = upside_down.begin() + static_cast<std::ptrdiff_t>(
                                                  (static_cast<std::size_t>(height) - 1 - y) * row);
      std::copy_n(from, row, out.rgb.begin() + static_cast<std::ptrdiff_t>(y * row));
    }
  }

  static void on_key(GLFWwindow* window, int key, int, int action, int) {
    if (action == GLFW_RELEASE) return;
    auto& self = *static_cast<GlfwWindow*>(glfwGetWindowUserPointer(window));
    for (const auto& [code, name] : kKeys) {
      if (code == key) self.input_.keys.push_back(name);
    }
  }
  static void on_scroll(GLFWwindow* window, double, double dy) {
    static_cast<GlfwWindow*>(glfwGetWindowUserPointer(window))->input_.wheel += dy;
  }

  GLFWwindow* window_;
  GLuint program_ = 0;
  GLuint vertex_array_ = 0;
  GLuint texture_ = 0;
  std::uint32_t picture_width_ = 0;
  std::uint32_t picture_height_ = 0;
  WindowInput input_;
  bool dragging_ = false;
  bool right_down_ = false;
  double drag_x_ = 0.0;
  double drag_y_ = 0.0;
};

}  // namespace

physics::Result<std::unique_ptr<Window>> Window::create(const std::string& title,
                                                        std::uint32_t width_px,
                                                        std::uint32_t height_px) {
  if (glfwInit() != GLFW_TRUE) {
    return make_error(ErrorCode::gpu, "view: no window system: " + glfw_reason());
  }
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  GLFWwindow* handle = glfwCreateWindow(static_cast<int>(width_px), static_cast<int>(height_px),
                                        title.c_str(), nullptr, nullptr);
  if (handle == nullptr) {
    const std::string reason = glfw_reason();
    glfwTerminate();
    return make_error(ErrorCode::gpu, "view: no window: " + reason);
  }
  glfwMakeContextCurrent(handle);
  glfwSwapInterval(1);
  auto window = std::make_unique<GlfwWindow>(handle);
  if (auto ready = window->setup(); !ready) return tl::unexpected(ready.error());
  return std::unique_ptr<Window>(std::move(window));
}

}  // namespace emit::tool::view
