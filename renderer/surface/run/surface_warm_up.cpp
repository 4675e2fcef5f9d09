// SPDX-License-Identifier: Apache-2.0
#include "surface/run/surface_warm_up.hpp"

#include <fmt/format.h>

#include <system_error>
#include <utility>

#include "surface/model/history_record.hpp"

namespace emit::renderer {

SurfaceWarmUp::SurfaceWarmUp(const Inputs& inputs) : in_(inputs) {
  for (const PoseHistory& entity : in_.world.entities) {
    placements_.push_back(placement_of(entity.at(in_.start_ns), in_.geometry.origin_world_m()));
  }
}

std::vector<std::vector<glm::vec3>> SurfaceWarmUp::ways_m() const {
  std::vector<std::vector<glm::vec3>> ways;
  const auto rel_m = [&](const physics::Pose& pose) {
    return glm::vec3(pose.position_world_m - in_.geometry.origin_world_m());
  };
  for (const PoseHistory& entity : in_.world.entities) {
    std::vector<glm::vec3>& way = ways.emplace_back();
    way.push_back(rel_m(entity.at(in_.start_ns).pose));
    for (const scene::Keyframe& key : entity.script()) {
      if (key.sim_time_ns > in_.start_ns) way.push_back(rel_m(key.pose));
    }
  }
  return ways;
}

physics::Result<SurfaceModel> SurfaceWarmUp::build() const {
  const SurfaceGeometry& geometry = in_.geometry;
  // Make the record of the past.
  in_.plan.update(in_.start_ns, in_.world.environment, in_.world.entities, in_.world.parts);
  in_.history.update(in_.plan, in_.world.environment);
  const HistoryRecord record =
      make_history_record(in_.plan, in_.history,
                          {in_.heat, in_.world.environment, in_.world.entities, in_.rays,
                           geometry.origin_world_m(), in_.world.parts});
  // Place samples and integrate their past.
  const std::vector<std::vector<glm::vec3>> ways_m = this->ways_m();
  const SurfaceInputs inputs{geometry.geometry(),
                             geometry.materials(),
                             geometry.entity_of_object(),
                             geometry.rays(),
                             geometry.places(),
                             geometry.joints(),
                             in_.heat,
                             in_.history,
                             record,
                             placements_,
                             geometry.detail(),
                             ways_m,
                             in_.options.exchange ? in_.world.lights : nullptr};
  auto model = build_surface_model(inputs, in_.view, in_.options, in_.progress);
  if (!model) return model;
  model->at_ns = in_.start_ns;
  model->eyes = in_.view.eyes;
  return model;
}

StateKey SurfaceWarmUp::key_of(const SavedSurface& saved, std::int64_t at_ns) const {
  StateKey key = saved.key;
  key[static_cast<std::size_t>(StatePart::live)] =
      live_hash(at_ns, in_.world.environment, in_.world.entities, in_.world.parts);
  return key;
}

physics::Result<std::optional<SurfaceModel>> SurfaceWarmUp::take(const SavedSurface& saved) const {
  const StateWanted wanted{[&](std::int64_t at_ns) { return key_of(saved, at_ns); },
                           saved.start ? in_.earliest_ns : in_.start_ns, in_.start_ns};
  auto read =
      read_state(saved.file, wanted, in_.geometry.geometry(), placements_.size(), in_.options);
  if (!read) {
    if (!saved.start) return std::nullopt;
    return tl::unexpected(std::move(read.error()));
  }
  // Refuse a state for another camera.
  if (saved.fits_camera && !saved.fits_camera(read->eyes)) {
    if (!saved.start) return std::nullopt;
    return physics::make_error(
        physics::ErrorCode::config,
        fmt::format("thermal.state_file {}: the surface in it was refined for other places of the "
                    "camera than that of the first frame. Remove it to have it made anew",
                    saved.file.string()));
  }
  // Bring plan and history to the instant of the state.
  in_.plan.update(read->at_ns, in_.world.environment, in_.world.entities);
  in_.history.update(in_.plan, in_.world.environment);
  return std::move(*read);
}

physics::Result<SurfaceWarmUp::Made> SurfaceWarmUp::make(
    const std::optional<SavedSurface>& saved) const {
  // Read the file if it exists. An error of the look-up is left to read_state(), which reports it.
  std::error_code error;
  if (saved && (std::filesystem::exists(saved->file, error) || error)) {
    auto taken = take(*saved);
    if (!taken) return tl::unexpected(std::move(taken.error()));
    if (*taken) return Made{std::move(**taken), false};
  }
  const bool writes = saved && saved->start;
  // Test the file before the long work, not after it.
  if (writes) {
    if (auto writable = check_state_writable(saved->file); !writable) {
      return tl::unexpected(std::move(writable.error()));
    }
  }
  auto model = build();
  if (!model) return tl::unexpected(std::move(model.error()));
  return Made{std::move(*model), writes};
}

physics::Result<void> SurfaceWarmUp::save(const SavedSurface& saved,
                                          const SurfaceModel& model) const {
  return write_state(saved.file, key_of(saved, model.at_ns), model);
}

}  // namespace emit::renderer
