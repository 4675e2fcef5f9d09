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

/// Hashes of everything that decides the result, part by part, so that a misfit can be named.
struct SolveFingerprint {
  std::uint64_t place_and_date = 0;
  std::uint64_t weather = 0;
  std::uint64_t materials = 0;
  std::uint64_t geometry = 0;
  std::uint64_t thermal = 0;
  std::uint64_t options = 0;
};
[[nodiscard]] SolveFingerprint fingerprint(const scene::ScenarioDesc& scenario,
                                           const scene::SceneGeometry& geometry,
                                           const SolveOptions& options);

[[nodiscard]] std::filesystem::path checkpoint_file(const scene::ScenarioDesc& scenario,
                                                    const SolveOptions& options);

/// Written beside and renamed, so that a broken run leaves the old one. Errors: io.
[[nodiscard]] physics::Result<void> save_checkpoint(const std::filesystem::path& file,
                                                    const SolveFingerprint& print,
                                                    const SolidState& state,
                                                    const SolidStats& spin_up);
struct Checkpoint {
  SolidState state;
  SolidStats spin_up;
};
/// Empty when there is no file. Errors: io, parse (not a checkpoint, damaged), config (of another
/// scenario, or of other options: names what differs).
[[nodiscard]] physics::Result<std::optional<Checkpoint>> load_checkpoint(
    const std::filesystem::path& file, const SolveFingerprint& print);

}  // namespace emit::reference
