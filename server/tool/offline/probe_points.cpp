// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/probe_points.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <set>

#include "emit/physics/nearest_name.hpp"
#include "emit/reference/nearest_surface.hpp"
#include "tool/truth/probe_file.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Reads numbers with commas between them; empty where the text is anything else.
std::vector<double> numbers(std::string_view text) {
  std::vector<double> out;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    double value = 0.0;
    const auto [stop, error] = std::from_chars(text.data() + begin, text.data() + end, value);
    if (error != std::errc() || stop != text.data() + end || !std::isfinite(value)) return {};
    out.push_back(value);
    begin = end + 1;
  }
  return out;
}

double open_way_m(const reference::SceneInstant& instant, const glm::dvec3& from,
                  const glm::dvec3& normal) {
  const auto hit = instant.first_hit({from, normal, 1e-6});
  return hit ? hit->distance_m : std::numeric_limits<double>::infinity();
}

}  // namespace

glm::dvec3 pixel_direction_body(const scene::SensorDesc& sensor, std::uint32_t x_px,
                                std::uint32_t y_px) noexcept {
  const double per_px = 2.0 * std::tan(0.5 * sensor.fov_h_rad) / sensor.width_px;
  return glm::normalize(glm::dvec3(1.0, (x_px + 0.5 - 0.5 * sensor.width_px) * per_px,
                                   (y_px + 0.5 - 0.5 * sensor.height_px) * per_px));
}

Result<ProbeFinder> ProbeFinder::create(const scene::ScenarioDesc& scenario) {
  auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(std::move(geometry.error()));
  auto rays = reference::RayScene::create(reference::ray_scene_desc(scenario, *geometry));
  if (!rays) return tl::unexpected(std::move(rays.error()));
  return ProbeFinder(scenario, std::move(*geometry), std::move(*rays));
}

Result<ProbePoint> ProbeFinder::read_pixel(const std::string& text) const {
  const std::vector<double> px = numbers(std::string_view(text).substr(3));
  const scene::SensorDesc& sensor = scenario_->sensor;
  const auto inside = [](double value, std::uint32_t size) {
    return value >= 0.0 && value < size && value == std::floor(value);
  };
  if (px.size() != 2 || !inside(px[0], sensor.width_px) || !inside(px[1], sensor.height_px)) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("'{}': a pixel is px:X,Y, whole numbers from 0,0 (top left) to "
                                  "{},{}",
                                  text, sensor.width_px - 1, sensor.height_px - 1));
  }
  if (sensor.trajectory.empty()) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("'{}': the scenario's sensor has no position", text));
  }
  ProbePoint point{text, ProbePoint::Kind::pixel};
  point.x_px = static_cast<std::uint32_t>(px[0]);
  point.y_px = static_cast<std::uint32_t>(px[1]);
  return point;
}

Result<ProbePoint> ProbeFinder::read_part(const std::string& text) const {
  // The name of an object may hold colons.
  std::size_t object = scenario_->objects.size();
  std::string part;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < scenario_->objects.size(); ++i) {
    const std::string& name = scenario_->objects[i].name;
    names.push_back(name);
    if (text != name && !text.starts_with(name + ":")) continue;
    object = i;
    part = text == name ? "" : text.substr(name.size() + 1);
  }
  if (object == scenario_->objects.size()) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("'{}' is none of x,y,z, px:X,Y, a .csv file and an object{}; the scenario has "
                    "the objects {}",
                    text, physics::did_you_mean(text.substr(0, text.find(':')), names),
                    fmt::join(names, ", ")));
  }
  // Collect the materials that the name of the part stands for.
  std::set<std::string> known;
  std::set<std::uint32_t> wanted;
  std::string of_part = part;
  for (const scene::PartDesc& each : scenario_->objects[object].parts) {
    known.insert(each.name);
    if (each.name == part) of_part = each.material;
  }
  for (const scene::MaterialMapping& mapping : geometry_.mappings) {
    if (mapping.object != object) continue;
    known.insert(mapping.gltf_material);
    known.insert(mapping.material);
    if (part.empty() || of_part == mapping.gltf_material || of_part == mapping.material) {
      wanted.insert(mapping.index);
    }
  }
  // Take the largest triangle of these materials.
  ProbePoint point{text, ProbePoint::Kind::part};
  double largest_m2 = 0.0;
  const std::vector<reference::RayMesh>& meshes = rays_.desc().meshes;
  for (std::uint32_t m = 0; m < meshes.size(); ++m) {
    const reference::RayMesh& mesh = meshes[m];
    if (mesh.object != object) continue;
    for (std::size_t t = 0; t + 2 < mesh.indices.size(); t += 3) {
      const std::uint32_t material = mesh.materials.empty()       ? 0U
                                     : mesh.materials.size() == 1 ? mesh.materials.front()
                                                                  : mesh.materials[t / 3];
      if (!wanted.contains(material)) continue;
      const glm::dvec3& a = mesh.positions_m[mesh.indices[t]];
      const glm::dvec3& b = mesh.positions_m[mesh.indices[t + 1]];
      const glm::dvec3& c = mesh.positions_m[mesh.indices[t + 2]];
      const glm::dvec3 across = glm::cross(b - a, c - a);
      if (!(glm::length(across) > largest_m2)) continue;
      largest_m2 = glm::length(across);
      point.position_m = (a + b + c) / 3.0;
      point.normal = across / largest_m2;
      point.mesh = m;
    }
  }
  if (largest_m2 == 0.0) {
    known.erase("");
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("'{}': object '{}' has no part '{}'; it has {}", text,
                                  names[object], part, fmt::join(known, ", ")));
  }
  return point;
}

Result<std::vector<ProbePoint>> ProbeFinder::read(const std::string& text) const {
  const auto one = [](Result<ProbePoint> point) -> Result<std::vector<ProbePoint>> {
    if (!point) return tl::unexpected(std::move(point.error()));
    return std::vector<ProbePoint>{std::move(*point)};
  };
  if (text.starts_with("px:")) return one(read_pixel(text));
  if (const std::vector<double> at = numbers(text); at.size() == 3) {
    ProbePoint point{text, ProbePoint::Kind::place};
    point.position_m = {at[0], at[1], at[2]};
    return one(std::move(point));
  }
  if (!text.ends_with(".csv")) return one(read_part(text));
  const auto table = read_probes(text, *scenario_);
  if (!table) return tl::unexpected(table.error());
  std::vector<ProbePoint> points;
  for (const reference::SolveProbe& probe : *table) {
    const glm::dvec3& at = probe.position_m;
    ProbePoint point{fmt::format("{:g},{:g},{:g}", at.x, at.y, at.z), ProbePoint::Kind::place};
    point.position_m = at;
    point.normal = probe.normal;
    point.object = probe.object;
    points.push_back(std::move(point));
  }
  return points;
}

ProbePoint ProbeFinder::follow(const ProbePlace& place, std::int64_t sim_time_ns,
                               std::string name) const {
  ProbePoint point{std::move(name), ProbePoint::Kind::part, place.position_m, place.normal};
  const std::vector<reference::RayMesh>& meshes = rays_.desc().meshes;
  const auto mesh = std::ranges::find(meshes, place.object, &reference::RayMesh::object);
  point.mesh = static_cast<std::uint32_t>(mesh - meshes.begin());
  if (mesh->entity != reference::kNoEntity) {
    const physics::Pose pose = rays_.at(sim_time_ns).entity_pose(mesh->entity);
    const glm::dquat body_from_world = glm::conjugate(pose.world_from_body);
    point.position_m = body_from_world * (place.position_m - pose.position_world_m);
    point.normal = body_from_world * place.normal;
  }
  return point;
}

std::optional<ProbePlace> ProbeFinder::place(const ProbePoint& point, std::int64_t sim_time_ns,
                                             const physics::Pose& sensor) const {
  const reference::SceneInstant instant = rays_.at(sim_time_ns);
  if (point.kind == ProbePoint::Kind::part) {
    const reference::RayMesh& mesh = rays_.desc().meshes[point.mesh];
    ProbePlace out{point.position_m, *point.normal, mesh.object};
    if (mesh.entity != reference::kNoEntity) {
      if (!instant.entity_on(mesh.entity)) return std::nullopt;
      const physics::Pose& pose = instant.entity_pose(mesh.entity);
      out.position_m = pose.position_world_m + pose.world_from_body * out.position_m;
      out.normal = pose.world_from_body * out.normal;
    }
    out.open_m = open_way_m(instant, out.position_m, out.normal);
    return out;
  }
  std::optional<reference::RayHit> hit;
  if (point.kind == ProbePoint::Kind::pixel) {
    hit = instant.first_hit(
        {sensor.position_world_m,
         sensor.world_from_body * pixel_direction_body(scenario_->sensor, point.x_px, point.y_px)});
  } else {
    hit = reference::nearest_surface(
        instant, point.position_m, point.normal, [&](const reference::RayHit& candidate) {
          return point.object.empty() || scenario_->objects[candidate.object].name == point.object;
        });
  }
  if (!hit) return std::nullopt;
  const glm::dvec3 normal = hit->front ? hit->geometric_normal : -hit->geometric_normal;
  return ProbePlace{hit->position_world_m, normal, hit->object,
                    open_way_m(instant, hit->position_world_m, normal)};
}

}  // namespace emit::tool
