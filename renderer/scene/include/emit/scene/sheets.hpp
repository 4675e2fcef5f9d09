// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "emit/scene/mesh.hpp"

/// Sheets: bodies so thin that both of their faces have one temperature, which is driven by what
/// both receive. A symmetric body under the mean of both faces' fluxes is half of it over an
/// insulated middle, and a thin one behaves like that under any fluxes.
namespace emit::scene {

/// Largest resistance of a sheet's body from face to face. Films of 20 W m-2 K-1 on either face
/// leave a twentieth of what they drive as a difference between the faces.
inline constexpr double kMaxSheetResistanceM2kW = 5e-3;
/// A layer lighter than this is the air behind a body. The body is made of the layers in front of
/// the first such layer.
inline constexpr double kMaxGasKgM3 = 10.0;

/// The material of a sheet made of this material: half of its body's layers, with `sheet` set.
/// Nothing when the material has a prescribed temperature, has no body, or has one that is too
/// thick. The modes of emit2014 become a single one, rho c d / 2 over a film of 19 W m-2 K-1. Its
/// conductance to the core, which stands for convection in that model, is the material's own or
/// that of the air behind.
[[nodiscard]] std::optional<Material> sheet_of(const Material& material);

/// Name of the sheet of a material.
[[nodiscard]] inline std::string sheet_name(const std::string& material) {
  return material + " (sheet)";
}

/// True where the mesh has double-sided faces and is not the surface of a closed body.
[[nodiscard]] bool may_have_sheets(const Mesh& mesh);

/// Returns the materials that some sheet of the scene is made of, ascending: double-sided faces of
/// thin materials that no closed body has. Setup only.
[[nodiscard]] std::vector<std::uint32_t> materials_of_sheets(const SceneGeometry& geometry);

/// Gives double-sided faces of thin materials the material of a sheet, which is appended to
/// SceneGeometry::materials. Faces of closed bodies keep theirs: nothing gets to their other side.
/// Setup only.
void adopt_sheets(SceneGeometry& geometry);

}  // namespace emit::scene
