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
#include "history/part_history.hpp"
#include "history/pose_history.hpp"
#include "surface/model/surface_model.hpp"

/// State file of a surface (thermal.state_file): the surface at one instant after its history, so
/// that a later run that starts there need not repeat the warm-up. A state does not depend on
/// bands. Setup only.
///
/// A state serves runs that start at its instant, and runs that start a little later and carry the
/// surface on to there.
///
/// Layout, little endian: 8 bytes "EMITSTAT", version u32, number of parts u32, the parts' hashes
/// u64 each, the instant i64 in ns of sim time, size of the body u64, body (SurfaceModel member by
/// member, state_bytes.hpp), CRC-64/XZ of everything before as u64.
namespace emit::renderer {

/// Version of the format. It rises with every change of the layout, and with every change of the
/// program that gives another state for the same inputs.
inline constexpr std::uint32_t kStateVersion = 30;

/// Parts of the input on which a state depends. The error about a file that does not fit names the
/// parts that differ.
enum class StatePart : std::uint8_t {
  scene,      ///< geometry, placements and trajectories
  materials,  ///< thermal properties of the materials in use
  place,      ///< place and date
  weather,    ///< weather of the scenario
  thermal,    ///< thermal options
  camera,     ///< format, field of view and trajectory of the sensor
  live,       ///< poses and weather of the host, up to the instant of the state
};
inline constexpr std::size_t kStateParts = 7;
/// Name of a part for messages.
[[nodiscard]] std::string_view describe(StatePart part) noexcept;

/// Hashes of all parts, by StatePart.
using StateKey = std::array<std::uint64_t, kStateParts>;

/// Hashes the parts that a scenario fixes; StatePart::live stays 0. `geometry` is the scene as
/// loaded, before simplification.
[[nodiscard]] StateKey scenario_key(const scene::ScenarioDesc& scenario,
                                    const scene::SceneGeometry& geometry);
/// Hashes StatePart::live: what the host has sent for instants up to `at_ns`.
[[nodiscard]] std::uint64_t live_hash(std::int64_t at_ns, const Environment& environment,
                                      std::span<const PoseHistory> entities,
                                      std::span<const PartHistory> parts);

/// Requirements of a run on a state.
struct StateWanted {
  /// Returns the wanted hashes of a state at an instant.
  std::function<StateKey(std::int64_t at_ns)> key_at;
  std::int64_t earliest_ns = 0;  ///< earliest instant of a state that will do; start_ns or before
  std::int64_t start_ns = 0;     ///< latest one: the instant at which the run starts
};

/// Writes a state. It writes a temporary file in the same folder and renames it. Errors: io, with
/// the name of the file.
[[nodiscard]] physics::Result<void> write_state(const std::filesystem::path& file,
                                                const StateKey& key, const SurfaceModel& model);

/// Tests whether write_state() could write: the folder exists and permits it. Errors: io.
[[nodiscard]] physics::Result<void> check_state_writable(const std::filesystem::path& file);

/// Reads a state for a scene with `geometry` and that number of entities. Errors: io (the file
/// cannot be read), config (the file is truncated, damaged, of another version, of an instant that
/// will not do, or made for something else). The message names the file and the reason.
[[nodiscard]] physics::Result<SurfaceModel> read_state(const std::filesystem::path& file,
                                                       const StateWanted& wanted,
                                                       const scene::SceneGeometry& geometry,
                                                       std::size_t entities,
                                                       const SurfaceModelOptions& options);

}  // namespace emit::renderer
