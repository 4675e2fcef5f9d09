// SPDX-License-Identifier: Apache-2.0
#include "visibility_gpu.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "emit/reference/sampling.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/renderer/verify/visibility_probe.hpp"
#include "models.hpp"
#include "result_writer.hpp"
#include "visibility_cpu.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// View of the point. Distances are in units of the row's largest length.
struct Look {
  double fov_h_rad = 0.0;
  double distance_frac = 0.0;
  double obscurance_radius_frac = 1.0;
};
// Views: a narrow one, like a seeker's, for the edge of the shadow, and a wide one that holds the
// whole ball of the obscurance.
constexpr Look kSunLook{20.0 * physics::kDegree, 3.0, 1.0};
constexpr Look kSkyLook{70.0 * physics::kDegree, 3.0, 1.0};
constexpr std::uint32_t kFormatPx = 513;  // odd, so that a pixel lies on the boresight
constexpr double kNearFrac = 0.02;
constexpr std::uint32_t kViewRays = 16384;

/// Returns a camera in the middle of the directions in which the point is open. Returns nothing
/// where the point is almost closed.
Result<std::optional<physics::Pose>> open_view(const VisibilityRow& row, double distance_m) {
  reference::RaySceneDesc desc;
  desc.meshes.push_back({.positions_m = row.positions_m, .indices = row.indices});
  auto scene = reference::RayScene::create(std::move(desc));
  if (!scene) return tl::unexpected(std::move(scene.error()));
  const reference::SceneInstant now = scene->at(0);
  const bool has_normal = on_face(row);
  const glm::dvec3 axis = has_normal ? row.normal : glm::dvec3(0.0, 0.0, 1.0);
  const reference::Tangents tangents = reference::tangents_of(axis);
  std::vector<glm::dvec3> open;
  glm::dvec3 mean(0.0);
  const double semi_angle_rad = has_normal ? 0.5 * physics::kPi : physics::kPi;
  for (std::uint32_t i = 0; i < kViewRays; ++i) {
    const glm::dvec3 towards =
        reference::cap_direction(reference::disc_from_square(reference::sobol_owen_2d(i, 0)), axis,
                                 tangents, semi_angle_rad);
    if (now.occluded({row.point_m, towards})) continue;
    open.push_back(towards);
    mean += towards;
  }
  if (open.empty()) return std::nullopt;
  const auto middle = std::max_element(open.begin(), open.end(), [&](const auto& a, const auto& b) {
    return glm::dot(a, mean) < glm::dot(b, mean);
  });
  physics::Pose pose;
  pose.position_world_m = row.point_m + distance_m * *middle;
  pose.world_from_body = physics::world_from_body_look_at(pose.position_world_m, row.point_m);
  return std::optional(pose);
}

class RowProbe {
 public:
  static Result<RowProbe> create(const EvaluateRequest& request, const Look& look) {
    scene::SensorDesc sensor;
    sensor.width_px = sensor.height_px = kFormatPx;
    sensor.fov_h_rad = look.fov_h_rad;
    auto probe = renderer::VisibilityProbe::create(sensor, scene::ThermalOptions{},
                                                   {.gpu_index = request.gpu_index});
    if (!probe) return tl::unexpected(std::move(probe.error()));
    return RowProbe(std::move(*probe), look);
  }

  /// Returns the result of the frame at the row's point, or nothing where no camera can see it.
  Result<std::optional<renderer::VisibilityProbe::Answer>> ask(const VisibilityRow& row) {
    const double distance_m = look_.distance_frac * row.length_m;
    const auto pose = open_view(row, distance_m);
    if (!pose) return tl::unexpected(pose.error());
    if (!*pose) return std::nullopt;
    auto answer = probe_->at_middle(scene_geometry(row), **pose, row.to_sun, kNearFrac * distance_m,
                                    look_.obscurance_radius_frac * row.length_m);
    if (!answer) return tl::unexpected(std::move(answer.error()));
    if (!answer->surface || std::abs(answer->depth_m - distance_m) > 0.01 * distance_m) {
      return make_error(ErrorCode::internal, "the camera does not show the point");
    }
    return std::optional(*answer);
  }

 private:
  RowProbe(std::unique_ptr<renderer::VisibilityProbe> probe, const Look& look)
      : probe_(std::move(probe)), look_(look) {}
  std::unique_ptr<renderer::VisibilityProbe> probe_;
  Look look_;
};

template <std::size_t N, class Read>
Result<std::string> run_rows(const VisibilityQuery& query, const Look& look, const Read& read) {
  const physics::CsvTable& table = query.table;
  auto probe = RowProbe::create(query.request, look);
  if (!probe) return tl::unexpected(std::move(probe.error()));
  std::vector<std::vector<float>> out(N, std::vector<float>(table.rows(), kUndefined<float>));
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const auto context = [&] { return fmt::format("{}:{}", table.name(), table.line_of(i)); };
    auto row = query.make(i);
    if (!row) return tl::unexpected(std::move(row.error()).with_context(context()));
    auto answer = probe->ask(*row);
    if (!answer) return tl::unexpected(std::move(answer.error()).with_context(context()));
    if (!*answer) continue;
    read(*row, **answer,
         [&](std::size_t column, double value) { out[column][i] = static_cast<float>(value); });
  }
  return write_csv(query.outputs, out);
}

}  // namespace

Result<std::string> frame_sun_shares(const VisibilityQuery& query) {
  return run_rows<1>(
      query, kSunLook,
      [](const VisibilityRow&, const auto& answer, const auto& set) { set(0, answer.sun_frac); });
}

Result<std::string> frame_sky_views(const VisibilityQuery& query) {
  return run_rows<2>(query, kSkyLook,
                     [](const VisibilityRow& row, const auto& answer, const auto& set) {
                       // The frame has one measure, the open fraction of a ball. On flat ground it
                       // is 0.5, like the fraction of the full sphere; twice its value represents
                       // the sky view factor.
                       if (on_face(row)) set(0, std::min(2.0 * answer.obscurance_frac, 1.0));
                       set(1, answer.obscurance_frac);
                     });
}

}  // namespace emit::verify
