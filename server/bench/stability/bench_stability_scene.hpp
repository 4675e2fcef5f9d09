// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/weather.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"

/// Small generated worlds whose temperatures are known in double, for the benchmarks that judge
/// frames. Setup only.
namespace emit::tool {

/// Flat quadrilateral, corners counter-clockwise seen from outside; world axes, m.
struct FlatFace {
  std::array<glm::dvec3, 4> corners;
};

/// An object of flat faces that share one normal and one material: object id i + 1 of the frame is
/// part i of the world.
struct FlatPart {
  std::string name;
  std::vector<FlatFace> faces;
  glm::dvec3 normal{0.0, 0.0, 1.0};
  std::string material = "surface";
  bool open = false;  ///< nothing ever stands between the part and the sun
  glm::dvec3 placed_at_m{0.0};
  double scale = 1.0;  ///< scale of the object; the file's vertices are divided by it
};

/// Makes a horizontal rectangle facing up.
[[nodiscard]] FlatPart level_part(std::string name, const glm::dvec3& centre_m, double half_east_m,
                                  double half_north_m);
/// Makes a rectangle around `centre_m` facing `normal`.
[[nodiscard]] FlatPart tilted_part(std::string name, const glm::dvec3& centre_m,
                                   const glm::dvec3& normal, double half_m);
/// Makes five parts of an upright box, the open top first.
[[nodiscard]] std::vector<FlatPart> box_parts(const glm::dvec3& low_m, const glm::dvec3& high_m);

/// A folder in the system's temporary directory, removed with everything in it.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  /// Returns the path; empty when the folder could not be created.
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

/// Makes a scenario with asphalt of two modes, no atmosphere, bands 8-12 and 3-5, and a clear June
/// sky at 48.56 N. Sim time 0 is 06:00 UTC and the history's start.
[[nodiscard]] scene::ScenarioDesc plain_scenario(std::uint32_t width_px, std::uint32_t height_px);

/// Writes the parts as glTF into `folder` and makes them the scenario's objects.
/// Errors: io, naming the file.
[[nodiscard]] physics::Result<void> place_parts(std::span<const FlatPart> parts,
                                                const std::filesystem::path& folder,
                                                scene::ScenarioDesc& scenario);

/// A frame that outlives its renderer.
struct StoredFrame {
  std::uint32_t width_px = 0;
  std::vector<std::vector<float>> radiance_w_m2_sr;
  std::vector<float> temperature_k;
  std::vector<float> depth_m;
  std::vector<float> object_id;
  renderer::FrameStats stats;
  std::string device;
};

/// Renders one frame with a fresh renderer; `prepare` may hand over live input first.
[[nodiscard]] physics::Result<StoredFrame> render_once(
    const scene::ScenarioDesc& scenario, const physics::Pose& sensor, std::int64_t sim_time_ns,
    int gpu_index, const std::function<void(renderer::Renderer&)>& prepare = {});
/// Renders one frame with a running renderer that was created with all channels.
[[nodiscard]] physics::Result<StoredFrame> render_next(renderer::Renderer& renderer,
                                                       const physics::Pose& sensor,
                                                       std::int64_t sim_time_ns);
[[nodiscard]] physics::Result<std::unique_ptr<renderer::Renderer>> open_renderer(
    const scene::ScenarioDesc& scenario, int gpu_index);

/// Returns the pose of a camera at `eye_m` that looks at `target_m`.
[[nodiscard]] physics::Pose looking_at(const glm::dvec3& eye_m, const glm::dvec3& target_m);

/// Returns the world point that a pixel shows.
[[nodiscard]] glm::dvec3 point_of_pixel(const scene::SensorDesc& sensor, const physics::Pose& pose,
                                        std::size_t pixel, double depth_m);

/// The published model in double at points of flat faces: the same nodes as the renderer (uniform
/// spacing), equilibrium linear between them, sky factor 0.5. Sun and weather are computed once.
class PointHistory {
 public:
  PointHistory(const scene::ScenarioDesc& scenario, std::int64_t sim_time_ns, std::uint32_t steps);

  [[nodiscard]] std::size_t intervals() const noexcept { return nodes_.size() - 1; }
  [[nodiscard]] std::int64_t middle_ns(std::size_t interval) const noexcept {
    return nodes_[interval].time_ns + (nodes_[interval + 1].time_ns - nodes_[interval].time_ns) / 2;
  }
  /// Returns the temperature. `sun_frac(interval)` is the visible share of the sun's disc, constant
  /// over the interval.
  [[nodiscard]] double temperature_k(const scene::Material& material, const glm::dvec3& normal,
                                     const std::function<double(std::size_t)>& sun_frac) const;
  /// Returns the equilibrium at a node.
  [[nodiscard]] double equilibrium_k(std::size_t node, const scene::Material& material,
                                     const glm::dvec3& normal, double sun_frac) const;
  [[nodiscard]] double node_s(std::size_t node) const noexcept {
    return 1e-9 * static_cast<double>(nodes_[node].time_ns - nodes_[0].time_ns);
  }

 private:
  struct Node {
    std::int64_t time_ns = 0;
    physics::SunPosition sun;
    physics::Forcing forcing;
  };
  std::vector<Node> nodes_;
  double initial_k_ = 0.0;
};

/// Returns the instant after `from_ns` at which the sun climbs through an elevation; empty where it
/// does not within a day.
[[nodiscard]] std::optional<std::int64_t> sun_rises_through_ns(const scene::ScenarioDesc& scenario,
                                                               std::int64_t from_ns,
                                                               double elevation_rad);

/// Returns the direction to the sun.
[[nodiscard]] glm::dvec3 direction_to_sun(const scene::ScenarioDesc& scenario,
                                          std::int64_t sim_time_ns);

}  // namespace emit::tool
