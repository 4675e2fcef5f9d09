// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// A file that a scenario's hash covers.
struct SceneFile {
  std::string name;    ///< path relative to the scenario's folder; the file name elsewhere
  std::string sha256;  ///< of its content, 64 hexadecimal digits
  std::uint64_t bytes = 0;
};

/// Identity of a resolved scenario. It is the same in every folder on every machine.
struct ScenarioIdentity {
  /// SHA-256 in hexadecimal digits, as RunStart has it. It covers the resolved values, with the
  /// tables that the scenario names, and the files.
  std::string sha256;
  std::string printed;           ///< resolved values, as config::print_scenario() writes them
  std::vector<SceneFile> files;  ///< the glTF files and their buffers, in the order of the objects
};

/// Identifies a scenario. Where its warmed-up state is kept does not count. Errors (io): a file
/// that cannot be read, by name; (parse): a glTF file whose JSON is invalid.
[[nodiscard]] physics::Result<ScenarioIdentity> identify_scenario(
    const scene::ScenarioDesc& scenario);

}  // namespace emit::server
