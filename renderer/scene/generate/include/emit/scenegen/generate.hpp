// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

/// Writes the scenes of the demo, the tests and the benchmarks as .glb files. The same options give
/// the same bytes. Files are named after the scene; `airfield` writes several (airfield.glb and one
/// per vehicle), which config/scenarios/airfield.toml places.
namespace emit::scenegen {

enum class SceneKind : std::uint8_t { box, statue, block_on_road, ribbed, airfield };

/// Command-line names: box, statue, block-on-road, ribbed, airfield.
[[nodiscard]] std::string_view to_string(SceneKind kind) noexcept;
[[nodiscard]] std::optional<SceneKind> scene_kind_from(std::string_view name) noexcept;

/// Box on a plane, 45 triangles in all, as in the paper's first benchmark. Materials: asphalt
/// (plane), concrete (box).
struct BoxOptions {
  double size_m = 2.0;    ///< edge of the box, > 0
  double plane_m = 40.0;  ///< edge of the plane, > 1.2 size_m; 0: none, the box alone
};

/// Seated figure with folds on a plane: one closed surface. Materials: stone, asphalt.
struct StatueOptions {
  std::uint32_t min_triangles = 1'080'000;  ///< of the statue alone, 1'000 .. 20'000'000
  double height_m = 2.6;                    ///< 0.1 .. 100
  double plane_m = 40.0;                    ///< edge of the plane, > 2 height_m; 0: none
};

/// Concrete block on an asphalt road. Road in x = east, y = north, centred on the block. Nodes:
/// road, block, block_inner (hollow only: the faces towards the cavity, held at base_k by the
/// solver).
struct BlockOnRoadOptions {
  double block_east_m = 2.0;
  double block_north_m = 1.0;
  double block_up_m = 1.0;
  double wall_thickness_m = 0.10;  ///< > 0: hollow, open towards the road; 0: solid
  double road_east_m = 24.0;
  double road_north_m = 24.0;
};

/// Ribs with square corners along north on a base plate. Material: concrete.
struct RibbedOptions {
  std::uint32_t ribs = 8;      ///< 1 .. 1000
  double pitch_m = 0.5;        ///< rib to rib
  double rib_width_m = 0.25;   ///< in (0, pitch_m)
  double rib_height_m = 0.25;  ///< > 0
  double length_m = 4.0;       ///< > 0
};

/// About a square kilometre of airfield, see airfield.cpp for the plan.
struct AirfieldOptions {
  std::uint32_t seed = 1;  ///< places trees, cars and small things
};

struct GenerateOptions {
  SceneKind kind = SceneKind::box;
  std::filesystem::path directory;  ///< created when missing
  BoxOptions box;
  StatueOptions statue;
  BlockOnRoadOptions block_on_road;
  RibbedOptions ribbed;
  AirfieldOptions airfield;
};

struct GeneratedFile {
  std::filesystem::path path;
  std::uint64_t triangles = 0;
  std::uint64_t vertices = 0;
  std::uint64_t bytes = 0;
};
struct GeneratedFiles {
  std::vector<GeneratedFile> files;
};

/// Setup only. Errors: invalid_argument (naming the option), io (naming the file).
[[nodiscard]] physics::Result<GeneratedFiles> generate(const GenerateOptions& options);

}  // namespace emit::scenegen
