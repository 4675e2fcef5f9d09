// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>

#include "emit/physics/sun.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {

physics::Result<std::string> run_sun_position(const EvaluateRequest&,
                                              const physics::CsvTable& table) {
  enum Column : std::size_t { kYear, kMonth, kDay, kHours, kLat, kLon, kHeight, kDeltaT };
  const auto columns =
      read_columns<8>(table, {"year", "month", "day", "hours_ut", "lat", "lon", "height", "dT"});
  if (!columns) return tl::unexpected(columns.error());
  std::array<std::vector<double>, 2> result;
  for (auto& column : result) column.assign(table.rows(), kUndefined<double>);
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const auto at = [&columns, i](Column column) { return (*columns)[column][i]; };
    const auto is_whole = [](double v, double lo, double hi) {
      return v >= lo && v <= hi && v == std::floor(v);
    };
    if (!is_whole(at(kYear), -4000, 8000) || !is_whole(at(kMonth), 1, 12) ||
        !is_whole(at(kDay), 1, 31)) {
      return physics::make_error(physics::ErrorCode::parse,
                                 fmt::format("{}:{}: {}-{}-{} is not a date", table.name(),
                                             table.line_of(i), at(kYear), at(kMonth), at(kDay)));
    }
    const double day = physics::julian_day_0h(
        static_cast<int>(at(kYear)), static_cast<int>(at(kMonth)), static_cast<int>(at(kDay)));
    const physics::SunPosition sun = physics::sun_position_ut1(
        day, at(kHours) / 24.0, at(kDeltaT),
        {physics::degrees(at(kLat)), physics::degrees(at(kLon)), physics::Metres(at(kHeight))});
    result[0][i] = physics::to_degrees(sun.azimuth);
    result[1][i] = physics::to_degrees(sun.elevation);
  }
  return write_csv(kSunPositionOutputs, result);
}

}  // namespace emit::verify
