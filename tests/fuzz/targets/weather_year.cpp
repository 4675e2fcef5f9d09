// SPDX-License-Identifier: Apache-2.0
// Fuzz target: typical years of building simulation.
#include <cmath>

#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"
#include "tables/weather_year.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  const auto year = config::load_weather_year(fuzz::file_of(fuzz::as_bytes(data, size)));
  if (!year) return 0;
  scene::ScenarioDesc scenario;
  std::vector<std::string> warnings;
  const auto rows = config::weather_of_year(*year, "year", scenario, warnings);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    fuzz::require(i == 0 || rows[i - 1].sim_time_ns < rows[i].sim_time_ns, "rows go up");
    fuzz::require(std::isfinite(rows[i].air_k) && std::isfinite(rows[i].longwave_down_w_m2),
                  "air and sky are numbers");
    fuzz::require(rows[i].direct_normal_w_m2 >= 0.0 && rows[i].diffuse_horizontal_w_m2 >= 0.0 &&
                      rows[i].direct_normal_w_m2 < 3000.0,
                  "the sun gives what a sun can give");
  }
  return 0;
}
