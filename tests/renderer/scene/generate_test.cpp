// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include "emit/scene/gltf_import.hpp"
#include "emit/scenegen/generate.hpp"
#include "renderer/scene/gltf_builder.hpp"

namespace emit::scenegen {
namespace {

using scene::GltfModel;
using scene::Mesh;
using testing::HasSubstr;

GenerateOptions of(SceneKind kind) {
  GenerateOptions options;
  options.kind = kind;
  return options;
}

GeneratedFiles run(GenerateOptions options, const std::filesystem::path& folder) {
  options.directory = folder;
  physics::Result<GeneratedFiles> files = generate(options);
  EXPECT_TRUE(files) << (files ? "" : files.error().text);
  return files ? *files : GeneratedFiles{};
}

GltfModel load(const std::filesystem::path& file) {
  physics::Result<GltfModel> model = scene::import_gltf(file);
  EXPECT_TRUE(model) << (model ? "" : model.error().text);
  return model ? std::move(*model) : GltfModel{};
}

std::uint64_t triangles(const GltfModel& model) {
  std::uint64_t count = 0;
  for (const scene::GltfPlacement& placement : model.placements) {
    count += model.meshes[placement.mesh].indices.size() / 3;
  }
  return count;
}

const Mesh& mesh_named(const GltfModel& model, const std::string& name) {
  const auto found = std::find_if(model.meshes.begin(), model.meshes.end(),
                                  [&](const Mesh& m) { return m.name == name; });
  EXPECT_NE(found, model.meshes.end()) << name;
  return *found;
}

enum class Identity : std::uint8_t { position, index };

/// Counts edges that are not used exactly once in each direction. Flat-shaded corners are one point
/// by position. Where vertices are shared, the index is enough and much faster.
std::size_t open_edges(const Mesh& mesh, Identity identity = Identity::position) {
  using Point = std::tuple<float, float, float>;
  std::map<Point, std::uint32_t> points;
  const auto id = [&](std::uint32_t index) {
    if (identity == Identity::index) {
      return index;
    }
    const glm::vec3& p = mesh.positions_m[index];
    return points.emplace(Point(p.x, p.y, p.z), static_cast<std::uint32_t>(points.size()))
        .first->second;
  };
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    for (std::size_t k = 0; k < 3; ++k) {
      edges.emplace_back(id(mesh.indices[i + k]), id(mesh.indices[i + (k + 1) % 3]));
    }
  }
  std::sort(edges.begin(), edges.end());
  std::size_t open = 0;
  for (const auto& edge : edges) {
    const auto forth = std::equal_range(edges.begin(), edges.end(), edge);
    const auto back =
        std::equal_range(edges.begin(), edges.end(), std::pair(edge.second, edge.first));
    open += forth.second - forth.first != 1 || back.second - back.first != 1 ? 1U : 0U;
  }
  return open;
}

double enclosed_volume_m3(const Mesh& mesh) {
  double volume = 0.0;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    const auto p = [&](std::size_t k) { return glm::dvec3(mesh.positions_m[mesh.indices[i + k]]); };
    volume += glm::dot(p(0), glm::cross(p(1), p(2))) / 6.0;
  }
  return volume;
}

std::size_t connected_parts(const Mesh& mesh) {
  std::vector<std::uint32_t> parent(mesh.positions_m.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto root = [&parent](std::uint32_t v) {
    while (parent[v] != v) {
      v = parent[v] = parent[parent[v]];
    }
    return v;
  };
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    parent[root(mesh.indices[i])] = root(mesh.indices[i + 1]);
    parent[root(mesh.indices[i + 1])] = root(mesh.indices[i + 2]);
  }
  std::set<std::uint32_t> roots;
  for (const std::uint32_t index : mesh.indices) {
    roots.insert(root(index));
  }
  return roots.size();
}

TEST(GenerateBox, has_exactly_45_triangles_and_a_closed_box) {
  const auto folder = test::test_folder();
  const GeneratedFiles files = run(of(SceneKind::box), folder);
  ASSERT_EQ(files.files.size(), 1U);
  EXPECT_EQ(files.files[0].triangles, 45U);
  const GltfModel model = load(folder / "box.glb");
  EXPECT_EQ(triangles(model), 45U);
  EXPECT_EQ(model.dropped_triangles, 0U);
  EXPECT_EQ(open_edges(mesh_named(model, "box")), 0U);
  EXPECT_NEAR(enclosed_volume_m3(mesh_named(model, "box")), 8.0, 1e-5);
}

TEST(GenerateBox, stands_alone_without_a_plane) {
  const auto folder = test::test_folder();
  GenerateOptions options = of(SceneKind::box);
  options.box = {1.0, 0.0};
  const GeneratedFiles files = run(options, folder);
  ASSERT_EQ(files.files.size(), 1U);
  EXPECT_EQ(files.files[0].triangles, 20U);
  const GltfModel model = load(folder / "box.glb");
  ASSERT_EQ(model.meshes.size(), 1U);
  EXPECT_EQ(open_edges(mesh_named(model, "box")), 0U);
  EXPECT_NEAR(enclosed_volume_m3(mesh_named(model, "box")), 1.0, 1e-5);
}

TEST(GenerateBox, plane_covers_its_square_once) {
  const auto folder = test::test_folder();
  run(of(SceneKind::box), folder);
  const GltfModel model = load(folder / "box.glb");
  const Mesh& plane = mesh_named(model, "plane");
  double area = 0.0;
  for (std::size_t i = 0; i < plane.indices.size(); i += 3) {
    const auto p = [&](std::size_t k) {
      return glm::dvec3(plane.positions_m[plane.indices[i + k]]);
    };
    const glm::dvec3 cross = glm::cross(p(1) - p(0), p(2) - p(0));
    EXPECT_GT(cross.y, 0.0) << "faces down";
    area += 0.5 * cross.y;
  }
  EXPECT_NEAR(area, 1600.0, 1e-2);
}

TEST(GenerateStatue, is_one_closed_surface_of_the_asked_size) {
  const auto folder = test::test_folder();
  GenerateOptions options = of(SceneKind::statue);
  options.statue.min_triangles = 60'000;
  run(options, folder);
  const GltfModel model = load(folder / "statue.glb");
  const Mesh& statue = mesh_named(model, "statue");
  EXPECT_GE(statue.indices.size() / 3, 60'000U);
  EXPECT_LT(statue.indices.size() / 3, 72'000U);
  EXPECT_EQ(model.dropped_triangles, 0U);
  EXPECT_EQ(open_edges(statue, Identity::index), 0U);
  EXPECT_EQ(connected_parts(statue), 1U);
  EXPECT_GT(enclosed_volume_m3(statue), 1.0);
  EXPECT_NEAR(statue.bounds.max_m.y, 2.6, 0.05);
}

TEST(GenerateStatue, default_has_the_papers_triangle_count) {
  const auto folder = test::test_folder();
  const GeneratedFiles files = run(of(SceneKind::statue), folder);
  const GltfModel model = load(folder / "statue.glb");
  const Mesh& statue = mesh_named(model, "statue");
  EXPECT_GE(statue.indices.size() / 3, 1'080'000U);
  EXPECT_LT(files.files.at(0).triangles, 1'200'000U);
  EXPECT_EQ(model.dropped_triangles, 0U);
  EXPECT_EQ(open_edges(statue, Identity::index), 0U);
  EXPECT_EQ(connected_parts(statue), 1U);
}

TEST(GenerateBlockOnRoad, solid_block_is_closed_and_has_its_size) {
  const auto folder = test::test_folder();
  GenerateOptions options = of(SceneKind::block_on_road);
  options.block_on_road.wall_thickness_m = 0.0;
  options.block_on_road.block_east_m = 3.0;
  run(options, folder);
  const GltfModel model = load(folder / "block-on-road.glb");
  EXPECT_EQ(open_edges(mesh_named(model, "block")), 0U);
  EXPECT_NEAR(enclosed_volume_m3(mesh_named(model, "block")), 3.0, 1e-5);
}

TEST(GenerateBlockOnRoad, hollow_block_has_an_inner_face_one_wall_inside) {
  const auto folder = test::test_folder();
  run(of(SceneKind::block_on_road), folder);
  const GltfModel model = load(folder / "block-on-road.glb");
  const Mesh& block = mesh_named(model, "block");
  const Mesh& inner = mesh_named(model, "block_inner");
  EXPECT_NEAR(block.bounds.max_m.x - inner.bounds.max_m.x, 0.10, 1e-6);
  EXPECT_NEAR(block.bounds.max_m.y - inner.bounds.max_m.y, 0.10, 1e-6);
  // Outer faces, rim and inner faces bound the walls: 2x1x1 less 1.8x0.8x0.9.
  EXPECT_NEAR(enclosed_volume_m3(block) + enclosed_volume_m3(inner), 2.0 - 1.8 * 0.8 * 0.9, 1e-5);
  // Inner faces look into the cavity.
  for (std::size_t v = 0; v < inner.positions_m.size(); ++v) {
    const glm::vec3 to_middle = glm::vec3(0.0F, 0.45F, 0.0F) - inner.positions_m[v];
    EXPECT_GT(glm::dot(to_middle, inner.normals[v]), 0.0F);
  }
}

TEST(GenerateRibbed, has_ribs_of_the_asked_number_and_height) {
  const auto folder = test::test_folder();
  GenerateOptions options = of(SceneKind::ribbed);
  options.ribbed.ribs = 5;
  run(options, folder);
  const GltfModel model = load(folder / "ribbed.glb");
  const Mesh& mesh = mesh_named(model, "ribbed");
  EXPECT_NEAR(mesh.bounds.max_m.y, 0.25, 1e-6);
  EXPECT_NEAR(mesh.bounds.max_m.x - mesh.bounds.min_m.x, 2.5, 1e-6);
  std::set<float> tops;
  for (std::size_t v = 0; v < mesh.positions_m.size(); ++v) {
    if (mesh.normals[v].y > 0.9F && mesh.positions_m[v].y > 0.2F) {
      tops.insert(mesh.positions_m[v].x);
    }
  }
  EXPECT_EQ(tops.size(), 10U);  // two edges a rib
  EXPECT_NEAR(enclosed_volume_m3(mesh), 4.0 * (2.5 * 0.25 + 5 * 0.25 * 0.25), 1e-4);
}

TEST(GenerateAll, small_scenes_load_without_complaint) {
  for (const SceneKind kind : {SceneKind::box, SceneKind::block_on_road, SceneKind::ribbed}) {
    const GeneratedFiles files = run(of(kind), test::test_folder());
    for (const GeneratedFile& file : files.files) {
      const GltfModel model = load(file.path);
      EXPECT_TRUE(model.warnings.empty()) << file.path << ": " << model.warnings.front();
    }
  }
}

TEST(GenerateAirfield, stays_within_its_triangle_budget_and_loads_without_complaint) {
  const auto folder = test::test_folder();
  const GeneratedFiles files = run(of(SceneKind::airfield), folder);
  std::uint64_t total = 0;
  for (const GeneratedFile& file : files.files) {
    const GltfModel model = load(file.path);
    // Foliage cuts its cards into pieces; nothing else changes on the way.
    if (file.path.stem() == "airfield") {
      EXPECT_GT(triangles(model), file.triangles) << file.path;
    } else {
      EXPECT_EQ(triangles(model), file.triangles) << file.path;
    }
    EXPECT_EQ(model.dropped_triangles, 0U) << file.path;
    EXPECT_TRUE(model.warnings.empty()) << model.warnings.front();
    total += triangles(model);
  }
  EXPECT_GE(total, 20'000U);
  EXPECT_LE(total, 80'000U);
  for (const char* name : {"airfield", "truck", "fuel_truck", "car", "jet", "airliner"}) {
    EXPECT_TRUE(std::filesystem::exists(folder / (std::string(name) + ".glb"))) << name;
  }
}

TEST(GenerateAirfield, ground_is_covered_exactly_once) {
  const auto folder = test::test_folder();
  run(of(SceneKind::airfield), folder);
  const GltfModel model = load(folder / "airfield.glb");
  const Mesh& ground = mesh_named(model, "ground");
  double area = 0.0;
  for (std::size_t i = 0; i < ground.indices.size(); i += 3) {
    const auto p = [&](std::size_t k) {
      return glm::dvec3(ground.positions_m[ground.indices[i + k]]);
    };
    EXPECT_EQ(p(0).y, 0.0);
    const double upward = 0.5 * glm::cross(p(1) - p(0), p(2) - p(0)).y;
    EXPECT_GT(upward, 0.0) << p(0).x << ", " << p(0).z;
    area += upward;
  }
  for (const glm::vec3& normal : ground.normals) EXPECT_EQ(normal, glm::vec3(0.0F, 1.0F, 0.0F));
  EXPECT_NEAR(area, 6000.0 * 6000.0, 36.0);
  // The rim alone is open, with an edge for each field along it: 4 corners and 6 of fields that end
  // there. A corner on the edge of a neighbour would open that edge.
  EXPECT_EQ(open_edges(ground), 10U);
}

/// Area of the parts of a mesh that have a material.
double area_m2(const GltfModel& model, const Mesh& mesh, const std::string& material) {
  double area = 0.0;
  for (const scene::Submesh& part : mesh.submeshes) {
    if (model.materials.at(part.material).name != material) continue;
    for (std::size_t i = part.first_index; i < part.first_index + part.index_count; i += 3) {
      const auto p = [&](std::size_t k) {
        return glm::dvec3(mesh.positions_m[mesh.indices[i + k]]);
      };
      area += 0.5 * glm::length(glm::cross(p(1) - p(0), p(2) - p(0)));
    }
  }
  return area;
}

TEST(GenerateAirfield, ground_has_the_paint_rubber_slabs_and_repairs_of_its_plan) {
  const auto folder = test::test_folder();
  run(of(SceneKind::airfield), folder);
  const GltfModel model = load(folder / "airfield.glb");
  const Mesh& ground = mesh_named(model, "ground");
  // The side stripes alone are 2 x 960 m x 0.9 m, the ten keys of an end 10 x 30 m x 1.8 m.
  EXPECT_GT(area_m2(model, ground, "runway_paint"), 2.0 * 960.0 * 0.9 + 2.0 * 10 * 30 * 1.8);
  EXPECT_LT(area_m2(model, ground, "runway_paint"), 8000.0);
  // The line along the taxiway is 960 m x 0.4 m.
  EXPECT_GT(area_m2(model, ground, "paint_yellow"), 380.0);
  EXPECT_GT(area_m2(model, ground, "asphalt_rubber"), 1000.0);
  EXPECT_GT(area_m2(model, ground, "asphalt_new"), 1000.0);
  // Both ends of the runway are 120 m x 45 m of slabs of three ages.
  double slabs_m2 = 0.0;
  for (const char* age : {"concrete_pavement", "concrete_pavement_worn", "concrete_pavement_old"}) {
    EXPECT_GT(area_m2(model, ground, age), 1000.0) << age;
    slabs_m2 += area_m2(model, ground, age);
  }
  EXPECT_GT(slabs_m2, 2.0 * 120.0 * 45.0);
}

TEST(GenerateAirfield, foliage_of_the_avenue_has_gaps) {
  const auto folder = test::test_folder();
  run(of(SceneKind::airfield), folder);
  const GltfModel model = load(folder / "airfield.glb");
  const Mesh& trees = mesh_named(model, "trees");
  // Count the triangles of double-sided foliage: cards that nothing cut would be two each.
  std::size_t pieces = 0;
  for (const scene::Submesh& part : trees.submeshes) {
    const scene::GltfMaterial& material = model.materials.at(part.material);
    if (material.name == "foliage" && material.double_sided) pieces += part.index_count / 3;
  }
  EXPECT_GT(pieces, 20U * 3U * 20U);
  EXPECT_LT(pieces, 30'000U);
}

TEST(GenerateAirfield, vehicles_stand_on_the_ground_and_face_forward) {
  const auto folder = test::test_folder();
  run(of(SceneKind::airfield), folder);
  for (const char* name : {"truck", "fuel_truck", "car", "jet", "airliner"}) {
    const GltfModel model = load(folder / (std::string(name) + ".glb"));
    scene::Aabb box;
    for (const Mesh& mesh : model.meshes) {
      box.add(mesh.bounds);
    }
    EXPECT_NEAR(box.min_m.y, 0.0, 0.02) << name;
    EXPECT_NEAR(box.min_m.x, -box.max_m.x, 0.05) << name;
    EXPECT_GT(box.max_m.z - box.min_m.z, box.max_m.x - box.min_m.x) << name;
  }
  // The jet's nozzle lies behind its middle.
  const GltfModel jet = load(folder / "jet.glb");
  for (const scene::Submesh& submesh : jet.meshes.at(0).submeshes) {
    if (jet.materials.at(submesh.material).name == "nozzle_hot") {
      const std::uint32_t index = jet.meshes[0].indices.at(submesh.first_index);
      EXPECT_LT(jet.meshes[0].positions_m.at(index).z, -5.0F);
    }
  }
}

TEST(GenerateAll, same_options_give_the_same_bytes) {
  const auto bytes = [](const std::filesystem::path& file) {
    std::string content(std::filesystem::file_size(file), '\0');
    std::ifstream(file, std::ios::binary)
        .read(content.data(), static_cast<std::streamsize>(content.size()));
    return content;
  };
  const auto folder = test::test_folder();
  for (const SceneKind kind : {SceneKind::box, SceneKind::block_on_road, SceneKind::ribbed,
                               SceneKind::airfield, SceneKind::statue}) {
    GenerateOptions options = of(kind);
    options.statue.min_triangles = 20'000;
    const GeneratedFiles first = run(options, folder / "first");
    const GeneratedFiles second = run(options, folder / "second");
    ASSERT_EQ(first.files.size(), second.files.size());
    for (std::size_t i = 0; i < first.files.size(); ++i) {
      const std::string once = bytes(first.files[i].path);
      EXPECT_EQ(once.size(), first.files[i].bytes);
      EXPECT_TRUE(once == bytes(second.files[i].path)) << first.files[i].path;
    }
  }
}

TEST(GenerateAll, normals_are_unit_and_agree_with_the_winding) {
  const auto folder = test::test_folder();
  for (const SceneKind kind : {SceneKind::box, SceneKind::block_on_road, SceneKind::ribbed,
                               SceneKind::airfield, SceneKind::statue}) {
    GenerateOptions options = of(kind);
    options.statue.min_triangles = 20'000;
    for (const GeneratedFile& file : run(options, folder).files) {
      for (const Mesh& mesh : load(file.path).meshes) {
        std::size_t against = 0;
        for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
          const auto p = [&](std::size_t k) {
            return glm::dvec3(mesh.positions_m[mesh.indices[i + k]]);
          };
          const glm::dvec3 face = glm::normalize(glm::cross(p(1) - p(0), p(2) - p(0)));
          for (std::size_t k = 0; k < 3; ++k) {
            const glm::dvec3 normal(mesh.normals[mesh.indices[i + k]]);
            EXPECT_NEAR(glm::length(normal), 1.0, 1e-5);
            against += glm::dot(normal, face) < 0.0 ? 1U : 0U;
          }
        }
        // Folds sharper than the coarse test mesh may turn a few of the statue's corners.
        EXPECT_LE(against, mesh.name == "statue" ? mesh.indices.size() / 200 : 0U)
            << file.path << " " << mesh.name;
      }
    }
  }
}

TEST(GenerateAll, options_out_of_range_are_named) {
  const auto error = [](const GenerateOptions& options) {
    const auto files = generate(options);
    EXPECT_FALSE(files);
    return files ? std::string() : files.error().text;
  };
  GenerateOptions options = of(SceneKind::box);
  options.directory = test::test_folder();
  options.box.size_m = -1.0;
  EXPECT_THAT(error(options), HasSubstr("size_m"));
  options.kind = SceneKind::block_on_road;
  options.block_on_road.wall_thickness_m = 0.6;
  EXPECT_THAT(error(options), HasSubstr("wall_thickness_m"));
  options.kind = SceneKind::ribbed;
  options.ribbed.rib_width_m = std::nan("");
  EXPECT_THAT(error(options), HasSubstr("rib_width_m"));
  options.kind = SceneKind::airfield;
  options.directory = "/proc/nowhere";
  EXPECT_THAT(error(options), HasSubstr("/proc/nowhere"));
}

TEST(GenerateAll, names_round_trip) {
  for (const SceneKind kind : {SceneKind::box, SceneKind::statue, SceneKind::block_on_road,
                               SceneKind::ribbed, SceneKind::airfield}) {
    EXPECT_EQ(scene_kind_from(to_string(kind)), kind);
  }
  EXPECT_FALSE(scene_kind_from("castle"));
}

}  // namespace
}  // namespace emit::scenegen
