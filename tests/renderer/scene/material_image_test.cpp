// SPDX-License-Identifier: Apache-2.0
// Surfaces whose materials an image gives, against the definition: a point has the material of its
// texel.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <map>
#include <random>
#include <set>

#include "emit/scene/gltf_import.hpp"
#include "emit/scene/inspect.hpp"
#include "emit/scene/mesh.hpp"
#include "renderer/scene/gltf_builder.hpp"
#include "renderer/scene/image_card.hpp"

namespace emit::scene {
namespace {

using test::Card;
using test::GltfText;
using test::test_folder;
using test::write_file;
using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

using Colour = std::array<std::uint8_t, 3>;
constexpr Colour kGreen{0x4a, 0x5d, 0x23};
constexpr Colour kBrown{0x6b, 0x4f, 0x2a};
constexpr Colour kBlack{0x1c, 0x1c, 0x1c};
const std::vector<Colour> kLegend{kGreen, kBrown, kBlack};

/// An image of colours.
struct Painting {
  int width_px = 0;
  int height_px = 0;
  std::vector<Colour> texels;

  Painting(int width, int height, const std::function<Colour(int, int)>& of)
      : width_px(width), height_px(height) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) texels.push_back(of(x, y));
    }
  }
  [[nodiscard]] const Colour& at(int x, int y) const {
    return texels[static_cast<std::size_t>(y * width_px + x)];
  }
  [[nodiscard]] std::string png() const {
    std::string rgba;
    for (const Colour& colour : texels) {
      for (const std::uint8_t value : colour) rgba += static_cast<char>(value);
      rgba += '\xff';
    }
    return test::png_of(width_px, height_px, rgba);
  }
  /// Share of the texels that have a colour.
  [[nodiscard]] double share(const Colour& colour) const {
    return static_cast<double>(std::ranges::count(texels, colour)) /
           static_cast<double>(texels.size());
  }
};

/// Patches in no order, of the colours of the legend.
Painting camouflage(int width, int height) {
  return {width, height, [](int x, int y) {
            const double a = std::sin(0.21 * x + 1.3 * std::sin(0.11 * y)) + std::cos(0.17 * y);
            const double b = std::sin(0.13 * y - 0.09 * x) + std::sin(0.31 * x);
            return a > 0.6 ? kBlack : b > 0.0 ? kGreen : kBrown;
          }};
}

MaterialImage image_of(const std::string& material = "leaf") {
  return {material, {}, {{kBlack, "rubber"}, {kGreen, "paint_green"}, {kBrown, "paint_brown"}}, 1};
}

physics::Result<GltfModel> try_import(const std::string& json, const MaterialImage& image) {
  return import_gltf(write_file(test_folder() / "card.gltf", json), std::span(&image, 1));
}
GltfModel imported(const std::string& json, const MaterialImage& image = image_of()) {
  auto model = try_import(json, image);
  EXPECT_TRUE(model) << (model ? "" : model.error().text);
  return model ? std::move(*model) : GltfModel{};
}

/// A card of the painting; its glTF material is opaque.
Card plain_card() {
  Card card;
  card.material = R"("alphaMode":"OPAQUE")";
  return card;
}

struct Piece {
  std::array<glm::dvec3, 3> corner;
  std::string library;
};
std::vector<Piece> pieces_of(const GltfModel& model) {
  std::vector<Piece> out;
  for (const Mesh& mesh : model.meshes) {
    for (const Submesh& submesh : mesh.submeshes) {
      for (std::uint32_t i = 0; i < submesh.index_count; i += 3) {
        Piece piece;
        for (std::uint32_t c = 0; c < 3; ++c) {
          piece.corner[c] = glm::dvec3(mesh.positions_m[mesh.indices[submesh.first_index + i + c]]);
        }
        if (submesh.material < model.materials.size()) {
          piece.library = model.materials[submesh.material].library;
        }
        out.push_back(piece);
      }
    }
  }
  return out;
}

/// Area of each material in square metres.
std::map<std::string, double> areas_of(const GltfModel& model) {
  std::map<std::string, double> out;
  for (const Piece& piece : pieces_of(model)) {
    out[piece.library] += 0.5 * glm::length(glm::cross(piece.corner[1] - piece.corner[0],
                                                       piece.corner[2] - piece.corner[0]));
  }
  return out;
}

std::string library_of(const Colour& colour) {
  for (const MaterialColour& entry : image_of().legend) {
    if (entry.rgb == colour) return entry.material;
  }
  return "";
}

/// Materials of the card at a point, one for each piece that covers it.
std::vector<std::string> materials_at(const std::vector<Piece>& pieces, const glm::dvec2& p) {
  std::vector<std::string> out;
  for (const Piece& piece : pieces) {
    bool inside = true;
    for (std::size_t c = 0; c < 3; ++c) {
      const glm::dvec2 from(piece.corner[c]);
      const glm::dvec2 side = glm::dvec2(piece.corner[(c + 1) % 3]) - from;
      const glm::dvec2 to = p - from;
      inside = inside && side.x * to.y - side.y * to.x > 0.0;
    }
    if (inside) out.push_back(piece.library);
  }
  return out;
}

int wrapped_texel(double place, int size, int wrap) {
  const auto i = static_cast<int>(std::floor(place));
  if (wrap == 33071) return std::clamp(i, 0, size - 1);
  const int turn = static_cast<int>(std::floor(static_cast<double>(i) / size));
  const int rest = i - turn * size;
  return wrap == 33648 && turn % 2 != 0 ? size - 1 - rest : rest;
}

TEST(MaterialImage, each_point_has_the_material_of_its_texel_and_none_is_left_out) {
  const Painting painting = camouflage(96, 64);
  for (const int wrap : {10497, 33071, 33648}) {
    for (const double repeats : {0.9, 1.0, 2.5}) {
      SCOPED_TRACE(testing::Message() << "sampler " << wrap << ", " << repeats << " times");
      Card card = plain_card();
      card.wrap = wrap;
      card.repeats = repeats;
      const GltfModel model = imported(card.json(test::embedded_png(painting.png())));
      EXPECT_THAT(model.warnings, Each(Not(HasSubstr("card.gltf"))));
      const std::vector<Piece> pieces = pieces_of(model);
      std::mt19937 random(7);
      std::uniform_real_distribution<double> place(0.002, 0.998);
      int wrong = 0;
      int uncovered = 0;
      int sure = 0;
      for (int i = 0; i < 3000; ++i) {
        const glm::dvec2 p(place(random), place(random));
        const glm::dvec2 px(repeats * p.x * painting.width_px,
                            repeats * (1.0 - p.y) * painting.height_px);
        const auto colour_at = [&](double dx, double dy) {
          return painting.at(wrapped_texel(px.x + dx, painting.width_px, wrap),
                             wrapped_texel(px.y + dy, painting.height_px, wrap));
        };
        const Colour colour = colour_at(0.0, 0.0);
        const std::vector<std::string> found = materials_at(pieces, p);
        uncovered += found.size() != 1 ? 1 : 0;
        // Straight lines leave the sides of texels by 0.75 of them.
        bool is_sure = true;
        for (const double dx : {-0.8, 0.0, 0.8}) {
          for (const double dy : {-0.8, 0.0, 0.8}) {
            is_sure = is_sure && colour_at(dx, dy) == colour;
          }
        }
        if (!is_sure) continue;
        ++sure;
        wrong += found.empty() || found[0] != library_of(colour) ? 1 : 0;
      }
      EXPECT_GT(sure, 1500);
      // A point on the seam of two pieces belongs to neither.
      EXPECT_LE(uncovered, 3);
      EXPECT_LE(wrong, 3);
    }
  }
}

TEST(MaterialImage, rectangles_of_texels_keep_their_areas_exactly) {
  const Painting painting(40, 20, [](int x, int y) {
    return x < 13 ? kGreen : y >= 7 && y < 11 && x < 30 ? kBlack : kBrown;
  });
  const auto area = areas_of(imported(plain_card().json(test::embedded_png(painting.png()))));
  ASSERT_EQ(area.size(), 3U);
  for (const Colour& colour : kLegend) {
    EXPECT_NEAR(area.at(library_of(colour)), painting.share(colour), 1e-6);
  }
}

TEST(MaterialImage, areas_of_patches_are_those_of_their_texels) {
  for (const int size : {64, 257}) {
    const Painting painting = camouflage(size, size);
    const auto area = areas_of(imported(plain_card().json(test::embedded_png(painting.png()))));
    ASSERT_EQ(area.size(), 3U);
    double sum = 0.0;
    for (const Colour& colour : kLegend) {
      EXPECT_NEAR(area.at(library_of(colour)), painting.share(colour), 0.02) << size;
      sum += area.at(library_of(colour));
    }
    EXPECT_NEAR(sum, 1.0, 1e-5);
  }
}

TEST(MaterialImage, an_image_of_single_texels_is_cut_in_full) {
  // Blocks full of outlines are closed along their sides: 4000 holes in one polygon take minutes.
  const Painting painting(128, 128,
                          [](int x, int y) { return x % 2 == 1 && y % 2 == 1 ? kBlack : kGreen; });
  const auto area = areas_of(imported(plain_card().json(test::embedded_png(painting.png()))));
  double sum = 0.0;
  for (const auto& [material, area_m2] : area) sum += area_m2;
  EXPECT_NEAR(sum, 1.0, 1e-5);
  EXPECT_GT(area.at("rubber"), 0.1);
}

TEST(MaterialImage, mixed_texels_along_an_outline_become_no_third_material) {
  // Black between light and dark: a filter mixes white and black, and the mean is the grey.
  constexpr Colour kWhite{0xf0, 0xf0, 0xf0};
  constexpr Colour kGrey{0x86, 0x86, 0x86};
  const Painting painting(32, 32, [&](int x, int y) {
    if (y < 4) return kGrey;
    return x < 15 ? kWhite : x > 16 ? kBlack : kGrey;
  });
  Painting mixed = painting;
  for (Colour& colour : mixed.texels) {
    if (colour == kGrey) colour = {0x80, 0x84, 0x80};
  }
  MaterialImage image{"leaf", {}, {{kBlack, "rubber"}, {kGrey, "steel"}, {kWhite, "snow"}}, 1};
  const auto exact =
      areas_of(imported(plain_card().json(test::embedded_png(painting.png())), image));
  EXPECT_NEAR(exact.at("steel"), painting.share(kGrey), 1e-6);
  // The first rows are grey through and through, and stay so; the line between is a mixture.
  for (int x = 0; x < 32; ++x) {
    for (int y = 0; y < 4; ++y) mixed.texels[static_cast<std::size_t>(32 * y + x)] = kGrey;
  }
  for (Colour& colour : mixed.texels) {
    if (colour == Colour{0x80, 0x84, 0x80}) colour = {0x70, 0x70, 0x70};
  }
  const auto area = areas_of(imported(plain_card().json(test::embedded_png(mixed.png())), image));
  EXPECT_NEAR(area.at("steel"), 4.0 / 32.0, 0.01);
}

TEST(MaterialImage, small_patches_take_what_is_around_them) {
  const Painting painting(64, 64, [](int x, int y) {
    if (x >= 40 && x < 50 && y >= 40 && y < 50) return kBlack;  // 100 texels
    return x % 16 == 3 && y % 16 < 2 ? kBrown : kGreen;         // 2 texels each
  });
  MaterialImage image = image_of();
  const std::string json = plain_card().json(test::embedded_png(painting.png()));
  EXPECT_EQ(areas_of(imported(json, image)).size(), 3U);
  image.smallest_patch_px = 3;
  const auto area = areas_of(imported(json, image));
  ASSERT_EQ(area.size(), 2U);
  EXPECT_NEAR(area.at("rubber"), painting.share(kBlack), 1e-6);
}

/// A cube whose six faces show different parts of one image, each turned its own way, so that
/// outlines end at an edge of one face and not at the same place of its neighbour.
std::string cube(const std::string& image) {
  std::string positions;
  std::string uv;
  std::string indices;
  std::uint16_t count = 0;
  const auto put = [](std::string& out, auto value) {
    out.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    const float side = face % 2 == 0 ? 1.0F : 0.0F;
    for (int c = 0; c < 4; ++c) {
      const float a = c == 1 || c == 2 ? 1.0F : 0.0F;
      const float b = c >= 2 ? 1.0F : 0.0F;
      glm::vec3 p(0.0F);
      p[axis] = side;
      p[(axis + 1) % 3] = face % 2 == 0 ? a : b;
      p[(axis + 2) % 3] = face % 2 == 0 ? b : a;
      for (int k = 0; k < 3; ++k) put(positions, p[k]);
      const float turn = 0.4F * static_cast<float>(face);
      put(uv, 0.1F * static_cast<float>(face) + 0.7F * (a * std::cos(turn) - b * std::sin(turn)));
      put(uv, 0.3F + 0.7F * (a * std::sin(turn) + b * std::cos(turn)));
    }
    for (const int i : {0, 1, 2, 0, 2, 3}) put(indices, static_cast<std::uint16_t>(count + i));
    count = static_cast<std::uint16_t>(count + 4);
  }
  GltfText text;
  text.buffer = positions + uv + indices;
  text.views = R"({"buffer":0,"byteOffset":0,"byteLength":288},
                  {"buffer":0,"byteOffset":288,"byteLength":192},
                  {"buffer":0,"byteOffset":480,"byteLength":72})";
  text.accessors = R"({"bufferView":0,"componentType":5126,"count":24,"type":"VEC3"},
                      {"bufferView":1,"componentType":5126,"count":24,"type":"VEC2"},
                      {"bufferView":2,"componentType":5123,"count":36,"type":"SCALAR"})";
  text.primitive = R"({"attributes":{"POSITION":0,"TEXCOORD_0":1},"indices":2,"material":0})";
  text.materials = R"({"name":"leaf","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})";
  text.extra = R"("textures":[{"source":0}],"images":[)" + image + "],";
  return text.json();
}

TEST(MaterialImage, a_closed_body_stays_closed_and_its_faces_stay_flat) {
  for (const int size : {7, 16, 33, 64, 131, 200}) {
    SCOPED_TRACE(testing::Message() << size << " texels");
    const GltfModel model = imported(cube(test::embedded_png(camouflage(size, size + 5).png())));
    ASSERT_EQ(model.meshes.size(), 1U);
    const Mesh& mesh = model.meshes[0];
    EXPECT_GE(mesh.submeshes.size(), 2U);
    EXPECT_TRUE(mesh.closed);
    double area_m2 = 0.0;
    for (const auto& [material, part_m2] : areas_of(model)) area_m2 += part_m2;
    EXPECT_NEAR(area_m2, 6.0, 1e-5);
    for (const glm::vec3& normal : mesh.normals) {
      const glm::vec3 size_of = glm::abs(normal);
      EXPECT_NEAR(std::max({size_of.x, size_of.y, size_of.z}), 1.0F, 1e-6F);
    }
    EXPECT_THAT(model.warnings, Each(Not(HasSubstr("card.gltf"))));
  }
}

TEST(MaterialImage, a_mask_cuts_before_materials_do) {
  const Painting painting = camouflage(64, 64);
  std::string rgba;
  for (int i = 0; i < 64 * 64; ++i) {
    for (const std::uint8_t value : painting.texels[static_cast<std::size_t>(i)]) {
      rgba += static_cast<char>(value);
    }
    rgba += i % 64 < 32 ? '\xff' : '\0';
  }
  const auto area = areas_of(imported(Card{}.json(test::embedded_png(test::png_of(64, 64, rgba)))));
  double sum = 0.0;
  for (const auto& [material, part_m2] : area) sum += part_m2;
  EXPECT_EQ(area.size(), 3U);
  // The image repeats, so that half a texel at each of its edges is kept beyond or lost.
  EXPECT_NEAR(sum, 0.5, 0.01);
}

TEST(MaterialImage, an_image_of_the_scenario_takes_the_place_of_that_of_the_file) {
  const auto folder = test_folder();
  const Painting painting = camouflage(64, 64);
  write_file(folder / "parts.png", painting.png());
  const Painting other(8, 8, [](int, int) { return kBlack; });
  MaterialImage image = image_of();
  image.image = folder / "parts.png";
  const auto model = import_gltf(
      write_file(folder / "card.gltf", plain_card().json(test::embedded_png(other.png()))),
      std::span(&image, 1));
  ASSERT_TRUE(model) << model.error().text;
  EXPECT_NEAR(areas_of(*model).at("paint_green"), painting.share(kGreen), 0.02);
  EXPECT_THAT(model->warnings, Each(Not(HasSubstr("one set of properties"))));
}

TEST(MaterialImage, a_scene_has_the_materials_of_the_legend) {
  const auto folder = test_folder();
  ScenarioDesc scenario;
  scenario.file = "test.toml";
  for (const char* name : {"concrete", "paint_brown", "paint_green", "rubber", "steel"}) {
    Material material;
    material.name = name;
    scenario.materials.push_back(material);
  }
  scenario.default_material = "concrete";
  ObjectDesc object;
  object.name = "truck";
  object.gltf = write_file(folder / "card.gltf",
                           plain_card().json(test::embedded_png(camouflage(32, 32).png())));
  object.instances = {physics::Pose{}};
  object.material = "steel";
  object.material_map["leaf"] = "steel";
  object.material_images = {image_of()};
  scenario.objects = {object, object};
  scenario.objects[1].name = "plain";
  scenario.objects[1].material_images.clear();
  const auto scene = load_scene(scenario);
  ASSERT_TRUE(scene) << scene.error().text;
  std::map<std::uint32_t, std::set<std::string>> used;
  for (const Instance& instance : scene->instances) {
    for (const Submesh& submesh : scene->meshes[instance.mesh].submeshes) {
      used[instance.object].insert(scene->materials[submesh.material].name);
    }
  }
  EXPECT_EQ(used[0], (std::set<std::string>{"paint_brown", "paint_green", "rubber"}));
  EXPECT_EQ(used[1], std::set<std::string>{"steel"});
  EXPECT_THAT(
      scene->mappings,
      Contains(testing::AllOf(testing::Field(&MaterialMapping::gltf_material, "leaf #1c1c1c"),
                              testing::Field(&MaterialMapping::material, "rubber"),
                              testing::Field(&MaterialMapping::by, MappedBy::material_image))));
}

TEST(MaterialImage, faults_are_named) {
  const std::string good = plain_card().json(test::embedded_png(camouflage(16, 16).png()));
  const auto text_of = [](const physics::Result<GltfModel>& model) {
    return model ? std::string("no error") : model.error().text;
  };
  EXPECT_THAT(text_of(try_import(good, image_of("leav"))),
              AllOf(HasSubstr("card.gltf"), HasSubstr("no material 'leav'"), HasSubstr("'leaf'")));
  EXPECT_THAT(
      text_of(try_import(plain_card().json(R"({"uri":"nowhere.png"})"), image_of())),
      AllOf(HasSubstr("material 'leaf'"), HasSubstr("nowhere.png"), HasSubstr("no such file")));
  MaterialImage missing = image_of();
  missing.image = "/nowhere/parts.png";
  EXPECT_THAT(text_of(try_import(good, missing)),
              AllOf(HasSubstr("/nowhere/parts.png"), HasSubstr("no such file")));
  GltfText bare;
  bare.materials = R"({"name":"leaf"})";
  bare.primitive = R"({"attributes":{"POSITION":0},"indices":1,"material":0})";
  EXPECT_THAT(text_of(try_import(bare.json(), image_of())), HasSubstr("no base colour texture"));
}

TEST(MaterialImage, what_the_legend_does_not_know_is_said) {
  const Painting painting(32, 32, [](int x, int) {
    return x < 8 ? Colour{0xff, 0x20, 0xe0} : kGreen;
  });
  const std::string json = plain_card().json(test::embedded_png(painting.png()));
  EXPECT_THAT(imported(json).warnings,
              Contains(AllOf(HasSubstr("25 %"), HasSubstr("unlike all of the legend"))));
  Card card = plain_card();
  card.has_uv = false;
  const GltfModel solid = imported(card.json(test::embedded_png(painting.png())));
  EXPECT_THAT(solid.warnings, Contains(AllOf(HasSubstr("TEXCOORD_0"),
                                             HasSubstr("image of materials has no effect"))));
  EXPECT_NEAR(areas_of(solid).at(""), 1.0, 1e-6);
}

TEST(MaterialImage, main_colours_of_images_are_listed) {
  const auto summary_of = [](const Painting& painting) {
    return inspect_gltf(write_file(test_folder() / "card.gltf",
                                   plain_card().json(test::embedded_png(painting.png()))),
                        {});
  };
  const auto exact = summary_of({20, 10, [](int x, int) { return x < 5 ? kBlack : kGreen; }});
  ASSERT_TRUE(exact);
  using Colours = std::vector<std::pair<std::string, double>>;
  EXPECT_EQ(exact->materials.at(0).colours, (Colours{{"#4a5d23", 0.75}, {"#1c1c1c", 0.25}}));
  EXPECT_THAT(to_text(*exact), HasSubstr("#4a5d23 75.0 % #1c1c1c 25.0 %"));
  EXPECT_THAT(to_json(*exact), HasSubstr(R"({"rgb": "#4a5d23", "frac": 0.75})"));
  // Hundreds of shades of two colours are two colours.
  const auto shaded = summary_of({64, 64, [](int x, int y) {
                                    const auto shade = static_cast<std::uint8_t>((7 * x + y) % 24);
                                    return x < 16 ? Colour{shade, shade, 0}
                                                  : Colour{static_cast<std::uint8_t>(200 + shade),
                                                           64, static_cast<std::uint8_t>(y % 32)};
                                  }});
  ASSERT_TRUE(shaded);
  ASSERT_EQ(shaded->materials.at(0).colours.size(), 2U);
  EXPECT_NEAR(shaded->materials.at(0).colours[0].second, 0.75, 1e-9);
}

}  // namespace
}  // namespace emit::scene
