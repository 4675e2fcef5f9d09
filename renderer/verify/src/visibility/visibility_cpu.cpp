// SPDX-License-Identifier: Apache-2.0
#include "visibility_cpu.hpp"
#include "emit/threads/parallel.hpp"

#include <fmt/format.h>
#include <tbb/blocked_range.h>

#include <optional>
#include <vector>

namespace emit::verify {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Result<void> for_each_row(const physics::CsvTable& table,
                          const std::function<Result<VisibilityRow>(std::size_t)>& make,
                          const std::function<void(std::size_t, const VisibilityRow&,
                                                   const reference::SceneInstant&)>& ask) {
  std::vector<std::optional<physics::Error>> errors(table.rows());
  threads::parallel_ranges(
      tbb::blocked_range<std::size_t>(0, table.rows(), 1), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          auto row = make(i);
          if (!row) {
            errors[i] = std::move(row.error());
            continue;
          }
          reference::RaySceneDesc desc;
          desc.meshes.push_back({.positions_m = row->positions_m, .indices = row->indices});
          auto scene = reference::RayScene::create(std::move(desc));
          if (!scene) {
            errors[i] = std::move(scene.error());
            continue;
          }
          ask(i, *row, scene->at(0));
        }
      });
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (errors[i]) {
      return tl::unexpected(
          std::move(*errors[i]).with_context(fmt::format("{}:{}", table.name(), table.line_of(i))));
    }
  }
  return {};
}

Result<void> check_visibility_options(const EvaluateRequest& request) {
  if (request.device == Device::cpu) {
    if (request.precision == Precision::float32) {
      return make_error(ErrorCode::invalid_argument,
                        "on the CPU visibility is decided in double: --precision float64, or "
                        "--device gpu");
    }
    if (!request.method.empty()) {
      return make_error(ErrorCode::invalid_argument,
                        "--method names a method of the GPU path; the CPU traces rays");
    }
    return {};
  }
  if (request.rays) {
    return make_error(ErrorCode::invalid_argument, "--rays belongs to --device cpu");
  }
  if (!request.method.empty() && request.method != "per-frame" && request.method != "cached") {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("unknown method '{}'; there are per-frame, cached", request.method));
  }
  return {};
}

}  // namespace emit::verify
