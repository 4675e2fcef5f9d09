// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <vector>

#include "emit/renderer/verify/sample_sight.hpp"
#include "models.hpp"
#include "result_writer.hpp"
#include "visibility_gpu.hpp"

namespace emit::verify {
namespace {

using physics::Result;

/// Distance of ray starts from the surface, in units of the row's largest length. The rule of a
/// scenario (half a millimetre, or 1e-6 of the scene) would give 1.4 thousandths of a row's length,
/// because a row is cut at 1000 of its lengths.
constexpr double kOffsetFrac = 1e-5;

/// Runs all rows. `read(row, sight, set)` calls set(column, value).
template <std::size_t N, class Read>
Result<std::string> run_rows(const VisibilityQuery& query, const Read& read) {
  const physics::CsvTable& table = query.table;
  std::vector<std::vector<float>> out(N, std::vector<float>(table.rows(), kUndefined<float>));
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const auto context = [&] { return fmt::format("{}:{}", table.name(), table.line_of(i)); };
    auto row = query.make(i);
    if (!row) return tl::unexpected(std::move(row.error()).with_context(context()));
    auto sight = renderer::sight_of_sample(scene_geometry(*row),
                                           {.position_world_m = row->point_m,
                                            .normal = on_face(*row) ? row->normal : row->outward,
                                            .on_face = on_face(*row),
                                            .to_sun = row->to_sun,
                                            .offset_m = kOffsetFrac * row->length_m});
    if (!sight) return tl::unexpected(std::move(sight.error()).with_context(context()));
    read(*row, *sight,
         [&](std::size_t column, double value) { out[column][i] = static_cast<float>(value); });
  }
  return write_csv(query.outputs, out);
}

}  // namespace

Result<std::string> cached_sun_shares(const VisibilityQuery& query) {
  return run_rows<1>(query, [](const VisibilityRow&, const renderer::SampleSight& sight,
                               const auto& set) { set(0, sight.sun_frac); });
}

Result<std::string> cached_sky_views(const VisibilityQuery& query) {
  return run_rows<2>(
      query, [](const VisibilityRow& row, const renderer::SampleSight& sight, const auto& set) {
        if (on_face(row)) set(0, sight.cosine_frac);
        set(1, sight.sphere_frac);
      });
}

}  // namespace emit::verify
