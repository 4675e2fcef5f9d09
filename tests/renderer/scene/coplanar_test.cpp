// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>

#include "emit/scene/gltf_import.hpp"
#include "emit/scene/mesh.hpp"
#include "renderer/scene/shape_model.hpp"

namespace emit::scene {
namespace {

using test::PlacedTriangle;
using test::Shape;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

GltfModel load(const test::GltfText& text) {
  auto model = import_gltf(test::write_file(test::test_folder() / "model.gltf", text.json()));
  EXPECT_TRUE(model) << (model ? "" : model.error().text);
  return model ? std::move(*model) : GltfModel{};
}
GltfModel load(std::initializer_list<std::pair<std::string, Shape>> shapes) {
  return load(test::text_of(shapes));
}

std::map<std::uint32_t, double> areas(const GltfModel& model) {
  std::map<std::uint32_t, double> area;
  for (const PlacedTriangle& t : test::triangles_of(model)) area[t.material] += glm::length(t.area);
  return area;
}

/// Returns the materials whose triangles hold the point, seen from above.
std::vector<std::uint32_t> materials_at(const GltfModel& model, double x, double z) {
  std::vector<std::uint32_t> found;
  for (const PlacedTriangle& t : test::triangles_of(model)) {
    bool inside = true;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3 edge = t.corner[(k + 1) % 3] - t.corner[k];
      const glm::dvec3 to = glm::dvec3(x, t.corner[k].y, z) - t.corner[k];
      inside = inside && glm::cross(edge, to).y > 0.0;
    }
    if (inside) found.push_back(t.material);
  }
  return found;
}

TEST(Coplanar, a_marking_in_the_plane_of_its_road_cuts_the_road) {
  // The smaller surface wins in both orders.
  const Shape road = Shape::ground(-12, -12, 12, 12);
  const Shape marking = Shape::ground(-0.5F, -10, 0.5F, 10);
  for (const bool road_first : {true, false}) {
    const GltfModel model = road_first ? load({{"road", road}, {"marking", marking}})
                                       : load({{"marking", marking}, {"road", road}});
    const std::uint32_t road_material = road_first ? 0 : 1;
    EXPECT_NEAR(areas(model).at(road_material), 576.0 - 20.0, 0.02);
    EXPECT_NEAR(areas(model).at(1 - road_material), 20.0, 1e-6);
    for (double x = -11.93; x < 12.0; x += 0.371) {
      for (double z = -11.91; z < 12.0; z += 0.383) {
        const bool on_marking = std::abs(x) < 0.5 && std::abs(z) < 10.0;
        EXPECT_THAT(materials_at(model, x, z),
                    testing::ElementsAre(on_marking ? 1 - road_material : road_material))
            << x << ' ' << z;
      }
    }
    EXPECT_THAT(model.warnings, Contains(AllOf(HasSubstr("mesh 'marking'"),
                                               HasSubstr("mesh 'road'"), HasSubstr("plane"))));
  }
}

/// Every edge inside the cut surface belongs to two triangles: there is no gap to look through.
TEST(Coplanar, pieces_share_their_corners) {
  Shape road;
  for (int x = 0; x < 4; ++x) {
    for (int z = 0; z < 4; ++z) {
      const auto fx = static_cast<float>(3 * x);
      const auto fz = static_cast<float>(3 * z);
      const Shape tile = Shape::ground(fx, fz, fx + 3, fz + 3);
      road.positions.insert(road.positions.end(), tile.positions.begin(), tile.positions.end());
      road.normals.insert(road.normals.end(), tile.normals.begin(), tile.normals.end());
    }
  }
  Shape marking;
  marking.add_quad({1.1F, 0, 2.3F}, {2.3F, 0, 9.7F}, {7.9F, 0, 8.8F}, {6.6F, 0, 1.7F});
  const GltfModel model = load({{"road", road}, {"marking", marking}});
  std::map<std::vector<double>, int> edges;
  double road_m2 = 0.0;
  for (const PlacedTriangle& t : test::triangles_of(model)) {
    if (t.material != 0) continue;
    road_m2 += t.area.y;
    EXPECT_GT(t.area.y, 0.0);
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3& a = t.corner[k];
      const glm::dvec3& b = t.corner[(k + 1) % 3];
      ++edges[{a.x, a.z, b.x, b.z}];
    }
  }
  double marking_m2 = 0.0;
  for (const PlacedTriangle& t : test::triangles_of(model)) {
    if (t.material == 1) marking_m2 += t.area.y;
  }
  EXPECT_NEAR(road_m2 + marking_m2, 144.0, 0.02);
  const auto on_border = [](double v) { return v == 0.0 || v == 12.0; };
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    const bool is_border =
        (edge[0] == edge[2] && on_border(edge[0])) || (edge[1] == edge[3] && on_border(edge[1]));
    const glm::dvec3 middle(0.5 * (edge[0] + edge[2]), 0.0, 0.5 * (edge[1] + edge[3]));
    const bool opposite = edges.contains({edge[2], edge[3], edge[0], edge[1]});
    // The rim of the hole lies under the marking's edge.
    const bool at_rim = [&] {
      for (std::size_t k = 0; k < 4; ++k) {
        const glm::dvec3 corners[4] = {{1.1, 0, 2.3}, {2.3, 0, 9.7}, {7.9, 0, 8.8}, {6.6, 0, 1.7}};
        const glm::dvec3 along = glm::normalize(corners[(k + 1) % 4] - corners[k]);
        if (glm::length(glm::cross(along, middle - corners[k])) < 2e-3) return true;
      }
      return false;
    }();
    // Rounding may turn over a sliver between two corners that are hardly apart; then its
    // neighbours overlap.
    const bool at_sliver = std::ranges::any_of(edges, [&](const auto& other) {
      const std::vector<double>& o = other.first;
      const bool back_to_start =
          o[2] == edge[0] && o[3] == edge[1] && std::hypot(o[0] - edge[2], o[1] - edge[3]) < 1e-3;
      const bool back_from_end =
          o[0] == edge[2] && o[1] == edge[3] && std::hypot(o[2] - edge[0], o[3] - edge[1]) < 1e-3;
      return back_to_start || back_from_end;
    });
    EXPECT_TRUE(opposite || is_border || at_rim || at_sliver)
        << edge[0] << ',' << edge[1] << " to " << edge[2] << ',' << edge[3];
  }
}

TEST(Coplanar, twins_and_layers_leave_one_material_at_each_place) {
  // The later of two equal surfaces wins; three layers win by size.
  const GltfModel twins =
      load({{"a", Shape::ground(0, 0, 4, 4)}, {"b", Shape::ground(0, 0, 4, 4)}});
  EXPECT_THAT(materials_at(twins, 1.3, 2.2), testing::ElementsAre(1U));
  EXPECT_EQ(twins.placements.size(), 1U);
  EXPECT_EQ(twins.meshes.size(), 1U);
  const GltfModel layers = load({{"grass", Shape::ground(-20, -20, 20, 20)},
                                 {"road", Shape::ground(-20, -3, 20, 3)},
                                 {"line", Shape::ground(-20, -0.2F, 20, 0.2F)}});
  EXPECT_THAT(materials_at(layers, 1.3, 0.1), testing::ElementsAre(2U));
  EXPECT_THAT(materials_at(layers, 1.3, 2.2), testing::ElementsAre(1U));
  EXPECT_THAT(materials_at(layers, 1.3, 12.2), testing::ElementsAre(0U));
}

TEST(Coplanar, of_a_high_stack_of_equal_surfaces_the_last_one_stays) {
  // A comparison of all pairs would take minutes.
  constexpr std::uint32_t kLayers = 6000;
  std::vector<std::pair<std::string, Shape>> shapes;
  for (std::uint32_t i = 0; i < kLayers; ++i) {
    shapes.emplace_back(std::to_string(i), Shape::ground(0, 0, 4, 4));
  }
  const GltfModel model = load(test::text_of(shapes));
  EXPECT_THAT(materials_at(model, 1.3, 2.2), testing::ElementsAre(kLayers - 1));
  EXPECT_EQ(model.placements.size(), 1U);
}

TEST(Coplanar, surfaces_apart_turned_away_or_of_one_edge_stay_whole) {
  const Shape road = Shape::ground(-12, -12, 12, 12);
  const auto untouched = [](const GltfModel& model) {
    EXPECT_THAT(model.warnings, IsEmpty());
    return areas(model);
  };
  EXPECT_NEAR(untouched(load({{"road", road}, {"slab", Shape::ground(-1, -1, 1, 1, 0.01F)}})).at(0),
              576.0, 1e-6);
  Shape underside = Shape::ground(-1, -1, 1, 1);
  underside.turn_winding().turn_normals();
  EXPECT_NEAR(untouched(load({{"road", road}, {"underside", underside}})).at(0), 576.0, 1e-6);
  EXPECT_NEAR(untouched(load({{"road", road}, {"next", Shape::ground(12, -12, 20, 12)}})).at(0),
              576.0, 1e-6);
}

TEST(Coplanar, slopes_and_far_places_are_cut_too) {
  Shape slope;
  slope.add_quad({-12, -3, -12}, {-12, 3, 12}, {12, 3, 12}, {12, -3, -12});
  Shape marking;
  marking.add_quad({-0.5F, -2.5F, -10}, {-0.5F, 2.5F, 10}, {0.5F, 2.5F, 10}, {0.5F, -2.5F, -10});
  test::GltfText text = test::text_of({{"slope", slope}, {"marking", marking}});
  for (const std::string place : {"[0,0,0]", "[123456.7,89.1,-765432.1]"}) {
    test::GltfText moved = text;
    for (std::size_t at = 0; (at = moved.nodes.find("\"mesh\"", at)) != std::string::npos;) {
      moved.nodes.insert(at, "\"translation\":" + place + ",");
      at += place.size() + 24;
    }
    const double length = std::sqrt(20.0 * 20.0 + 5.0 * 5.0);
    const double whole = 24.0 * std::sqrt(24.0 * 24.0 + 6.0 * 6.0);
    EXPECT_NEAR(areas(load(moved)).at(0), whole - length, 0.03) << place;
  }
}

TEST(Coplanar, a_mesh_that_others_place_is_cut_where_it_is_covered) {
  test::GltfText text =
      test::text_of({{"tile", Shape::ground(0, 0, 4, 4)}, {"mark", Shape::ground(1, 1, 2, 2)}});
  text.nodes += R"(,{"name":"second","mesh":0,"translation":[10,0,0]})";
  text.scenes = R"({"nodes":[0,1,2]})";
  const GltfModel model = load(text);
  EXPECT_NEAR(areas(model).at(0), 32.0 - 1.0, 1e-3);
  EXPECT_THAT(materials_at(model, 1.4, 1.7), testing::ElementsAre(1U));
  EXPECT_THAT(materials_at(model, 11.4, 1.7), testing::ElementsAre(0U));
}

TEST(Coplanar, objects_of_a_scenario_are_cut_as_well) {
  const std::filesystem::path folder = test::test_folder();
  ScenarioDesc scenario;
  scenario.file = "test.toml";
  for (const std::string name : {"asphalt", "paint"}) {
    Material material;
    material.name = name;
    material.emissivity_frac = 0.9;
    scenario.materials.push_back(material);
  }
  scenario.default_material = "asphalt";
  const auto add = [&](const std::string& name, const Shape& shape) {
    ObjectDesc object;
    object.name = name;
    object.gltf =
        test::write_file(folder / (name + ".gltf"), test::text_of({{name, shape}}).json());
    object.instances = {
        physics::Pose{{0, 0, 0}, glm::dquat(0.0, std::sqrt(0.5), std::sqrt(0.5), 0.0)}};
    scenario.objects.push_back(object);
  };
  add("asphalt", Shape::ground(-12, -12, 12, 12));
  add("paint", Shape::ground(-0.5F, -10, 0.5F, 10));
  const auto scene = load_scene(scenario);
  ASSERT_TRUE(scene) << scene.error().text;
  EXPECT_THAT(scene->warnings,
              Contains(AllOf(HasSubstr("object 'paint'"), HasSubstr("object 'asphalt'"))));
  double area_m2 = 0.0;
  for (const Mesh& mesh : scene->meshes) {
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
      const glm::dvec3 a(mesh.positions_m[mesh.indices[i]]);
      area_m2 +=
          0.5 * glm::length(glm::cross(glm::dvec3(mesh.positions_m[mesh.indices[i + 1]]) - a,
                                       glm::dvec3(mesh.positions_m[mesh.indices[i + 2]]) - a));
    }
  }
  EXPECT_NEAR(area_m2, 576.0, 0.02);
}

}  // namespace
}  // namespace emit::scene
