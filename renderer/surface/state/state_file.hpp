// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string_view>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "surface/model/surface_model.hpp"

/// The surface after its history in a file (thermal.state_file), so that a run need not warm up
/// what one before it did. The file holds the surface at an instant: a run that starts later goes
/// on from it. Bands do not matter to it. Setup only.
///
/// Layout, little endian: 8 bytes "EMITSTAT", version u32, number of parts u32, the parts' hashes
/// u64 each, the instant i64 in ns of sim time, size of the body u64, body (SurfaceModel member by
/// member, state_bytes.hpp), FNV-1a of everything before as u64.
namespace emit::renderer {

/// Goes up with every change of the layout, and of what the same inputs are turned into.
inline constexpr std::uint32_t kStateVersion = 10;

/// What a state depends on. A file that does not fit says which of these parts differ.
enum class StatePart : std::uint8_t {
  scene,      ///< geometry, placements and trajectories
  materials,  ///< thermal properties of those in use
  place,      ///< with the date
  weather,    ///< of the scenario
  thermal,    ///< options
  camera,     ///< format, field of view, trajectory
  live,       ///< poses and weather of the host, up to the instant of the state
};
inline constexpr std::size_t kStateParts = 7;
[[nodiscard]] std::string_view describe(StatePart part) noexcept;

/// A hash for each part.
using StateKey = std::array<std::uint64_t, kStateParts>;

/// Hashes the parts that a scenario fixes. `geometry` is taken as loaded, before it is simplified.
[[nodiscard]] StateKey scenario_key(const scene::ScenarioDesc& scenario,
                                    const scene::SceneGeometry& geometry);
/// Hashes StatePart::live: what the host has sent for instants up to `at_ns`.
[[nodiscard]] std::uint64_t live_hash(std::int64_t at_ns, const Environment& environment,
                                      std::span<const PoseHistory> entities);

/// What a run asks of a state.
struct StateWanted {
  StateKey key{};             ///< without StatePart::live
  std::int64_t start_ns = 0;  ///< the state must not be later
  /// Gives StatePart::live for the instant of a state.
  std::function<std::uint64_t(std::int64_t at_ns)> live_hash;
};

/// Writes a temporary file beside `file` and renames it. Errors: io, naming the file.
[[nodiscard]] physics::Result<void> write_state(const std::filesystem::path& file,
                                                const StateKey& key, const SurfaceModel& model);

/// Errors: io, when write_state() would fail for want of the folder or of permission.
[[nodiscard]] physics::Result<void> check_state_writable(const std::filesystem::path& file);

/// Reads a state for that geometry, which has so many entities. Errors: io (cannot be read), config
/// (truncated, damaged, of another version, later than the run starts, or made for something else:
/// the text names the file and says why).
[[nodiscard]] physics::Result<SurfaceModel> read_state(const std::filesystem::path& file,
                                                       const StateWanted& wanted,
                                                       const scene::SceneGeometry& geometry,
                                                       std::size_t movers,
                                                       const SurfaceModelOptions& options);

}  // namespace emit::renderer
