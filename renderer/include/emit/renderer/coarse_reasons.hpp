// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <string_view>

/// Reasons why a frame of `thermal.method = "cached"` may be coarser than the scenario asks.
namespace emit::renderer {

/// Reason why a frame is coarse.
enum class CoarseReason : std::uint8_t {
  camera,          ///< the camera stands or looks where nobody planned it
  field_of_view,   ///< the field of view is not one that the scenario's sensor may have
  samples,         ///< thermal.max_samples ran out before the view was fine enough
  meshes,          ///< meshes were simplified visibly, to leave room within thermal.max_samples
  shade,           ///< the shade of entities found no room, or an entity was too fast for it
  entity_shadows,  ///< more entities turned than a frame makes shadow maps for
  weather,         ///< some surfaces have not taken in a change of the weather by the host
  edges,           ///< heat along surfaces near edges is not settled to 0.05 K
  warmed_up,       ///< this frame prepared the surface anew, because the thermal time jumped
};
inline constexpr std::size_t kCoarseReasons = 9;
/// Reasons that hold for a frame, by number.
using CoarseReasons = std::bitset<kCoarseReasons>;

[[nodiscard]] inline bool has(const CoarseReasons& reasons, CoarseReason which) noexcept {
  return reasons[static_cast<std::size_t>(which)];
}
/// Adds a reason where it holds.
inline void add(CoarseReasons& reasons, CoarseReason which, bool holds = true) noexcept {
  if (holds) reasons[static_cast<std::size_t>(which)] = true;
}

/// Returns the name of a reason in outputs, such as "samples".
[[nodiscard]] constexpr std::string_view name_of(CoarseReason which) noexcept {
  constexpr std::array<std::string_view, kCoarseReasons> kNames{
      "camera",         "field_of_view", "samples", "meshes",   "shade",
      "entity_shadows", "weather",       "edges",   "warmed_up"};
  return kNames[static_cast<std::size_t>(which)];
}
/// Returns a sentence about a reason, without a full stop, of at most 85 bytes.
[[nodiscard]] constexpr std::string_view text_of(CoarseReason which) noexcept {
  constexpr std::array<std::string_view, kCoarseReasons> kTexts{
      "the camera is where the surface was not prepared: add the place to a trajectory",
      "the field of view is not one that the scenario's sensor may have",
      "thermal.max_samples ran out before the view was as fine as thermal.tolerance_k asks",
      "meshes lost visible detail to leave room within thermal.max_samples",
      "the shade of entities found no room, or an entity was too fast, or time went back",
      "more entities turned than a frame makes shadow maps for: outlines are of a while ago",
      "some surfaces have not taken in a change of the weather by the host yet",
      "heat along surfaces near edges is not settled to 0.05 K yet",
      "the surface was prepared anew, because the thermal time jumped"};
  return kTexts[static_cast<std::size_t>(which)];
}

}  // namespace emit::renderer
