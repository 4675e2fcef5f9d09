// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "bench/stability/bench_stability_frames.hpp"
#include "bench/stability/bench_stability_judge.hpp"
#include "bench/stability/bench_stability_scene.hpp"

namespace emit::tool {

inline constexpr std::int64_t kSecondNs = 1'000'000'000;
inline constexpr std::int64_t kMorningNs = 12'600 * kSecondNs;  // 08:00 to 11:30 local time
inline constexpr std::int64_t kYearNs = 31'557'600 * kSecondNs;
/// Obscurance radius that is too small to cover a neighbouring pixel: the sky factor is that of a
/// flat face.
inline constexpr double kNoObscuranceM = 1e-6;

/// A scene ready to be rendered.
struct World {
  std::vector<FlatPart> parts;
  scene::ScenarioDesc scenario;
  physics::Pose camera;
  std::int64_t time_ns = kMorningNs;
};

/// Tests by name. One object runs one of them. Single thread.
class HostileFrames {
 public:
  explicit HostileFrames(const HostileFrameOptions& options) : options_(options) {}

  physics::Result<HostileFrameResult> run(const std::string& test);

 private:
  using Check = physics::Result<void> (HostileFrames::*)();
  struct Entry {
    const char* test;
    Check check;
    const char* note;
  };
  static const std::vector<Entry>& entries();
  friend std::vector<std::string> hostile_frame_tests();

  /// Makes ground, a box and a slab, seen from above.
  [[nodiscard]] World yard() const;
  /// Writes the files and renders. It counts values that are not finite.
  physics::Result<StoredFrame> frame(World& world, const std::string& name,
                                     const std::function<void(renderer::Renderer&)>& prepare = {});
  physics::Result<void> judged_by_model(World& world, const std::string& name);
  physics::Result<void> judged_by(World& world, const std::string& name,
                                  const StoredFrame& harmless);
  physics::Result<void> picture(const StoredFrame& frame, const std::string& name) const;

  physics::Result<void> low_sun();
  physics::Result<void> strong_low_sun();
  physics::Result<void> grazing_sun();
  physics::Result<void> grazing_view();
  physics::Result<void> coincident_faces();
  physics::Result<void> degenerate_triangles();
  physics::Result<void> far_from_origin();
  physics::Result<void> far_vertices();
  physics::Result<void> depth_range();
  physics::Result<void> depth_range_near_part();
  physics::Result<void> object_scale();
  physics::Result<void> world_scale();
  physics::Result<void> long_history();
  physics::Result<void> short_history();
  physics::Result<void> many_steps();
  physics::Result<void> extreme_materials();
  physics::Result<void> obscurance_radius();
  physics::Result<void> taps_and_maps();
  physics::Result<void> hostile_weather();
  physics::Result<void> hostile_camera();

  const HostileFrameOptions& options_;
  std::string test_;
  FrameJudge judge_;
  std::string extra_note_;
};

}  // namespace emit::tool
