// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include "emit/physics/sky/fog.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {

physics::Result<std::string> run_fog_path(const EvaluateRequest&, const physics::CsvTable& table) {
  auto kinds = table.texts("kind");
  if (!kinds) return tl::unexpected(std::move(kinds.error()));
  auto bands = table.texts("band");
  if (!bands) return tl::unexpected(std::move(bands.error()));
  const auto columns =
      read_columns<5>(table, {"visibility_m", "top_m", "h_sensor_m", "h_target_m", "range_m"});
  if (!columns) return tl::unexpected(columns.error());
  const auto& [visibility_m, top_m, sensor_m, target_m, range_m] = *columns;
  const auto fault = [&](std::size_t row, std::string_view column, std::string_view text,
                         std::string_view why) {
    return physics::make_error(physics::ErrorCode::parse,
                               fmt::format("{}:{}: column '{}': '{}': {}", table.name(),
                                           table.line_of(row), column, text, why));
  };
  std::map<std::tuple<physics::FogKind, double, std::string>, physics::FogOptics> known;
  std::vector<std::vector<double>> out(6, std::vector<double>(table.rows(), kUndefined<double>));
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const auto kind = physics::fog_kind((*kinds)[i]);
    if (!kind) return fault(i, "kind", (*kinds)[i], "no kind of fog");
    if (!(visibility_m[i] > 0.0)) {
      return fault(i, "visibility_m", fmt::format("{}", visibility_m[i]), "must be above 0");
    }
    const std::string name((*bands)[i]);
    const auto band = flat_band(name);
    if (!band) return fault(i, "band", name, band.error().text);
    if (const auto sound = physics::validate(*band); !sound) {
      return fault(i, "band", name, sound.error().text);
    }
    const auto key = std::tuple{*kind, visibility_m[i], name};
    if (!known.contains(key)) {
      known[key] = physics::fog_optics({*kind, visibility_m[i], top_m[i]}, *band);
    }
    const physics::FogOptics& optics = known[key];
    out[0][i] = 1000.0 * optics.extinction_per_m;
    out[1][i] = optics.albedo_frac;
    out[2][i] = optics.asymmetry;
    if (!(range_m[i] >= 0.0) || !std::isfinite(range_m[i] + sensor_m[i] + target_m[i] + top_m[i])) {
      continue;
    }
    const double climb = range_m[i] > 0.0 ? (target_m[i] - sensor_m[i]) / range_m[i] : 0.0;
    const auto fog =
        physics::fog_stretch(top_m[i] - sensor_m[i], std::clamp(climb, -1.0, 1.0), range_m[i]);
    out[3][i] = fog.begin_m;
    out[4][i] = fog.length_m;
    out[5][i] = std::exp(-optics.extinction_per_m * fog.length_m);
  }
  return write_csv(kFogPathOutputs, out);
}

}  // namespace emit::verify
