// SPDX-License-Identifier: Apache-2.0
#include <glm/geometric.hpp>

#include "models.hpp"
#include "result_writer.hpp"
#include "visibility/visibility_cpu.hpp"
#include "visibility/visibility_gpu.hpp"

namespace emit::verify {

/// Measures the open sky around a point of geometry built from the row: by rays on the CPU, by the
/// frame's own obscurance on the GPU.
physics::Result<std::string> run_sky_view(const EvaluateRequest& request,
                                          const physics::CsvTable& table) {
  if (auto ok = check_visibility_options(request); !ok) return tl::unexpected(ok.error());
  auto kinds = table.texts("kind");
  if (!kinds) return tl::unexpected(std::move(kinds.error()));
  auto columns = read_columns<7>(table, {"p1", "p2", "p3", "p4", "p5", "p6", "p7"});
  if (!columns) return tl::unexpected(std::move(columns.error()));
  const MakeRow make = [&](std::size_t i) {
    std::array<double, 7> p;
    for (std::size_t k = 0; k < p.size(); ++k) p[k] = (*columns)[k][i];
    return sky_view_row((*kinds)[i], p);
  };
  if (request.device == Device::gpu) return gpu_sky_views({request, table, kSkyViewOutputs, make});
  std::vector<std::vector<double>> out(2, std::vector<double>(table.rows(), kUndefined<double>));
  const std::uint32_t rays = request.rays.value_or(kSkyRays);
  auto done = for_each_row(
      table, make,
      [&](std::size_t i, const VisibilityRow& row, const reference::SceneInstant& scene) {
        const reference::SkyView view = scene.sky_view(surface_point(row), rays);
        // Every ray that leaves the geometry of the row counts as sky, also below the horizon.
        if (glm::dot(row.normal, row.normal) > 0.0) {
          out[0][i] = view.sky_cosine.value_frac + view.ground_cosine.value_frac;
        }
        out[1][i] = view.sky_uniform.value_frac + view.ground_uniform.value_frac;
      });
  if (!done) return tl::unexpected(std::move(done.error()));
  return write_csv(kSkyViewOutputs, out);
}

}  // namespace emit::verify
