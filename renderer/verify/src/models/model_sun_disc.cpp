// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/constants.hpp"
#include "models.hpp"
#include "result_writer.hpp"
#include "visibility/visibility_cpu.hpp"
#include "visibility/visibility_gpu.hpp"

namespace emit::verify {

/// Measures the visible part of the sun's disc behind the edge of a real wall. The disc is
/// integrated as the reference solver does it, or sampled by rays when --rays is given.
physics::Result<std::string> run_sun_disc(const EvaluateRequest& request,
                                          const physics::CsvTable& table) {
  if (auto ok = check_visibility_options(request); !ok) return tl::unexpected(ok.error());
  auto columns = read_columns<1>(table, {"delta_deg"});
  if (!columns) return tl::unexpected(std::move(columns.error()));
  const std::vector<double>& delta_deg = (*columns)[0];
  const MakeRow make = [&](std::size_t i) -> physics::Result<VisibilityRow> {
    return sun_disc_row(delta_deg[i] * physics::kDegree);
  };
  if (request.device == Device::gpu) return gpu_sun_shares({request, table, kSunDiscOutputs, make});
  std::vector<std::vector<double>> out(1, std::vector<double>(table.rows(), kUndefined<double>));
  auto done = for_each_row(
      table, make,
      [&](std::size_t i, const VisibilityRow& row, const reference::SceneInstant& scene) {
        const reference::SurfacePoint point = surface_point(row);
        out[0][i] =
            request.rays
                ? scene.sun_visible_frac(point, row.to_sun, {.rays = *request.rays}).value_frac
                : scene.sun_visible_frac_clipped(point, row.to_sun).value_frac;
      });
  if (!done) return tl::unexpected(std::move(done.error()));
  return write_csv(kSunDiscOutputs, out);
}

}  // namespace emit::verify
