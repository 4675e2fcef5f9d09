// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/constants.hpp"
#include "models.hpp"
#include "result_writer.hpp"
#include "visibility/visibility_cpu.hpp"
#include "visibility/visibility_gpu.hpp"

namespace emit::verify {

/// Measures the visible part of the sun's disc behind a wall built from the row: by rays on the
/// CPU, by the frame's own soft shadow on the GPU.
physics::Result<std::string> run_wall_shadow(const EvaluateRequest& request,
                                             const physics::CsvTable& table) {
  if (auto ok = check_visibility_options(request); !ok) return tl::unexpected(ok.error());
  auto columns = read_columns<3>(table, {"H", "e_deg", "x"});
  if (!columns) return tl::unexpected(std::move(columns.error()));
  const MakeRow make = [&columns](std::size_t i) {
    const auto& [height_m, elevation_deg, distance_m] = *columns;
    return wall_shadow_row(height_m[i], elevation_deg[i] * physics::kDegree, distance_m[i]);
  };
  if (request.device == Device::gpu) {
    return gpu_sun_shares({request, table, kWallShadowOutputs, make});
  }
  std::vector<std::vector<double>> out(1, std::vector<double>(table.rows(), kUndefined<double>));
  const reference::SunQuery query{.rays = request.rays.value_or(kSunRays)};
  auto done = for_each_row(
      table, make,
      [&](std::size_t i, const VisibilityRow& row, const reference::SceneInstant& scene) {
        out[0][i] = scene.sun_visible_frac(surface_point(row), row.to_sun, query).value_frac;
      });
  if (!done) return tl::unexpected(std::move(done.error()));
  return write_csv(kWallShadowOutputs, out);
}

}  // namespace emit::verify
