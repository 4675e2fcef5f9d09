// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

/// Generator of the scenes of the demo, the tests and the benchmarks, as .glb files. The same
/// options give the same bytes. Files are named after the scene. `airfield` writes several
/// (airfield.glb and one per vehicle), which config/scenarios/airfield.toml places, and so does
/// `sea` (sea.glb and ship.glb).
namespace emit::scenegen {

/// Kind of a scene.
enum class SceneKind : std::uint8_t { box, statue, block_on_road, ribbed, airfield, sea };

/// Returns the command-line name of a kind: box, statue, block-on-road, ribbed, airfield, sea.
[[nodiscard]] std::string_view to_string(SceneKind kind) noexcept;
/// Returns the kind with a command-line name, or nothing.
[[nodiscard]] std::optional<SceneKind> scene_kind_from(std::string_view name) noexcept;

/// Box on a plane with 45 triangles in all, as in the paper's first benchmark. Materials: asphalt
/// (plane), concrete (box).
struct BoxOptions {
  double size_m = 2.0;    ///< edge of the box, > 0
  double plane_m = 40.0;  ///< edge of the plane, > 1.2 size_m; 0: the box alone, without plane
};

/// Seated figure with folds, on a plane, as one closed surface. Materials: stone, asphalt.
struct StatueOptions {
  /// Lowest number of triangles of the statue alone, 1'000 .. 20'000'000.
  std::uint32_t min_triangles = 1'080'000;
  double height_m = 2.6;  ///< 0.1 .. 100
  double plane_m = 40.0;  ///< edge of the plane, > 2 height_m; 0: no plane
};

/// Concrete block on an asphalt road. The road lies in x = east, y = north, centred on the block.
/// The nodes are road, block and, for a hollow block, block_inner: the faces towards the cavity,
/// which the solver holds at base_k.
struct BlockOnRoadOptions {
  double block_east_m = 2.0;
  double block_north_m = 1.0;
  double block_up_m = 1.0;
  double wall_thickness_m = 0.10;  ///< > 0: a hollow block, open towards the road; 0: a solid one
  double road_east_m = 24.0;
  double road_north_m = 24.0;
};

/// Ribs with square corners, along north, on a base plate. Material: concrete.
struct RibbedOptions {
  std::uint32_t ribs = 8;      ///< 1 .. 1000
  double pitch_m = 0.5;        ///< distance from rib to rib
  double rib_width_m = 0.25;   ///< > 0 and < pitch_m
  double rib_height_m = 0.25;  ///< > 0
  double length_m = 4.0;       ///< > 0
};

/// Airfield of about a square kilometre. The plan is in airfield.hpp.
struct AirfieldOptions {
  std::uint32_t seed = 1;  ///< seed of trees, slabs, repairs and tyre marks
};

/// Options of generate(). Only those of `kind` are used.
struct GenerateOptions {
  SceneKind kind = SceneKind::box;
  std::filesystem::path directory;  ///< folder of the files; it is created when missing
  BoxOptions box;
  StatueOptions statue;
  BlockOnRoadOptions block_on_road;
  RibbedOptions ribbed;
  AirfieldOptions airfield;
};

/// File that was written.
struct GeneratedFile {
  std::filesystem::path path;
  std::uint64_t triangles = 0;
  std::uint64_t vertices = 0;
  std::uint64_t bytes = 0;
};
/// Files that were written.
struct GeneratedFiles {
  std::vector<GeneratedFile> files;
};

/// Writes the files of a scene. Errors: invalid_argument names the option; io names the file.
/// Thread: any.  Real time: setup only.
[[nodiscard]] physics::Result<GeneratedFiles> generate(const GenerateOptions& options);

/// Writes a level square of ground around the origin at height 0, cut into 32 x 32 cells, with one
/// material. Errors: invalid_argument (`edge_m` is not in 0.1 .. 1e5 m), io. Thread: any. Real
/// time: setup only.
[[nodiscard]] physics::Result<GeneratedFile> generate_ground(const std::filesystem::path& file,
                                                             double edge_m,
                                                             const std::string& material);

}  // namespace emit::scenegen
