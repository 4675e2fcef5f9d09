// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "emit/physics/error.hpp"
#include "emit/reference/solid_solver.hpp"
#include "emit/reference/solve.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::reference {

/// Hashes of everything that determines the result. There is one per part, so that the part that
/// differs can be named.
struct SolveFingerprint {
  std::uint64_t place_and_date = 0;
  std::uint64_t weather = 0;
  std::uint64_t materials = 0;
  std::uint64_t geometry = 0;
  std::uint64_t contacts = 0;
  std::uint64_t thermal = 0;
  std::uint64_t options = 0;
};
/// Computes the fingerprint of a run whose last instant is `end_ns`.
[[nodiscard]] SolveFingerprint fingerprint(const scene::ScenarioDesc& scenario,
                                           const scene::SceneGeometry& geometry,
                                           const SolveOptions& options, std::int64_t end_ns);

/// Returns the path of the checkpoint of a scenario.
[[nodiscard]] std::filesystem::path checkpoint_file(const scene::ScenarioDesc& scenario,
                                                    const SolveOptions& options);

/// Writes a checkpoint to another file and renames it, so that a failure leaves the old one.
/// Errors: io.
[[nodiscard]] physics::Result<void> save_checkpoint(const std::filesystem::path& file,
                                                    const SolveFingerprint& print,
                                                    const SolidState& state,
                                                    const SolidStats& spin_up);
/// State that a checkpoint restores.
struct Checkpoint {
  SolidState state;
  SolidStats spin_up;
};
/// Reads a checkpoint. The result is empty if there is no file. Errors: parse (the file is not a
/// checkpoint, or is damaged), config (it belongs to another scenario or to other options; the
/// message names what differs).
[[nodiscard]] physics::Result<std::optional<Checkpoint>> load_checkpoint(
    const std::filesystem::path& file, const SolveFingerprint& print);

}  // namespace emit::reference
