// SPDX-License-Identifier: Apache-2.0
// Surfaces that alpha masks cut out, against the definition: a point is there exactly where the
// bilinear opacity of the image is at least the cutoff.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <numbers>
#include <random>

#include "emit/scene/gltf_import.hpp"
#include "renderer/scene/gltf_builder.hpp"
#include "renderer/scene/image_card.hpp"

namespace emit::scene {
namespace {

using test::Card;
using test::GltfText;
using test::packed;
using test::test_folder;
using test::write_file;
using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

/// Opacity of a picture, 0 to 255, row by row.
struct Opacity {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> values;

  Opacity(int width, int height, const std::function<double(double, double)>& of)
      : width_px(width), height_px(height) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        values.push_back(static_cast<std::uint8_t>(
            std::lround(255.0 * std::clamp(of(x + 0.5, y + 0.5), 0.0, 1.0))));
      }
    }
  }

  [[nodiscard]] std::string png() const {
    std::string rgba;
    for (const std::uint8_t value : values) {
      rgba += std::string("\x20\x60\x20", 3) + static_cast<char>(value);
    }
    return test::png_of(width_px, height_px, rgba);
  }

  /// Opacity at a place of the image, 0 to 1, by the rules of a sampler: 10497 repeats, 33071
  /// clamps, 33648 mirrors.
  [[nodiscard]] double at(double u, double v, int wrap) const {
    const auto index = [wrap](int i, int size) {
      if (wrap == 33071) return std::clamp(i, 0, size - 1);
      const int turn = static_cast<int>(std::floor(static_cast<double>(i) / size));
      const int rest = i - turn * size;
      return wrap == 33648 && turn % 2 != 0 ? size - 1 - rest : rest;
    };
    const double x = u * width_px - 0.5;
    const double y = v * height_px - 0.5;
    const int left = static_cast<int>(std::floor(x));
    const int top = static_cast<int>(std::floor(y));
    double sum = 0.0;
    for (int dy = 0; dy < 2; ++dy) {
      for (int dx = 0; dx < 2; ++dx) {
        const double share =
            (dx == 1 ? x - left : 1.0 - (x - left)) * (dy == 1 ? y - top : 1.0 - (y - top));
        const auto at = static_cast<std::size_t>(index(top + dy, height_px) * width_px +
                                                 index(left + dx, width_px));
        sum += share * values[at] / 255.0;
      }
    }
    return sum;
  }
};

/// Soft disc of a radius in texels.
Opacity disc(int size, double radius_px) {
  return {size, size, [=](double x, double y) {
            return 0.5 + 0.25 * (radius_px - std::hypot(x - 0.5 * size, y - 0.5 * size));
          }};
}

/// Leaves in no order: a sum of waves.
Opacity foliage(int width, int height) {
  return {width, height, [=](double x, double y) {
            return 0.5 + 0.35 * std::sin(0.31 * x + 0.2 * std::sin(0.11 * y)) +
                   0.35 * std::cos(0.27 * y - 0.13 * x);
          }};
}

std::string embedded(const Opacity& opacity) {
  return test::embedded_png(opacity.png());
}

GltfModel imported(const std::string& json) {
  auto model = import_gltf(write_file(test_folder() / "card.gltf", json));
  EXPECT_TRUE(model) << (model ? "" : model.error().text);
  return model ? std::move(*model) : GltfModel{};
}

double area_of(const GltfModel& model) {
  double area = 0.0;
  for (const Mesh& mesh : model.meshes) {
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
      const glm::dvec3 a(mesh.positions_m[mesh.indices[i]]);
      const glm::dvec3 b(mesh.positions_m[mesh.indices[i + 1]]);
      const glm::dvec3 c(mesh.positions_m[mesh.indices[i + 2]]);
      area += 0.5 * glm::length(glm::cross(b - a, c - a));
      EXPECT_GT(glm::cross(b - a, c - a).z, 0.0) << "the front of a piece faces the other way";
    }
  }
  return area;
}

/// Number of pieces of the card that cover a point.
int covers(const GltfModel& model, const glm::dvec2& p) {
  int count = 0;
  for (const Mesh& mesh : model.meshes) {
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
      glm::dvec2 corner[3];
      for (std::size_t c = 0; c < 3; ++c) {
        corner[c] = glm::dvec2(mesh.positions_m[mesh.indices[i + c]]);
      }
      bool inside = true;
      for (int c = 0; c < 3; ++c) {
        const glm::dvec2 side = corner[(c + 1) % 3] - corner[c];
        const glm::dvec2 to = p - corner[c];
        inside = inside && side.x * to.y - side.y * to.x > 0.0;
      }
      count += inside ? 1 : 0;
    }
  }
  return count;
}

/// Shares of random points that are there though clear, or missing though kept, leaving out those
/// whose opacity a texel away is on the other side.
void expect_as_defined(const GltfModel& model, const Opacity& opacity, const Card& card,
                       const std::function<glm::dvec2(glm::dvec2)>& image_from_uv, double cutoff) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(0.002, 0.998);
  int sure = 0;
  int wrong = 0;
  for (int i = 0; i < 4000; ++i) {
    const glm::dvec2 p(place(random), place(random));
    const glm::dvec2 uv = image_from_uv(glm::dvec2(card.repeats * p.x, card.repeats * (1.0 - p.y)));
    const bool kept = opacity.at(uv.x, uv.y, card.wrap) >= cutoff;
    bool is_sure = true;
    for (int k = 0; k < 8; ++k) {
      const double angle = 0.25 * std::numbers::pi * k;
      is_sure = is_sure && (opacity.at(uv.x + std::cos(angle) / opacity.width_px,
                                       uv.y + std::sin(angle) / opacity.height_px,
                                       card.wrap) >= cutoff) == kept;
    }
    if (!is_sure) continue;
    ++sure;
    wrong += covers(model, p) != (kept ? 1 : 0) ? 1 : 0;
  }
  EXPECT_GT(sure, 1500);
  // A point on the seam of two pieces belongs to neither.
  EXPECT_LE(wrong, sure / 500);
}
glm::dvec2 unchanged(glm::dvec2 uv) {
  return uv;
}

TEST(CutOut, a_disc_has_its_area) {
  for (const double radius_px : {5.0, 20.0, 60.0}) {
    const GltfModel model = imported(Card{}.json(embedded(disc(128, radius_px))));
    const double exact = std::numbers::pi * radius_px * radius_px / (128.0 * 128.0);
    // An outline that is off by a fifth of a texel at most.
    EXPECT_NEAR(area_of(model), exact, exact * 2.0 * 0.2 / radius_px);
  }
}

TEST(CutOut, points_are_there_where_the_image_says_so) {
  const Opacity opacity = foliage(96, 64);
  for (const int wrap : {10497, 33071, 33648}) {
    for (const double repeats : {0.9, 1.0, 2.5}) {
      SCOPED_TRACE(testing::Message() << "sampler " << wrap << ", " << repeats << " times");
      Card card;
      card.wrap = wrap;
      card.repeats = repeats;
      const GltfModel model = imported(card.json(embedded(opacity)));
      expect_as_defined(model, opacity, card, unchanged, 0.5);
    }
  }
}

TEST(CutOut, cutoff_and_factor_count) {
  const Opacity opacity = foliage(64, 64);
  Card card;
  card.material = R"("alphaMode":"MASK","alphaCutoff":0.6)";
  card.factor = R"("baseColorFactor":[1,1,1,0.8],)";
  expect_as_defined(imported(card.json(embedded(opacity))), opacity, card, unchanged, 0.6 / 0.8);
}

TEST(CutOut, the_transform_of_the_texture_counts) {
  // The example of KHR_texture_transform: the lower left quadrant, turned clockwise by 90 degrees.
  const Opacity opacity = foliage(96, 64);
  Card card;
  card.texture_extension = R"(,"extensions":{"KHR_texture_transform":
      {"offset":[0,1],"rotation":1.57079632679,"scale":[0.5,0.5]}})";
  expect_as_defined(
      imported(card.json(embedded(opacity))), opacity, card,
      [](glm::dvec2 uv) { return glm::dvec2(0.5 * uv.y, 1.0 - 0.5 * uv.x); }, 0.5);
}

TEST(CutOut, nothing_is_cut_out_of_an_opaque_image_and_all_of_a_clear_one) {
  const Opacity opaque(8, 8, [](double, double) { return 1.0; });
  const Opacity clear(8, 8, [](double, double) { return 0.2; });
  const GltfModel whole = imported(Card{}.json(embedded(opaque)));
  ASSERT_EQ(whole.meshes.size(), 1U);
  EXPECT_EQ(whole.meshes[0].indices.size(), 6U);
  EXPECT_TRUE(imported(Card{}.json(embedded(clear))).meshes.empty());
  Card plain;
  plain.factor = R"("baseColorFactor":[1,1,1,0.3],)";
  EXPECT_TRUE(imported(plain.json(embedded(opaque))).meshes.empty());
}

TEST(CutOut, normals_go_along) {
  GltfText text;
  text.buffer = packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}) +
                packed<float>({0, 0, 1, 0.6F, 0, 0.8F, 0, 0, 1}) +
                packed<float>({0, 1, 1, 1, 0, 0}) + packed<std::uint16_t>({0, 1, 2});
  text.views = R"({"buffer":0,"byteOffset":0,"byteLength":36},
                  {"buffer":0,"byteOffset":36,"byteLength":36},
                  {"buffer":0,"byteOffset":72,"byteLength":24},
                  {"buffer":0,"byteOffset":96,"byteLength":6})";
  text.accessors = R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                      {"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"},
                      {"bufferView":2,"componentType":5126,"count":3,"type":"VEC2"},
                      {"bufferView":3,"componentType":5123,"count":3,"type":"SCALAR"})";
  text.primitive =
      R"({"attributes":{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2},"indices":3,"material":0})";
  text.materials = R"({"name":"leaf","alphaMode":"MASK","pbrMetallicRoughness":
                       {"baseColorTexture":{"index":0}}})";
  text.extra = R"("textures":[{"source":0}],"images":[)" + embedded(disc(64, 25.0)) + "],";
  const GltfModel model = imported(text.json());
  ASSERT_EQ(model.meshes.size(), 1U);
  const Mesh& mesh = model.meshes[0];
  ASSERT_GT(mesh.positions_m.size(), 10U);
  for (std::size_t i = 0; i < mesh.positions_m.size(); ++i) {
    const double x = mesh.positions_m[i].x;
    const glm::dvec3 expected = glm::normalize(glm::dvec3(0.6 * x, 0.0, 1.0 - 0.2 * x));
    EXPECT_LT(glm::distance(glm::dvec3(mesh.normals[i]), expected), 1e-5);
  }
}

TEST(CutOut, images_beside_the_file_and_in_its_buffer_are_read) {
  const Opacity opacity = disc(64, 20.0);
  const double exact = area_of(imported(Card{}.json(embedded(opacity))));
  const auto folder = test_folder();
  write_file(folder / "leaf one.png", opacity.png());
  const auto beside =
      import_gltf(write_file(folder / "card.gltf", Card{}.json(R"({"uri":"leaf%20one.png"})")));
  ASSERT_TRUE(beside);
  EXPECT_DOUBLE_EQ(area_of(*beside), exact);
  EXPECT_THAT(beside->warnings, Each(Not(HasSubstr("solid"))));

  const std::string png = opacity.png();
  std::string json = Card{}.json(R"({"bufferView":3,"mimeType":"image/png"})");
  const auto insert = [&](const std::string& before, const std::string& text) {
    ASSERT_NE(json.find(before), std::string::npos);
    json.insert(json.find(before) + before.size(), text);
  };
  insert(R"("byteOffset":80,"byteLength":12})",
         R"(,{"buffer":1,"byteOffset":0,"byteLength":)" + std::to_string(png.size()) + "}");
  json.insert(json.rfind("]}"), R"(,{"byteLength":)" + std::to_string(png.size()) +
                                    R"(,"uri":"data:application/octet-stream;base64,)" +
                                    test::base64(png) + R"("})");
  EXPECT_DOUBLE_EQ(area_of(imported(json)), exact);
}

TEST(CutOut, surfaces_whose_image_cannot_be_read_are_solid_with_a_warning) {
  const std::vector<std::pair<std::string, std::string>> faults = {
      {R"({"uri":"nowhere.png"})", "nowhere.png: no such file"},
      {R"({"uri":"data:image/png;base64,)" + test::base64("no image at all, only words") + R"("})",
       "neither PNG nor JPEG"},
      {R"({"uri":"data:image/png;base64,)" + test::base64(disc(32, 9.0).png().substr(0, 60)) +
           R"("})",
       "cannot be decoded"},
      {R"({"bufferView":77,"mimeType":"image/png"})", "bufferView 77 does not exist"},
      {R"({"mimeType":"image/png"})", "neither uri nor bufferView"},
      {R"({"uri":"https://example.com/leaf.png"})", "not a file beside the model"}};
  for (const auto& [image, text] : faults) {
    const GltfModel model = imported(Card{}.json(image));
    EXPECT_DOUBLE_EQ(area_of(model), 1.0) << text;
    EXPECT_THAT(model.warnings,
                Contains(AllOf(HasSubstr("card.gltf"), HasSubstr("'leaf'"), HasSubstr("MASK"),
                               HasSubstr("solid"), HasSubstr(text))));
  }
  Card bare;
  bare.has_uv = false;
  const GltfModel model = imported(bare.json(embedded(disc(32, 9.0))));
  EXPECT_DOUBLE_EQ(area_of(model), 1.0);
  EXPECT_THAT(model.warnings, Contains(AllOf(HasSubstr("TEXCOORD_0"), HasSubstr("solid"))));
}

TEST(CutOut, image_of_one_colour_promises_nothing_but_its_outline) {
  const Opacity leaf = disc(32, 9.0);
  EXPECT_THAT(imported(Card{}.json(embedded(leaf))).warnings,
              Each(Not(HasSubstr("one set of properties"))));
  std::string rgba;
  for (const std::uint8_t value : leaf.values) {
    const auto green = static_cast<char>(rgba.size() < 64 ? 0x61 : 0x60);
    rgba += std::string("\x20") + green + "\x20" + static_cast<char>(value);
  }
  const std::string png = test::png_of(leaf.width_px, leaf.height_px, rgba);
  const std::string coloured = R"({"uri":"data:image/png;base64,)" + test::base64(png) + R"("})";
  EXPECT_THAT(imported(Card{}.json(coloured)).warnings,
              Contains(AllOf(HasSubstr("'leaf'"), HasSubstr("one set of properties"))));
}

TEST(CutOut, coordinates_without_a_place_leave_the_surface_solid_with_a_warning) {
  for (const char* transform : {R"("scale":[1e300,1e300])", R"("scale":[0,0],"offset":[1e30,3])",
                                R"("offset":[-1e200,0])"}) {
    Card card;
    card.texture_extension =
        std::string(R"(,"extensions":{"KHR_texture_transform":{)") + transform + "}}";
    const GltfModel model = imported(card.json(embedded(disc(32, 9.0))));
    EXPECT_NEAR(area_of(model), 1.0, 1e-6) << transform;
    EXPECT_THAT(model.warnings, Contains(AllOf(HasSubstr("2 triangles"), HasSubstr("solid"))));
  }
  Card far_set;
  far_set.texture_extension = R"(,"extensions":{"KHR_texture_transform":{"texCoord":1e300}})";
  EXPECT_THAT(imported(far_set.json(embedded(disc(32, 9.0)))).warnings,
              Contains(AllOf(HasSubstr("TEXCOORD_1000000"), HasSubstr("solid"))));
}

TEST(CutOut, an_image_that_repeats_too_often_stays_solid_with_a_warning) {
  Card card;
  card.repeats = 3000.0;
  const GltfModel model = imported(card.json(embedded(disc(16, 5.0))));
  EXPECT_NEAR(area_of(model), 1.0, 1e-6);
  EXPECT_THAT(model.warnings, Contains(AllOf(HasSubstr("million"), HasSubstr("solid"))));
}

}  // namespace
}  // namespace emit::scene
