// SPDX-License-Identifier: Apache-2.0
#include "bench/frame_time/paper_errors.hpp"

#include <utility>

#include "emit/physics/check.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using physics::Result;

bool same_view(const reference::SolveView& a, const reference::SolveView& b) {
  return a.sim_time_ns == b.sim_time_ns && a.width_px == b.width_px && a.height_px == b.height_px &&
         a.fov_h_rad == b.fov_h_rad &&
         a.sensor_pose.position_world_m == b.sensor_pose.position_world_m &&
         a.sensor_pose.world_from_body == b.sensor_pose.world_from_body;
}

}  // namespace

PaperReference::PaperReference(ConvergedHistory history, std::string label, std::uint32_t pixels)
    : history_(std::move(history)), label_(std::move(label)) {
  options_.pixels = pixels;
}

Result<PaperReference> PaperReference::create(const scene::ScenarioDesc& scenario,
                                              std::string label, std::uint32_t pixels) {
  auto history = ConvergedHistory::create(scenario);
  if (!history) return tl::unexpected(std::move(history.error()));
  return PaperReference(std::move(*history), std::move(label), pixels);
}

Result<std::size_t> PaperReference::picture_of(const reference::SolveView& view) {
  for (std::size_t i = 0; i < pictures_.size(); ++i) {
    if (same_view(pictures_[i].view, view)) return i;
  }
  Progress progress("reference of " + label_, kShareParts);
  ConvergedOptions options = options_;
  options.progress = share_of(progress);
  auto pixels = history_.picture(view, options);
  if (!pixels) return tl::unexpected(std::move(pixels.error()));
  pictures_.push_back({view, std::move(*pixels)});
  return pictures_.size() - 1;
}

Result<PaperErrors> PaperReference::judge(std::span<const JudgedFrame> frames) {
  std::vector<float> drawn_k;
  std::vector<float> truth_k;
  std::vector<std::uint8_t> surface;
  std::vector<std::uint8_t> outline;
  for (const JudgedFrame& frame : frames) {
    EMIT_CHECK_OP(frame.temperature_k.size(), ==,
                  std::size_t{frame.view.width_px} * frame.view.height_px);
    const auto index = picture_of(frame.view);
    if (!index) return tl::unexpected(index.error());
    for (const ConvergedPixel& pixel : pictures_[*index].pixels) {
      drawn_k.push_back(frame.temperature_k[pixel.pixel]);
      truth_k.push_back(pixel.temperature_k);
      surface.push_back(pixel.outline ? 0 : 1);
      outline.push_back(pixel.outline ? 1 : 0);
    }
  }
  return PaperErrors{summarize_error(drawn_k, truth_k, surface, false),
                     summarize_error(drawn_k, truth_k, outline, false)};
}

}  // namespace emit::tool
