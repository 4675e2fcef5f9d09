// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string>
#include <string_view>

#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// Material of the library for a glTF material, and why.
struct MaterialGuess {
  std::string material;  ///< empty: nothing in the name says what it is
  std::string word;      ///< word of the name that decided
  bool exact = false;    ///< the library has a material of this name, so that no guess is needed
};

/// Guesses the material of the library by the name of a glTF material: its own name, then known
/// words such as `tyre` or `windscreen`. Case and separators do not count; the longest word wins.
/// Materials that `library` lacks are not guessed. Thread: any.
[[nodiscard]] MaterialGuess guess_material(std::string_view gltf_material,
                                           std::span<const scene::Material> library);

}  // namespace emit::tool
