// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/scene_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <optional>

#include "emit/reference/visibility.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::tool {
namespace {

using physics::Result;

/// Checks one loaded scene.
class Check {
 public:
  Check(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry,
        const reference::RayScene& rays)
      : scenario_(scenario),
        geometry_(geometry),
        rays_(rays),
        instant_(rays.at(first_ns(scenario))) {}

  SceneReport run() {
    for (const std::string& text : scenario_.warnings) add("loader", "", text);
    for (const std::string& text : geometry_.warnings) add("loader", "", text);
    for (std::uint32_t i = 0; i < scenario_.objects.size(); ++i) check_object(i);
    check_materials();
    check_camera();
    return std::move(report_);
  }

 private:
  static std::int64_t first_ns(const scene::ScenarioDesc& scenario) {
    return scenario.sensor.trajectory.empty() ? 0 : scenario.sensor.trajectory.front().sim_time_ns;
  }

  void add(const char* kind, const std::string& object, std::string text) {
    report_.findings.push_back({kind, object, std::move(text)});
  }

  /// An object much wider than it is high is terrain or ground.
  static bool is_flat(const glm::dvec3& size_m) {
    constexpr double kFlatFrac = 0.05;
    return size_m.z < kFlatFrac * std::max(size_m.x, size_m.y);
  }
  /// Land with hills, which may have any size: no vehicle is as low for its width.
  static bool is_land(const glm::dvec3& size_m) {
    constexpr double kLeastM = 500.0;
    constexpr double kLowFrac = 0.2;
    const double narrower_m = std::min(size_m.x, size_m.y);
    return narrower_m > kLeastM && size_m.z < kLowFrac * narrower_m;
  }

  void check_object(std::uint32_t index) {
    const scene::ObjectDesc& object = scenario_.objects[index];
    scene::Aabb bounds;
    ObjectFigures figures;
    figures.name = object.name;
    const scene::Instance* first = nullptr;
    for (const scene::Instance& instance : geometry_.instances) {
      if (instance.object != index) continue;
      figures.triangles += geometry_.meshes[instance.mesh].indices.size() / 3;
      if (instance.placement != 0) continue;
      bounds.add(instance.world_bounds);
      if (first == nullptr) first = &instance;
    }
    if (first == nullptr || bounds.empty()) {
      add("faces", object.name, "it has no triangles");
      return;
    }
    const glm::dvec3 size_m = bounds.max_m - bounds.min_m;
    figures.east_m = size_m.x;
    figures.north_m = size_m.y;
    figures.up_m = size_m.z;
    figures.lowest_m = bounds.min_m.z;
    report_.objects.push_back(figures);
    check_units(object, size_m);
    check_axes(object, size_m);
    check_ground(index, bounds);
    check_faces(index, bounds);
  }

  void check_units(const scene::ObjectDesc& object, const glm::dvec3& size_m) {
    const double largest_m = std::max({size_m.x, size_m.y, size_m.z});
    if ((is_flat(size_m) && largest_m > 1.0) || is_land(size_m)) return;
    const double scale = likely_scale(largest_m);
    if (scale == 1.0) {
      check_normalised(object, size_m);
      return;
    }
    add("units", object.name,
        fmt::format("its longest side is {:.4g} m; if it was exported in {}, set scale = {:g} "
                    "(now {:g})",
                    largest_m,
                    scale == 0.01    ? "centimetres"
                    : scale == 0.001 ? "millimetres"
                                     : "another unit",
                    object.scale * scale, object.scale));
  }

  /// Tools for games and for 3-D scans scale models to a longest side of 1 or 2, so that the other
  /// sides have odd numbers.
  void check_normalised(const scene::ObjectDesc& object, const glm::dvec3& size_m) {
    constexpr double kSameFrac = 1e-3;
    constexpr double kRoundM = 0.01;
    if (object.scale != 1.0) return;
    const double longest_m = std::max({size_m.x, size_m.y, size_m.z});
    const bool is_unit =
        std::abs(longest_m - 1.0) < kSameFrac || std::abs(longest_m - 2.0) < 2.0 * kSameFrac;
    const auto is_round = [&](double side_m) {
      const double steps = side_m / kRoundM;
      return std::abs(steps - std::round(steps)) < 0.02;
    };
    if (!is_unit || (is_round(size_m.x) && is_round(size_m.y) && is_round(size_m.z))) return;
    add("units", object.name,
        fmt::format("its longest side is {:.4g} m, as of models that a tool has scaled to a unit: "
                    "set scale to its true length over {:.4g}, and multiply the height in "
                    "position_m by it",
                    longest_m, longest_m));
  }

  void check_axes(const scene::ObjectDesc& object, const glm::dvec3& size_m) {
    // A vehicle is longer than it is wide, and wider than it is high.
    if (object.entity_id == 0) return;
    constexpr double kClearly = 1.5;
    const double longest_m = std::max(size_m.x, size_m.y);
    const double shortest_m = std::min(size_m.x, size_m.y);
    if (size_m.z > kClearly * longest_m) {
      add("axes", object.name,
          fmt::format("it is {:.3g} m high and {:.3g} m long, as a model that stands on its nose; "
                      "glTF has y up: see model_rotation_deg",
                      size_m.z, longest_m));
      return;
    }
    if (size_m.z > kClearly * shortest_m) {
      add("axes", object.name,
          fmt::format("it is {:.3g} m high and {:.3g} m wide, as a model that lies on its side; "
                      "glTF has y up: see model_rotation_deg",
                      size_m.z, shortest_m));
      return;
    }
    // Look at its own axes: the nose points along glTF +z.
    scene::Aabb body;
    for (const scene::Instance& instance : geometry_.instances) {
      if (&scenario_.objects[instance.object] != &object) continue;
      body.add(scene::transformed(geometry_.meshes[instance.mesh].bounds, instance.body_from_mesh));
    }
    const glm::dvec3 own_m = body.max_m - body.min_m;
    if (own_m.y > kClearly * own_m.x) {
      add("axes", object.name,
          fmt::format("it is {:.3g} m wide and {:.3g} m long in its own axes; the nose of a "
                      "vehicle points along glTF +z: see model_rotation_deg",
                      own_m.y, own_m.x));
    }
  }

  /// The box of an object at an instant, and how far its lowest point is above what lies under it.
  struct Footing {
    std::int64_t sim_time_ns = 0;
    double gap_m = 0.0;
    double slack_m = 0.0;  ///< a gap this wide is none
  };

  /// Returns the height of what lies under the middle and the corners of a box; minus infinity:
  /// nothing lies there.
  static double height_under(const reference::SceneInstant& instant, std::uint32_t index,
                             const scene::Aabb& bounds) {
    const glm::dvec3 size_m = bounds.max_m - bounds.min_m;
    constexpr double kAboveM = 1e-3;
    double ground_m = -std::numeric_limits<double>::infinity();
    for (const double x : {0.5, 0.1, 0.9}) {
      for (const double y : {0.5, 0.1, 0.9}) {
        glm::dvec3 from(bounds.min_m.x + x * size_m.x, bounds.min_m.y + y * size_m.y,
                        bounds.max_m.z + kAboveM);
        // Go on through the object itself.
        for (int hits = 0; hits < 64; ++hits) {
          const auto hit = instant.first_hit({from, {0.0, 0.0, -1.0}, 1e-6});
          if (!hit) break;
          if (hit->object != index) {
            ground_m = std::max(ground_m, hit->position_world_m.z);
            break;
          }
          from = hit->position_world_m - glm::dvec3(0.0, 0.0, 1e-5);
        }
      }
    }
    return ground_m;
  }

  static std::optional<Footing> footing_of(const reference::SceneInstant& instant,
                                           std::int64_t sim_time_ns, std::uint32_t index,
                                           const scene::Aabb& bounds, double slope) {
    const double ground_m = height_under(instant, index, bounds);
    if (!std::isfinite(ground_m)) return std::nullopt;
    const glm::dvec3 size_m = bounds.max_m - bounds.min_m;
    constexpr double kSlackFrac = 0.05;
    // A thing on a slope has ground beside it that is higher than its lowest wheel.
    const double slack_m =
        std::max(0.02, kSlackFrac * size_m.z) + 0.5 * slope * std::max(size_m.x, size_m.y);
    return Footing{sim_time_ns, bounds.min_m.z - ground_m, slack_m};
  }

  void check_ground(std::uint32_t index, const scene::Aabb& bounds) {
    const glm::dvec3 size_m = bounds.max_m - bounds.min_m;
    if (is_flat(size_m) || scenario_.objects.size() < 2) return;
    const scene::ObjectDesc& object = scenario_.objects[index];
    if (!object.trajectory.empty()) {
      check_path(index, size_m.z);
      return;
    }
    const auto footing = footing_of(instant_, first_ns(scenario_), index, bounds, 0.0);
    if (!footing) return;
    if (footing->gap_m > footing->slack_m) {
      add("ground", object.name,
          fmt::format("it floats {:.3g} m above what is under it", footing->gap_m));
    } else if (footing->gap_m < -footing->slack_m) {
      add("ground", object.name,
          fmt::format("it reaches {:.3g} m below what is under it, of {:.3g} m", -footing->gap_m,
                      size_m.z));
    }
  }

  /// Looks for ground along the way of an object. A vehicle that floats keeps its height above
  /// ground, below its own height; an aircraft does not.
  void check_path(std::uint32_t index, double height_m) {
    const scene::ObjectDesc& object = scenario_.objects[index];
    constexpr std::size_t kMostPlaces = 16;
    const std::size_t keys = object.trajectory.size();
    const std::size_t places = std::min(keys, kMostPlaces);
    std::optional<Footing> lowest;
    double highest_m = 0.0;
    for (std::size_t place = 0; place < places; ++place) {
      const std::size_t key = places == 1 ? 0 : place * (keys - 1) / (places - 1);
      const std::int64_t sim_time_ns = object.trajectory[key].sim_time_ns;
      const auto state = scene::trajectory_at(object.trajectory, sim_time_ns);
      if (!state.on) continue;
      const glm::dmat4 world_from_body = scene::world_from_body_matrix(state.pose);
      scene::Aabb bounds;
      for (const scene::Instance& instance : geometry_.instances) {
        if (instance.object != index) continue;
        bounds.add(scene::transformed(geometry_.meshes[instance.mesh].bounds,
                                      world_from_body * instance.body_from_mesh));
      }
      const double up = std::clamp(glm::normalize(glm::dvec3(world_from_body[2])).z, -1.0, 1.0);
      const auto footing =
          footing_of(rays_.at(sim_time_ns), sim_time_ns, index, bounds, std::sqrt(1.0 - up * up));
      if (!footing) continue;
      if (!lowest || footing->gap_m < lowest->gap_m) lowest = footing;
      highest_m = std::max(highest_m, footing->gap_m);
    }
    if (!lowest) return;
    const double at_s = 1e-9 * static_cast<double>(lowest->sim_time_ns);
    if (lowest->gap_m > lowest->slack_m && highest_m < height_m) {
      add("ground", object.name,
          fmt::format("it floats {:.3g} m above what is under it all along its trajectory",
                      lowest->gap_m));
    } else if (lowest->gap_m < -lowest->slack_m) {
      add("ground", object.name,
          fmt::format("it reaches {:.3g} m below what is under it at {:.3f} s of its trajectory",
                      -lowest->gap_m, at_s));
    }
  }

  /// Sends rays from all around to the middle of the object, and counts back faces among the first
  /// hits.
  void check_faces(std::uint32_t index, const scene::Aabb& bounds) {
    const glm::dvec3 middle_m = 0.5 * (bounds.min_m + bounds.max_m);
    const double radius_m = glm::distance(bounds.min_m, bounds.max_m);
    constexpr int kRays = 400;
    constexpr double kGolden = 2.399963229728653;
    int hits = 0;
    int back = 0;
    for (int i = 0; i < kRays; ++i) {
      // A spiral over the upper half of the sphere: nobody looks at the underside.
      const double z = (i + 0.5) / kRays;
      const double across = std::sqrt(1.0 - z * z);
      const glm::dvec3 outwards(across * std::cos(kGolden * i), across * std::sin(kGolden * i), z);
      const auto hit = instant_.first_hit({middle_m + radius_m * outwards, -outwards, 0.0});
      if (!hit || hit->object != index) continue;
      ++hits;
      back += hit->front ? 0 : 1;
    }
    constexpr double kMostFrac = 0.05;
    const double share = hits > 0 ? static_cast<double>(back) / hits : 0.0;
    if (share > kMostFrac) {
      add("faces", scenario_.objects[index].name,
          fmt::format("{:.0f} % of the faces seen from outside show their back; turn their normals "
                      "outwards in the modeller",
                      100.0 * share));
    }
  }

  void check_materials() {
    for (const scene::MaterialMapping& mapping : geometry_.mappings) {
      if (mapping.by != scene::MappedBy::fallback) continue;
      const std::string& name = scenario_.objects[mapping.object].name;
      add("material", name,
          fmt::format("glTF material '{}' is mapped by nothing and becomes '{}'; name it in "
                      "material_map",
                      mapping.gltf_material, mapping.material));
    }
  }

  void check_camera() {
    const scene::SensorDesc& sensor = scenario_.sensor;
    if (sensor.trajectory.empty()) {
      add("camera", "", "the sensor has no position: emit render needs one");
      return;
    }
    const physics::Pose pose = sensor.trajectory.front().pose;
    constexpr int kColumns = 32;
    const int rows =
        std::max(1, static_cast<int>(kColumns * sensor.height_px / std::max(1U, sensor.width_px)));
    const double half = std::tan(0.5 * sensor.fov_h_rad);
    int hits = 0;
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < kColumns; ++x) {
        const glm::dvec3 ray(1.0, half * (2.0 * (x + 0.5) / kColumns - 1.0),
                             half * (2.0 * (y + 0.5) - rows) / kColumns);
        hits += instant_.first_hit(
                    {pose.position_world_m, pose.world_from_body * glm::normalize(ray), 0.0})
                    ? 1
                    : 0;
      }
    }
    constexpr double kLeastFrac = 0.02;
    const double share = static_cast<double>(hits) / (rows * kColumns);
    if (share < kLeastFrac) {
      add("camera", "", fmt::format("{:.1f} % of the picture shows a surface", 100.0 * share));
    }
  }

  const scene::ScenarioDesc& scenario_;
  const scene::SceneGeometry& geometry_;
  const reference::RayScene& rays_;
  reference::SceneInstant instant_;
  SceneReport report_;
};

}  // namespace

double likely_scale(double largest_m) noexcept {
  // Vehicles and buildings are between a quarter of a metre and 150 m long.
  constexpr double kLeastM = 0.25;
  constexpr double kMostM = 150.0;
  if (largest_m >= kLeastM && largest_m <= kMostM) return 1.0;
  // Take the unit that brings it nearest to the length of a car.
  constexpr double kCarM = 5.0;
  double best = 1.0;
  for (const double scale : {0.01, 0.001, 100.0, 1000.0}) {
    const double size_m = scale * largest_m;
    if (size_m < kLeastM || size_m > kMostM) continue;
    if (best == 1.0 ||
        std::abs(std::log(size_m / kCarM)) < std::abs(std::log(best * largest_m / kCarM))) {
      best = scale;
    }
  }
  return best;
}

Result<SceneReport> check_scene(const scene::ScenarioDesc& scenario) {
  const auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(geometry.error());
  const auto rays = reference::RayScene::create(reference::ray_scene_desc(scenario, *geometry));
  if (!rays) return tl::unexpected(rays.error());
  return Check(scenario, *geometry, *rays).run();
}

}  // namespace emit::tool
