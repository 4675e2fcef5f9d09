// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "surface/model/surface_model.hpp"

/// The surface after its history in a file (thermal.state_file), so that a run need not warm up
/// what one before it did. Setup only.
///
/// Layout, little endian: 8 bytes "EMITSTAT", version u32, number of parts u32, the parts' hashes
/// u64 each, size of the body u64, body (SurfaceModel member by member, state_bytes.hpp), FNV-1a
/// of everything before as u64.
namespace emit::renderer {

/// Goes up with every change of the layout, and of what the same inputs are turned into.
inline constexpr std::uint32_t kStateVersion = 10;

/// What a state hangs on, told apart so that a file that does not fit can say why.
enum class StatePart : std::uint8_t {
  scene,         ///< geometry, placements and trajectories
  materials,     ///< thermal properties of those in use
  place,         ///< with the date
  weather,       ///< of the scenario
  thermal,       ///< options
  camera,        ///< format, field of view, trajectory
  first_time,    ///< interval of the first frame
  first_camera,  ///< places it is seen from
  live,          ///< poses and weather of the host
};
inline constexpr std::size_t kStateParts = 9;
[[nodiscard]] std::string_view describe(StatePart part) noexcept;

/// A hash for each part.
using StateKey = std::array<std::uint64_t, kStateParts>;

/// Fills the parts that a scenario tells. `geometry` as loaded, before it is simplified.
[[nodiscard]] StateKey scenario_key(const scene::ScenarioDesc& scenario,
                                    const scene::SceneGeometry& geometry);
/// Adds what the first frame tells. `start_ns`: end of the history that is prepared.
void add_first_frame(StateKey& key, std::int64_t start_ns, const RefineView& view,
                     const Environment& environment, std::span<const PoseHistory> entities);

/// Writes a temporary file beside `file` and renames it. Errors: io, naming the file.
[[nodiscard]] physics::Result<void> write_state(const std::filesystem::path& file,
                                                const StateKey& key, const SurfaceModel& model);

/// Errors: io, when write_state() would fail for want of the folder or of permission.
[[nodiscard]] physics::Result<void> check_state_writable(const std::filesystem::path& file);

/// Reads a state for that geometry, which has so many entities. Errors: io (cannot be read), config
/// (truncated, damaged, of another version, or made for something else: the text names file and
/// parts).
[[nodiscard]] physics::Result<SurfaceModel> read_state(const std::filesystem::path& file,
                                                       const StateKey& key,
                                                       const scene::SceneGeometry& geometry,
                                                       std::size_t movers,
                                                       const SurfaceModelOptions& options);

}  // namespace emit::renderer
