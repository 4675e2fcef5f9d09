// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "agents/frame_source.hpp"
#include "agents/messages.hpp"
#include "agents/render/canned_marker.hpp"
#include "emit/image/exr_image.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Source that shows image (frame number - 1) mod count, from a second set while the marker entity
/// is on. A slot stands for one image, so that the slot rules of a real renderer apply here as
/// well.
class CannedSource final : public FrameSource {
 public:
  /// `marked` has as many images as `images`, or none.
  CannedSource(std::vector<std::vector<float>> images, std::vector<std::vector<float>> marked,
               SourceInfo info)
      : images_(std::move(images)),
        marked_(std::move(marked)),
        info_(std::move(info)),
        views_(info_.slots) {
    for (auto& view : views_) {
      view.radiance_w_m2_sr.resize(info_.planes);
      view.width_px = info_.width_px;
      view.height_px = info_.height_px;
    }
  }

  std::size_t apply_entities(std::int64_t /*sim_time_ns*/,
                             std::span<const renderer::EntityUpdate> updates) noexcept override {
    for (const renderer::EntityUpdate& update : updates) {
      if (update.entity_id == kCannedMarkerEntity) {
        marker_on_ = update.on;
      }
    }
    return updates.size();
  }
  bool apply_weather(const scene::WeatherSample& /*sample*/) noexcept override { return true; }
  void reset() noexcept override { marker_on_ = false; }

  int submit(const renderer::FrameRequest& request) noexcept override {
    for (std::size_t slot = 0; slot < views_.size(); ++slot) {
      if (used_[slot].load(std::memory_order_acquire)) {
        continue;
      }
      used_[slot].store(true, std::memory_order_relaxed);
      renderer::FrameView& view = views_[slot];
      view.frame_number = request.frame_number;
      view.sim_time_ns = request.sim_time_ns;
      view.sensor_pose = request.sensor_pose;
      const std::size_t image =
          static_cast<std::size_t>((request.frame_number + images_.size() - 1) % images_.size());
      std::fill(
          view.radiance_w_m2_sr.begin(), view.radiance_w_m2_sr.end(),
          std::span<const float>(marker_on_ && !marked_.empty() ? marked_[image] : images_[image]));
      return static_cast<int>(slot);
    }
    return -1;
  }
  bool poll(renderer::SlotIndex /*slot*/) noexcept override { return true; }
  const renderer::FrameView& collect(renderer::SlotIndex slot) noexcept override {
    return views_[slot];
  }
  void release(renderer::SlotIndex slot) noexcept override {
    used_[slot].store(false, std::memory_order_release);
  }
  const SourceInfo& info() const noexcept override { return info_; }

 private:
  std::vector<std::vector<float>> images_;
  std::vector<std::vector<float>> marked_;
  bool marker_on_ = false;
  SourceInfo info_;
  std::vector<renderer::FrameView> views_;
  std::array<std::atomic<bool>, kMaxSlots> used_{};
};

void paint_marker(const config::SourceConfig& source, std::vector<float>& image) {
  const std::size_t rows = (source.canned_height_px + 7) / 8;
  const std::size_t columns = (source.canned_width_px + 7) / 8;
  for (std::size_t row = 0; row < rows; ++row) {
    std::fill_n(image.begin() + static_cast<std::ptrdiff_t>(row * source.canned_width_px), columns,
                kCannedMarkerRadiance);
  }
}

physics::Result<std::vector<std::vector<float>>> load_folder(const std::filesystem::path& folder,
                                                             SourceInfo& info) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("frame_") && entry.path().extension() == ".exr") {
      files.push_back(entry.path());
    }
  }
  if (error) {
    return make_error(ErrorCode::not_found,
                      fmt::format("source.canned_dir {}: {}", folder.string(), error.message()));
  }
  if (files.empty()) {
    return make_error(ErrorCode::not_found,
                      fmt::format("source.canned_dir {}: no frame_*.exr", folder.string()));
  }
  std::sort(files.begin(), files.end());
  std::vector<std::vector<float>> images;
  for (const auto& file : files) {
    auto image = image::read_exr(file);
    if (!image) {
      return tl::unexpected<physics::Error>(std::move(image.error()));
    }
    const image::ExrChannel* radiance = image->find(image::kRadianceChannel);
    if (radiance == nullptr) {
      return make_error(ErrorCode::parse, file.string() + ": no channel 'radiance'");
    }
    if (images.empty()) {
      info.width_px = image->width_px;
      info.height_px = image->height_px;
    } else if (image->width_px != info.width_px || image->height_px != info.height_px) {
      return make_error(
          ErrorCode::parse,
          fmt::format("{}: {} x {}, but the first frame is {} x {}", file.string(), image->width_px,
                      image->height_px, info.width_px, info.height_px));
    }
    images.push_back(radiance->pixels);
  }
  return images;
}

}  // namespace

/// A ramp of plausible radiance with a hot disc that walks along the diagonal. Every frame differs,
/// and rows, columns and order can be recognised by eye and by program.
std::vector<std::vector<float>> canned_pattern(const config::SourceConfig& source) {
  std::vector<std::vector<float>> images(source.canned_frames);
  const double width = source.canned_width_px;
  const double height = source.canned_height_px;
  const double radius = std::max(2.0, height / 16.0);
  for (std::size_t i = 0; i < images.size(); ++i) {
    const double phase = (static_cast<double>(i) + 0.5) / static_cast<double>(images.size());
    images[i].reserve(std::size_t{source.canned_width_px} * source.canned_height_px);
    for (std::uint32_t row = 0; row < source.canned_height_px; ++row) {
      for (std::uint32_t column = 0; column < source.canned_width_px; ++column) {
        const double x = column + 0.5;
        const double y = row + 0.5;
        const bool hot = std::hypot(x - phase * width, y - phase * height) < radius;
        images[i].push_back(
            static_cast<float>(hot ? 120.0 : 25.0 + 20.0 * x / width + 5.0 * y / height));
      }
    }
  }
  return images;
}

physics::Result<std::unique_ptr<FrameSource>> make_canned_source(const config::SourceConfig& source,
                                                                 std::uint32_t slots,
                                                                 std::size_t planes) {
  SourceInfo info;
  info.canned = true;
  info.slots = std::clamp<std::uint32_t>(slots, 2, kMaxSlots);
  info.planes = std::max<std::size_t>(planes, 1);
  if (source.canned_dir.empty()) {
    if (source.canned_width_px == 0 || source.canned_height_px == 0 || source.canned_frames == 0) {
      return make_error(ErrorCode::config, "source: a test pattern needs width, height and frames");
    }
    info.width_px = source.canned_width_px;
    info.height_px = source.canned_height_px;
    info.device = "canned: test pattern";
    auto images = canned_pattern(source);
    auto marked = images;
    for (auto& image : marked) {
      paint_marker(source, image);
    }
    return std::make_unique<CannedSource>(std::move(images), std::move(marked), std::move(info));
  }
  auto images = load_folder(source.canned_dir, info);
  if (!images) {
    return tl::unexpected<physics::Error>(std::move(images.error()));
  }
  info.device = "canned: " + source.canned_dir.string();
  return std::make_unique<CannedSource>(std::move(*images), std::vector<std::vector<float>>{},
                                        std::move(info));
}

}  // namespace emit::server
