// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>

#include "emit/scene/mesh.hpp"

/// Sheets: bodies so thin that both of their faces have one temperature, which is driven by what
/// both receive. A symmetric body under the mean of both faces' fluxes is half of it over an
/// insulated middle, and a thin one behaves like that under any fluxes.
namespace emit::scene {

/// Of a sheet's body: 20 W m-2 K-1 on either face leave a twentieth of what they drive as a
/// difference.
inline constexpr double kMaxSheetResistanceM2kW = 5e-3;
/// A lighter layer is the air behind; a body is the layers in front of the first one.
inline constexpr double kMaxGasKgM3 = 10.0;

/// What a sheet of this material is made of: half of its body's layers, `sheet` set. None where the
/// material is prescribed, has no body, or one that is no sheet. Modes of emit2014 become one, rho
/// c d / 2 over a film of 19 W m-2 K-1; its conductance to the core, which that model has for want
/// of convection, is that of the material or of the air behind.
[[nodiscard]] std::optional<Material> sheet_of(const Material& material);

/// True where the mesh has double-sided faces and is not the surface of a closed body.
[[nodiscard]] bool may_have_sheets(const Mesh& mesh);

/// Gives double-sided faces of thin materials the material of a sheet, appended to
/// SceneGeometry::materials. Not the faces of closed bodies: nothing gets to their other side.
/// Setup only.
void adopt_sheets(SceneGeometry& geometry);

}  // namespace emit::scene
