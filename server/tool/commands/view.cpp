// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <span>
#include <thread>

#include "emit/image/false_color.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/streams/stream_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/view/frame_provider.hpp"
#include "tool/view/window.hpp"

namespace emit::tool {
namespace {

struct ViewOptions {
  view::SourceOptions source;
  std::optional<double> min_value;
  std::optional<double> max_value;
  std::uint64_t frames = 0;
  std::optional<std::filesystem::path> screenshot;
};

using view::Key;
using view::ViewControl;
using view::ViewFrame;

struct Limits {
  double low = 0.0;
  double high = 1.0;
};

/// State of the viewer: which quantity is shown between which limits, and the camera's commands.
class Viewer {
 public:
  Viewer(const ViewOptions& command, view::FrameProvider& provider, view::Window& window)
      : command_(command), provider_(provider), window_(window) {
    provider.limits(temperature_.low, temperature_.high);
    if (command.min_value) temperature_.low = *command.min_value;
    if (command.max_value) temperature_.high = *command.max_value;
  }

  int run();

 private:
  void handle(const view::WindowInput& input);
  void handle(Key key);
  void auto_range();
  void draw(image::RgbImage* read_back);
  [[nodiscard]] std::string cursor_text() const;
  [[nodiscard]] std::span<const float> values() const {
    return show_radiance_ ? std::span<const float>(frame_.radiance_w_m2_sr)
                          : std::span<const float>(frame_.temperature_k);
  }
  Limits& limits() { return show_radiance_ ? radiance_ : temperature_; }

  const ViewOptions& command_;
  view::FrameProvider& provider_;
  view::Window& window_;
  ViewFrame frame_;
  ViewControl control_;
  Limits temperature_;
  Limits radiance_;
  bool radiance_ranged_ = false;
  bool show_radiance_ = false;
  bool close_ = false;
  std::uint64_t shown_ = 0;
};

void Viewer::handle(Key key) {
  constexpr double kTurnRad = 0.02;
  constexpr double kMoveM = 1.0;
  Limits& range = limits();
  const double step = 0.05 * (range.high - range.low);
  switch (key) {
    case Key::left:
      control_.yaw_rad -= kTurnRad;
      break;
    case Key::right:
      control_.yaw_rad += kTurnRad;
      break;
    case Key::up:
      control_.pitch_rad += kTurnRad;
      break;
    case Key::down:
      control_.pitch_rad -= kTurnRad;
      break;
    case Key::forward:
      control_.forward_m += kMoveM;
      break;
    case Key::back:
      control_.forward_m -= kMoveM;
      break;
    case Key::strafe_left:
      control_.right_m -= kMoveM;
      break;
    case Key::strafe_right:
      control_.right_m += kMoveM;
      break;
    case Key::rise:
      control_.up_m += kMoveM;
      break;
    case Key::sink:
      control_.up_m -= kMoveM;
      break;
    case Key::pause:
      control_.paused = !control_.paused;
      break;
    case Key::earlier:
      control_.jump_s -= 60.0;
      break;
    case Key::later:
      control_.jump_s += 60.0;
      break;
    case Key::min_down:
      range.low -= step;
      break;
    case Key::min_up:
      range.low = std::min(range.low + step, range.high - step);
      break;
    case Key::max_down:
      range.high = std::max(range.high - step, range.low + step);
      break;
    case Key::max_up:
      range.high += step;
      break;
    case Key::auto_range:
      auto_range();
      break;
    case Key::quantity:
      if (show_radiance_ && frame_.temperature_k.empty()) break;
      show_radiance_ = !show_radiance_;
      if (show_radiance_ && !radiance_ranged_) auto_range();
      break;
    case Key::home:
      control_ = ViewControl{.paused = control_.paused, .jump_s = control_.jump_s, .home = true};
      break;
    case Key::close:
      close_ = true;
      break;
  }
}

void Viewer::handle(const view::WindowInput& input) {
  close_ = close_ || input.closed;
  for (const Key key : input.keys) handle(key);
  constexpr double kDragRadPerPx = 0.002;
  control_.yaw_rad += kDragRadPerPx * input.drag_x_px;
  control_.pitch_rad -= kDragRadPerPx * input.drag_y_px;
  control_.forward_m += 2.0 * input.wheel;
  provider_.control(control_);
  control_.jump_s = control_.forward_m = control_.right_m = control_.up_m = 0.0;
  control_.home = false;
}

void Viewer::auto_range() {
  const auto range = image::percentile_range(values(), 1.0, 99.0);
  if (!range) return;
  const double margin =
      std::max(0.02 * (range->max_value - range->min_value), 1e-6 * std::abs(range->max_value));
  limits() = {range->min_value - margin, range->max_value + margin};
  if (show_radiance_) radiance_ranged_ = true;
}

std::string Viewer::cursor_text() const {
  const auto at = window_.cursor();
  if (!at || at->x_px >= frame_.width_px || at->y_px >= frame_.height_px) return "";
  const std::size_t index =
      static_cast<std::size_t>(at->y_px) * frame_.width_px + static_cast<std::size_t>(at->x_px);
  std::string text =
      fmt::format("{} {}  {:.4g} {}", at->x_px, at->y_px, frame_.radiance_w_m2_sr[index],
                  frame_.unit.empty() ? std::string_view("W/M2/SR") : frame_.unit);
  if (!frame_.temperature_k.empty()) {
    const float kelvin = frame_.temperature_k[index];
    text += std::isnan(kelvin) ? "  SKY"
                               : fmt::format("  {:.2f} K{}", kelvin,
                                             frame_.apparent_temperature ? " APPARENT" : "");
  }
  return text;
}

void Viewer::draw(image::RgbImage* read_back) {
  image::FalseColorOptions options;
  options.min_value = limits().low;
  options.max_value = limits().high;
  options.color_bar = true;
  options.unit = !frame_.unit.empty() ? "" : show_radiance_ ? "W" : "K";
  auto picture = image::false_color(values(), frame_.width_px, frame_.height_px, options);
  if (!picture) return;
  const std::string cursor = cursor_text();
  const double time_s = 1e-9 * static_cast<double>(frame_.sim_time_ns);
  const std::string status = fmt::format("T {:.2f} S  {:.0f} MS{}", time_s, frame_.frame_ms,
                                         control_.paused ? "  PAUSED" : "");
  constexpr image::Rgb kInk{255, 255, 255};
  constexpr image::Rgb kShade{0, 0, 0};
  const auto write = [&](const std::string& text, std::int32_t y) {
    image::draw_text(*picture, text, 7, y + 1, kShade, 2);
    image::draw_text(*picture, text, 6, y, kInk, 2);
  };
  write(status, 6);
  if (!cursor.empty()) write(cursor, 24);
  window_.set_title(fmt::format("emit view: {}, band {}, {:.2f} s{}{}", provider_.title(),
                                provider_.band(), time_s, cursor.empty() ? "" : ", ", cursor));
  window_.show(*picture, read_back);
}

int Viewer::run() {
  const auto start = std::chrono::steady_clock::now();
  bool have_frame = false;
  std::string failure;
  while (!close_ && !InterruptGuard::interrupted()) {
    handle(window_.poll());
    const bool fresh = provider_.take(frame_);
    if (const auto end = provider_.ended(); !fresh && end) {
      if (end->failure || !have_frame || command_.frames > 0) failure = end->reason;
      break;
    }
    have_frame = have_frame || fresh;
    if (!have_frame) {
      constexpr auto kFirstFrame = std::chrono::seconds(60);
      if (command_.frames > 0 && std::chrono::steady_clock::now() - start > kFirstFrame) {
        failure = "no frame within 60 s";
        break;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      continue;
    }
    if (fresh) ++shown_;
    if (frame_.temperature_k.empty() && !show_radiance_) handle(Key::quantity);
    const bool last = command_.frames > 0 && shown_ >= command_.frames;
    if (last) break;
    draw(nullptr);
    // Also redrawn without a new frame: the value under the cursor moves with it.
    if (!fresh) std::this_thread::sleep_for(std::chrono::milliseconds(15));
  }
  if (have_frame) {
    image::RgbImage picture;
    draw(command_.screenshot ? &picture : nullptr);
    if (command_.screenshot) {
      if (auto done = image::write_png(*command_.screenshot, picture); !done) {
        if (!failure.empty()) fail(kExitFailure, failure);
        return fail(done.error());
      }
    }
  }
  if (!failure.empty()) return fail(kExitFailure, failure);
  if (command_.screenshot && !have_frame) {
    return fail(kExitFailure, command_.screenshot->string() + ": not written: no frame came");
  }
  fmt::print("{} frames shown\n", shown_);
  return kExitOk;
}

int run(const ViewOptions& command) {
  auto provider = command.source.is_stream() ? view::make_stream_provider(command.source)
                                             : view::make_scenario_provider(command.source);
  if (!provider) return fail_call(provider.error());
  constexpr std::uint32_t kWidth = 1056;  // 1.5 times 640 and the colour bar
  constexpr std::uint32_t kHeight = 768;
  auto window = view::Window::create("emit view", kWidth, kHeight);
  if (!window) return fail(window.error());
  const InterruptGuard interrupt;
  return Viewer(command, **provider, **window).run();
}

void add_options(CommandLine& line, ViewOptions& options) {
  line.option("source", options.source.source,
              "Scenario name, .toml file, tcp://, udp:// or shm:// URL")
      .required()
      .type_name("SCENARIO|URL");
  add_set(line, options.source.set);
  line.option("--time-s", options.source.time_s, "Scenario: simulated time to start from, s")
      .type_name("S");
  line.option("--min", options.min_value, "Lower limit of the colours, K or W m-2 sr-1");
  line.option("--max", options.max_value, "Upper limit of the colours, K or W m-2 sr-1");
  line.option("--name", options.source.channel_name, "URL: channel").type_name("NAME");
  line.option("--channel", options.source.channel_kind, "URL: channel kind")
      .one_of({"injection", "projector"});
  line.option("--band", options.source.band, "Name of the band").type_name("NAME");
  line.count("--frames", options.frames,
             "Close after this many frames; 0: until the window closes");
  add_security(line, options.source.security);
  line.png_file("--screenshot", options.screenshot, "Write the window's last picture as PNG");
  add_gpu(line, options.source.gpu_index);
}

}  // namespace

void add_view(CommandLine& tool) {
  tool.command<ViewOptions>(
      {.name = "view",
       .text = "Live window: a scenario, or the stream of a running daemon",
       .example =
           "emit view airfield    or    emit view tcp://127.0.0.1:7000\n"
           "Keys, scenario only: arrows or dragging with the left button turn; W/S or the wheel "
           "move\n"
           "  forward/back along the view, A/D left/right, E/Q up/down; space pauses;\n"
           "  ] or PgUp jumps 60 s ahead, [ or PgDn 60 s back; Home or H back to the scenario's "
           "view\n"
           "Keys, always: - = lower limit of the colours down/up, comma and period upper limit "
           "down/up\n"
           "  (number pad: - + and / *), R limits from the picture, T radiance or temperature, Esc "
           "closes"},
      add_options, run);
}

}  // namespace emit::tool
