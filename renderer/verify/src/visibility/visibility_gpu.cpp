// SPDX-License-Identifier: Apache-2.0
#include "visibility_gpu.hpp"

#include "emit/scene/scene_desc.hpp"

namespace emit::verify {
namespace {

/// Returns true for the method `cached`. Without a method the default of a scenario applies.
bool cached(const EvaluateRequest& request) {
  return request.method.empty() ? scene::ThermalOptions{}.method == scene::ThermalMethod::cached
                                : request.method == "cached";
}

}  // namespace

physics::Result<std::string> gpu_sun_shares(const VisibilityQuery& query) {
  return cached(query.request) ? cached_sun_shares(query) : frame_sun_shares(query);
}

physics::Result<std::string> gpu_sky_views(const VisibilityQuery& query) {
  return cached(query.request) ? cached_sky_views(query) : frame_sky_views(query);
}

}  // namespace emit::verify
