// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_uint2.hpp>
#include <string>
#include <vector>

#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/offline/probe_points.hpp"

namespace emit::tool::view {

/// Returns lines about a pixel of the latest frame: place, object, material, temperatures, sun and
/// sky of its surface, and the terms of its radiance in one band with their shares. Setup only.
/// @pre the frame has temperature, depth, object, sun, sky and terms, and full quality
[[nodiscard]] std::vector<std::string> pixel_report(const scene::ScenarioDesc& scenario,
                                                    const ProbeFinder& finder,
                                                    const renderer::Renderer& renderer,
                                                    const renderer::FrameView& frame,
                                                    std::size_t band, const glm::uvec2& px);

}  // namespace emit::tool::view
