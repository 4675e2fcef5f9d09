// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emit/image/png_image.hpp"
#include "emit/physics/error.hpp"

namespace emit::tool::view {

enum class Key : std::uint8_t {
  left,
  right,
  up,
  down,
  forward,
  back,
  strafe_left,
  strafe_right,
  rise,
  sink,
  pause,
  earlier,
  later,
  min_down,
  min_up,
  max_down,
  max_up,
  auto_range,
  quantity,
  home,
  overlay_1,
  overlay_2,
  overlay_3,
  overlay_4,
  overlay_5,
  overlay_6,
  color_map,
  quality_level,
  explain,
  close
};

/// Input since the last poll().
struct WindowInput {
  std::vector<Key> keys;   ///< presses and repeats, in order
  double drag_x_px = 0.0;  ///< left button, in image pixels
  double drag_y_px = 0.0;
  double wheel = 0.0;      ///< positive: away from the user
  bool left_down = false;  ///< the left button is down now
  bool right_press = false;
  bool closed = false;
};

struct PicturePosition {
  std::uint32_t x_px = 0;
  std::uint32_t y_px = 0;
};

/// A window that shows one RGB image, scaled with its aspect kept. It has an OpenGL 3.3 context of
/// its own, used to put the image on the screen and for nothing else. Main thread only, one at a
/// time.
class Window {
 public:
  /// Errors: gpu (no display, no context), with GLFW's reason.
  [[nodiscard]] static physics::Result<std::unique_ptr<Window>> create(const std::string& title,
                                                                       std::uint32_t width_px,
                                                                       std::uint32_t height_px);
  virtual ~Window() = default;

  [[nodiscard]] virtual WindowInput poll() = 0;
  virtual void set_title(const std::string& title) = 0;
  /// Uploads and shows an image. With `read_back` the pixels of the window are copied into it.
  virtual void show(const image::RgbImage& picture, image::RgbImage* read_back) = 0;
  /// Returns the image pixel under the cursor; empty when the cursor is elsewhere.
  [[nodiscard]] virtual std::optional<PicturePosition> cursor() const = 0;
};

}  // namespace emit::tool::view
