// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "emit/reference/solid_lateral.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;
using reference::LateralCase;
using reference::LitPatch;

namespace {

constexpr std::array<std::pair<std::string_view, LitPatch>, 4> kPatches{{
    {"half_plane", LitPatch::half_plane},
    {"moving_half_plane", LitPatch::moving_half_plane},
    {"strip", LitPatch::strip},
    {"rectangle", LitPatch::rectangle},
}};

}  // namespace

Result<std::string> run_conduction_lateral(const EvaluateRequest& request,
                                           const physics::CsvTable& table) {
  const auto kinds = table.texts("kind");
  if (!kinds) return tl::unexpected(kinds.error());
  const auto columns =
      read_columns<10>(table, {"k", "rc", "q", "lx", "ly", "v", "x", "y", "z", "t"});
  if (!columns) return tl::unexpected(columns.error());
  std::vector<LateralCase> cases(table.rows());
  for (std::size_t row = 0; row < cases.size(); ++row) {
    bool known = false;
    for (const auto& [name, patch] : kPatches) {
      if ((*kinds)[row] != name) continue;
      cases[row].patch = patch;
      known = true;
    }
    if (!known) {
      return make_error(
          ErrorCode::parse,
          fmt::format("{}:{}: column 'kind': '{}' is none of half_plane, moving_half_plane, strip, "
                      "rectangle",
                      table.name(), table.line_of(row), (*kinds)[row]));
    }
    const auto value = [&](std::size_t column) { return (*columns)[column][row]; };
    cases[row].conductivity_w_m_k = value(0);
    cases[row].heat_capacity_j_m3_k = value(1);
    cases[row].flux_w_m2 = value(2);
    cases[row].half_x_m = value(3);
    cases[row].half_y_m = value(4);
    cases[row].speed_m_s = value(5);
    cases[row].x_m = value(6);
    cases[row].y_m = value(7);
    cases[row].depth_m = value(8);
    cases[row].time_s = value(9);
  }
  const std::vector<double> rises_k =
      reference::lateral_rises_k(cases, static_cast<double>(request.refine));
  return write_csv(kConductionLateralOutputs, std::span(&rises_k, 1));
}

}  // namespace emit::verify
