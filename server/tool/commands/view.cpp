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
#include "tool/view/time_bar.hpp"
#include "tool/view/view_picture.hpp"
#include "tool/view/window.hpp"

namespace emit::tool {
namespace {

struct ViewOptions {
  view::SourceOptions source;
  std::optional<double> min_value;
  std::optional<double> max_value;
  std::uint64_t frames = 0;
  std::optional<std::filesystem::path> screenshot;
  std::string overlay = "picture";
  std::optional<std::filesystem::path> reference;
};

using view::Key;
using view::Overlay;
using view::ViewControl;
using view::ViewFrame;

struct Limits {
  double low = 0.0;
  double high = 1.0;
};

constexpr image::Rgb kInk{255, 255, 255};
constexpr image::Rgb kShade{0, 0, 0};

/// Writes a line of text with a shadow.
void write_line(image::RgbImage& picture, const std::string& text, std::int32_t y_px,
                std::uint32_t scale) {
  image::draw_text(picture, text, 7, y_px + 1, kShade, scale);
  image::draw_text(picture, text, 6, y_px, kInk, scale);
}

/// Writes the materials in view, each with its colour.
void write_materials(image::RgbImage& picture, const ViewFrame& frame, std::int32_t y_px) {
  constexpr std::size_t kMostLines = 12;
  constexpr std::int32_t kLinePx = 10;
  if (!frame.material_names) return;
  std::size_t lines = 0;
  for (const view::MaterialShare& each : view::material_shares(frame)) {
    if (++lines > kMostLines) break;
    const std::string text =
        fmt::format("{} {:.1f} %", (*frame.material_names)[each.material], 100.0 * each.frac);
    image::draw_text(picture, text, 7, y_px + 1, kShade);
    image::draw_text(picture, text, 6, y_px, view::material_color(each.material, 1.0));
    y_px += kLinePx;
  }
}

/// State of the viewer: which quantity is shown between which limits, and the camera's commands.
class Viewer {
 public:
  Viewer(const ViewOptions& command, view::FrameProvider& provider, view::Window& window,
         std::optional<view::ReferencePicture> reference)
      : command_(command),
        provider_(provider),
        window_(window),
        reference_(std::move(reference)),
        overlay_(*view::overlay_of(command.overlay)) {
    // A reference is of one instant.
    control_.paused = reference_.has_value();
    control_.samples = overlay_ == Overlay::samples;
    provider.limits(temperature_.low, temperature_.high);
    if (command.min_value) temperature_.low = *command.min_value;
    if (command.max_value) temperature_.high = *command.max_value;
  }

  int run();

 private:
  void handle(const view::WindowInput& input);
  void handle(Key key);
  void auto_range();
  void choose(Overlay overlay);
  void explain();
  void slide(bool left_down);
  void draw(image::RgbImage* read_back);
  void write(image::RgbImage& picture, const view::PictureError* error) const;
  [[nodiscard]] std::string cursor_text() const;
  [[nodiscard]] std::span<const float> values() const {
    return show_radiance_ ? std::span<const float>(frame_.radiance_w_m2_sr)
                          : std::span<const float>(frame_.temperature_k);
  }
  Limits& limits() {
    if (overlay_ == Overlay::error) return show_radiance_ ? radiance_error_ : temperature_error_;
    return show_radiance_ ? radiance_ : temperature_;
  }

  const ViewOptions& command_;
  view::FrameProvider& provider_;
  view::Window& window_;
  std::optional<view::ReferencePicture> reference_;
  Overlay overlay_;
  image::ColorMap map_ = image::ColorMap::thermal;
  std::string refusal_;  ///< why the overlay cannot be shown
  ViewFrame frame_;
  ViewControl control_;
  Limits temperature_;
  Limits radiance_;
  Limits temperature_error_{-1.0, 1.0};
  Limits radiance_error_{-0.1, 0.1};
  std::optional<glm::uvec2> reported_px_;  ///< pixel whose report is shown
  std::shared_ptr<const std::vector<std::string>> printed_;
  bool left_down_ = false;
  bool sliding_ = false;  ///< the left button went down on the bar of the day
  std::optional<double> wanted_h_;
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
      control_ = ViewControl{.paused = control_.paused,
                             .samples = control_.samples,
                             .quality_level = control_.quality_level,
                             .jump_s = control_.jump_s,
                             .home = true};
      break;
    case Key::overlay_1:
    case Key::overlay_2:
    case Key::overlay_3:
    case Key::overlay_4:
    case Key::overlay_5:
    case Key::overlay_6:
      choose(static_cast<Overlay>(static_cast<int>(key) - static_cast<int>(Key::overlay_1)));
      break;
    case Key::color_map:
      map_ = map_ == image::ColorMap::thermal ? image::ColorMap::grey : image::ColorMap::thermal;
      break;
    case Key::quality_level:
      // The last level takes the place of all above it: full quality comes next.
      control_.quality_level = static_cast<std::uint8_t>(
          frame_.quality_level < control_.quality_level ? 0 : control_.quality_level + 1);
      break;
    case Key::explain:
      explain();
      break;
    case Key::close:
      close_ = true;
      break;
  }
}

void Viewer::handle(const view::WindowInput& input) {
  close_ = close_ || input.closed;
  for (const Key key : input.keys) handle(key);
  slide(input.left_down);
  constexpr double kDragRadPerPx = 0.002;
  if (!sliding_) {
    control_.yaw_rad += kDragRadPerPx * input.drag_x_px;
    control_.pitch_rad -= kDragRadPerPx * input.drag_y_px;
  }
  if (input.right_press) explain();
  control_.forward_m += 2.0 * input.wheel;
  provider_.control(control_);
  control_.jump_s = control_.forward_m = control_.right_m = control_.up_m = 0.0;
  control_.home = false;
  control_.report_px.reset();
}

void Viewer::choose(Overlay overlay) {
  overlay_ = overlay;
  control_.samples = overlay == Overlay::samples;
}

/// Asks for the report of the pixel under the cursor, or takes the report away that is shown of it.
void Viewer::explain() {
  const auto at = window_.cursor();
  if (!at || at->x_px >= frame_.width_px || at->y_px >= frame_.height_px) return;
  const glm::uvec2 px{at->x_px, at->y_px};
  if (reported_px_ == px) {
    reported_px_.reset();
    return;
  }
  reported_px_ = control_.report_px = px;
}

/// Follows the left button on the bar of the day. The jump begins where it is let go.
void Viewer::slide(bool left_down) {
  const auto now_h = provider_.solar_hour(frame_.sim_time_ns);
  const auto at = window_.cursor();
  const auto hour = now_h && at
                        ? view::bar_hour(at->x_px, at->y_px, frame_.width_px, frame_.height_px)
                        : std::nullopt;
  if (left_down && !left_down_) sliding_ = hour.has_value();
  if (sliding_ && hour) wanted_h_ = hour;
  if (sliding_ && !left_down) {
    if (wanted_h_) control_.jump_s += 3600.0 * (*wanted_h_ - *now_h);
    wanted_h_.reset();
    sliding_ = false;
  }
  left_down_ = left_down;
}

void Viewer::auto_range() {
  if (overlay_ == Overlay::error) {
    if (!reference_) return;
    const auto error = view::picture_error(frame_, *reference_, show_radiance_);
    if (!error || !(error->stats.p99 > 0.0)) return;
    limits() = {-error->stats.p99, error->stats.p99};
    return;
  }
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

/// Writes what is shown, the cursor's values, and what belongs to the overlay.
void Viewer::write(image::RgbImage& picture, const view::PictureError* error) const {
  const double time_s = 1e-9 * static_cast<double>(frame_.sim_time_ns);
  std::string status = fmt::format("T {:.2f} S  {:.0f} MS{}", time_s, frame_.frame_ms,
                                   control_.paused ? "  PAUSED" : "");
  if (frame_.quality_level > 0) {
    status += fmt::format("  LEVEL {}", frame_.quality_level);
  }
  if (const auto done_frac = provider_.travelled_frac()) {
    status += fmt::format("  TO THE NEW TIME: {:.0f} %", 100.0 * *done_frac);
  }
  write_line(picture, status, 6, 2);
  std::int32_t y_px = 24;
  if (const std::string cursor = cursor_text(); !cursor.empty()) {
    write_line(picture, cursor, y_px, 2);
    y_px += 18;
  }
  if (!refusal_.empty()) {
    write_line(picture, refusal_, y_px, 2);
    y_px += 18;
  }
  if (error != nullptr) {
    write_line(picture,
               fmt::format("error rms {:.3g} p99 {:.3g} max {:.3g} mean {:.3g}", error->stats.rms,
                           error->stats.p99, error->stats.max_abs, error->stats.mean),
               y_px, 2);
    y_px += 18;
    if (!error->same_view) {
      write_line(picture, "not the view or the instant of the reference", y_px, 2);
      y_px += 18;
    }
  }
  if (overlay_ == Overlay::materials) write_materials(picture, frame_, y_px);
  if (overlay_ == Overlay::samples) {
    write_line(picture, fmt::format("samples in {} pixels", frame_.sample_px.size()), y_px, 1);
  }
  if (reported_px_ && frame_.report) {
    constexpr std::int32_t kLinePx = 10;
    const auto lines = static_cast<std::int32_t>(frame_.report->size());
    std::int32_t line_y_px = static_cast<std::int32_t>(picture.height_px) - kLinePx * lines -
                             static_cast<std::int32_t>(view::kTimeBarPx) - 6;
    for (const std::string& line : *frame_.report) {
      write_line(picture, line, line_y_px, 1);
      line_y_px += kLinePx;
    }
  }
  if (const auto now_h = provider_.solar_hour(frame_.sim_time_ns)) {
    view::draw_time_bar(picture, frame_.width_px, *now_h, wanted_h_);
  }
}

void Viewer::draw(image::RgbImage* read_back) {
  view::PictureOptions options{overlay_, map_, show_radiance_, limits().low, limits().high};
  std::optional<view::PictureError> error;
  refusal_.clear();
  if (overlay_ == Overlay::error && reference_) {
    auto found = view::picture_error(frame_, *reference_, show_radiance_);
    if (found) {
      error = std::move(*found);
    } else {
      refusal_ = found.error().text;
    }
  }
  auto picture = view::draw_picture(frame_, options, error ? &*error : nullptr);
  if (!picture) {
    if (refusal_.empty()) refusal_ = picture.error().text;
    const Limits& range = show_radiance_ ? radiance_ : temperature_;
    options = {Overlay::picture, map_, show_radiance_, range.low, range.high};
    picture = view::draw_picture(frame_, options, nullptr);
    if (!picture) return;
  }
  if (reported_px_ && frame_.report && frame_.report != printed_) {
    printed_ = frame_.report;
    for (const std::string& line : *printed_) fmt::print("{}\n", line);
    std::fflush(stdout);
  }
  write(*picture, error ? &*error : nullptr);
  const std::string cursor = cursor_text();
  const double time_s = 1e-9 * static_cast<double>(frame_.sim_time_ns);
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

/// Reads the reference, and takes its instant unless another one is asked for.
physics::Result<std::optional<view::ReferencePicture>> reference_of(const ViewOptions& command,
                                                                    view::SourceOptions& source) {
  if (!command.reference) return std::optional<view::ReferencePicture>();
  auto reference = view::read_reference(*command.reference, source.band);
  if (!reference) return tl::unexpected(std::move(reference.error()));
  if (!source.time_s && !source.is_stream() && reference->metadata) {
    source.time_s = 1e-9 * static_cast<double>(reference->metadata->sim_time_ns);
  }
  return std::optional<view::ReferencePicture>(std::move(*reference));
}

int run(const ViewOptions& command) {
  view::SourceOptions source = command.source;
  const auto overlay = view::overlay_of(command.overlay);
  if (source.is_stream() && *overlay != Overlay::picture && *overlay != Overlay::error) {
    return fail(kExitUsage,
                fmt::format("--overlay {}: a stream has pixels alone", command.overlay));
  }
  if (*overlay == Overlay::error && !command.reference) {
    return fail(kExitUsage, "--overlay error needs --reference");
  }
  auto reference = reference_of(command, source);
  if (!reference) return fail_call(reference.error());
  auto provider = source.is_stream() ? view::make_stream_provider(source)
                                     : view::make_scenario_provider(source);
  if (!provider) return fail_call(provider.error());
  if (*reference && (*reference)->metadata && (*reference)->metadata->band_name != "" &&
      (*reference)->metadata->band_name != (*provider)->band()) {
    warn(fmt::format("{}: its radiance is of band '{}', not '{}'", command.reference->string(),
                     (*reference)->metadata->band_name, (*provider)->band()));
    (*reference)->radiance_w_m2_sr.clear();
  }
  constexpr std::uint32_t kWidth = 1056;  // 1.5 times 640 and the colour bar
  constexpr std::uint32_t kHeight = 768;
  auto window = view::Window::create("emit view", kWidth, kHeight);
  if (!window) return fail(window.error());
  const InterruptGuard interrupt;
  return Viewer(command, **provider, **window, std::move(*reference)).run();
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
  line.option("--overlay", options.overlay,
              "What the picture shows at first; keys 1 to 6 change it. `error` is the picture less "
              "--reference")
      .one_of({"picture", "materials", "samples", "sun", "sky", "error"});
  line.path("--reference", options.reference,
            "Picture to hold frames against: EXR file of `emit solve` or `emit render`. A scenario "
            "starts at its instant, paused")
      .type_name("FILE");
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
           "view;\n"
           "  the bar below the picture is the local solar day: press or drag there to jump;\n"
           "  2 materials, 3 thermal samples, 4 sun, 5 sky; right button or X explains the pixel "
           "under\n"
           "  the cursor; L next quality level\n"
           "Keys, always: - = lower limit of the colours down/up, comma and period upper limit "
           "down/up\n"
           "  (number pad: - + and / *), R limits from the picture, T radiance or temperature, M "
           "colour map,\n"
           "  1 picture, 6 error against --reference, Esc closes"},
      add_options, run);
}

}  // namespace emit::tool
