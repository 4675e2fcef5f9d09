// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

std::string base64(const std::string& bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      word = word << 8U | (i + j < bytes.size() ? static_cast<unsigned char>(bytes[i + j]) : 0U);
    }
    for (std::size_t j = 0; j < 4; ++j) {
      out += i + j <= bytes.size() ? kDigits[word >> (18U - 6U * j) & 63U] : '=';
    }
  }
  return out;
}

/// A box from the origin upwards, in glTF axes (x left, y up, z forward), in the unit of the file.
struct Box {
  float left = 2.0F;
  float up = 1.5F;
  float forward = 4.0F;
  bool inside_out = false;
  std::string material = "Car_Paint";
};

void write_box(const std::string& file, const Box& box) {
  std::string bytes;
  const auto add = [&bytes](const auto& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  for (int corner = 0; corner < 8; ++corner) {
    add((corner & 1) != 0 ? 0.5F * box.left : -0.5F * box.left);
    add((corner & 2) != 0 ? box.up : 0.0F);
    add((corner & 4) != 0 ? 0.5F * box.forward : -0.5F * box.forward);
  }
  // Two triangles a side, counter-clockwise seen from outside.
  constexpr std::array<std::array<std::uint16_t, 4>, 6> kSides{
      {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}}};
  for (const auto& side : kSides) {
    std::array<std::uint16_t, 6> two{side[0], side[1], side[2], side[0], side[2], side[3]};
    if (box.inside_out) {
      std::swap(two[1], two[2]);
      std::swap(two[4], two[5]);
    }
    for (const std::uint16_t index : two) add(index);
  }
  const auto number = [](float value) { return std::to_string(value); };
  write_text(
      file,
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
      R"("materials":[{"name":")" +
          box.material +
          R"("}],)"
          R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],)"
          R"("accessors":[{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","min":[)" +
          number(-0.5F * box.left) + ",0," + number(-0.5F * box.forward) + R"(],"max":[)" +
          number(0.5F * box.left) + "," + number(box.up) + "," + number(0.5F * box.forward) +
          R"(]},{"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}],)"
          R"("bufferViews":[{"buffer":0,"byteLength":96},{"buffer":0,"byteOffset":96,"byteLength":72}],)"
          R"("buffers":[{"byteLength":168,"uri":"data:application/octet-stream;base64,)" +
          base64(bytes) + "\"}]}");
}

TEST(CliScene, a_model_becomes_a_scenario_that_is_sound_and_shows_itself) {
  const TemporaryFolder folder;
  write_box(folder.file("car.gltf"), {});
  const ProcessResult made =
      run_emit({"scene", "new", folder.file("car.gltf"), "--out", folder.file("s")});
  ASSERT_EQ(made.exit_code, 0) << made.out << made.err;
  EXPECT_NE(made.out.find("guessed by 'paint'"), std::string::npos) << made.out;
  const std::string text = read_text(folder.file("s/car.toml"));
  EXPECT_NE(text.find("\"Car_Paint\" = \"painted_metal\"   # 100 % of the surface; guessed by "
                      "'paint': REVIEW"),
            std::string::npos)
      << text;
  const ProcessResult check = run_emit({"scene", "check", folder.file("s/car.toml")});
  EXPECT_EQ(check.exit_code, 0) << check.out << check.err;
  EXPECT_NE(check.out.find("nothing is doubtful"), std::string::npos);
  const ProcessResult sheet = run_emit({"scene", "preview", folder.file("s/car.toml"), "--out",
                                        folder.file("p.png"), "--width", "96", "--height", "80"});
  ASSERT_EQ(sheet.exit_code, 0) << sheet.err;
  EXPECT_NE(sheet.out.find("4 views, 2 bands, 3 times"), std::string::npos) << sheet.out;
  // Width and height of a PNG stand at byte 16, big endian: 6 columns, 4 rows and a head.
  const std::string png = read_text(folder.file("p.png"));
  EXPECT_EQ(static_cast<unsigned char>(png.at(18)) * 256 + static_cast<unsigned char>(png.at(19)),
            6 * 100);
  EXPECT_EQ(static_cast<unsigned char>(png.at(22)) * 256 + static_cast<unsigned char>(png.at(23)),
            24 + 4 * 84);
  // A scenario that somebody may have worked on is not written over.
  EXPECT_EQ(
      run_emit({"scene", "new", folder.file("car.gltf"), "--out", folder.file("s")}).exit_code, 1);
}

TEST(CliScene, colours_of_an_image_are_offered_as_materials) {
  const TemporaryFolder folder;
  write_box(folder.file("car.gltf"), {});
  std::string model = read_text(folder.file("car.gltf"));
  const std::string name = R"("name":"Car_Paint")";
  model.replace(model.find(name), name.size(),
                name + R"(,"pbrMetallicRoughness":{"baseColorTexture":{"index":0}})");
  const std::string scene = R"("scene":0,)";
  // Three texels of #4a5d23 and one of #1c1c1c.
  model.insert(model.find(scene),
               R"("textures":[{"source":0}],"images":[{"uri":"data:image/png;base64,)"
               "iVBORw0KGgoAAAANSUhEUgAAAAQAAAABCAIAAAB2XpiaAAAAFUlEQVR4nGP0"
               "ilVmYGBgYGC4tP8nAA3cA1ZDPqpEAAAAAElFTkSuQmCC"
               R"("}],)");
  write_text(folder.file("car.gltf"), model);
  const ProcessResult inspected = run_emit({"inspect", folder.file("car.gltf")});
  EXPECT_NE(inspected.out.find("image: #4a5d23 75.0 % #1c1c1c 25.0 %"), std::string::npos)
      << inspected.out << inspected.err;
  ASSERT_EQ(
      run_emit({"scene", "new", folder.file("car.gltf"), "--out", folder.file("s")}).exit_code, 0);
  const std::string text = read_text(folder.file("s/car.toml"));
  EXPECT_NE(text.find("# [[object.material_images]]\n# material = \"Car_Paint\"\n"
                      "# legend = { \"#4a5d23\" = \"?\", \"#1c1c1c\" = \"?\" }"),
            std::string::npos)
      << text;
  const ProcessResult check = run_emit({"scene", "check", folder.file("s/car.toml")});
  EXPECT_EQ(check.exit_code, 1);
  EXPECT_NE(check.out.find("'material_images' makes materials of their colours"), std::string::npos)
      << check.out << check.err;
}

TEST(CliScene, centimetres_are_scaled_and_named) {
  const TemporaryFolder folder;
  write_box(folder.file("car.gltf"), {.left = 200.0F, .up = 150.0F, .forward = 400.0F});
  const ProcessResult made =
      run_emit({"scene", "new", folder.file("car.gltf"), "--out", folder.file("s")});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_NE(made.err.find("scale = 0.01 is set"), std::string::npos) << made.err;
  EXPECT_EQ(run_emit({"scene", "check", folder.file("s/car.toml")}).exit_code, 0);
  const ProcessResult unscaled =
      run_emit({"scene", "check", folder.file("s/car.toml"), "--set", "object[car].scale=1"});
  EXPECT_EQ(unscaled.exit_code, 1);
  EXPECT_NE(unscaled.out.find("units: car: its longest side is 400 m; if it was exported in "
                              "centimetres, set scale = 0.01"),
            std::string::npos)
      << unscaled.out;
}

TEST(CliScene, a_stated_length_decides_the_scale) {
  // A model that a tool has scaled to a longest side of 1.
  const TemporaryFolder folder;
  write_box(folder.file("car.gltf"), {.left = 0.5F, .up = 0.375F, .forward = 1.0F});
  const ProcessResult made = run_emit(
      {"scene", "new", folder.file("car.gltf"), "--out", folder.file("s"), "--length-m", "4.5"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_EQ(made.err.find("scale"), std::string::npos) << made.err;
  const std::string text = read_text(folder.file("s/car.toml"));
  EXPECT_NE(text.find("scale = 4.5 "), std::string::npos) << text;
  const ProcessResult check = run_emit({"scene", "check", folder.file("s/car.toml")});
  EXPECT_EQ(check.exit_code, 0) << check.out;
  EXPECT_NE(check.out.find("4.500"), std::string::npos) << check.out;
}

TEST(CliScene, hills_are_not_taken_for_a_vehicle_in_millimetres) {
  const TemporaryFolder folder;
  write_box(folder.file("hills.gltf"), {.left = 4000.0F, .up = 600.0F, .forward = 5000.0F});
  ASSERT_EQ(run_emit({"scene", "new", folder.file("hills.gltf"), "--out", folder.file("s"),
                      "--no-ground", "--length-m", "5000"})
                .exit_code,
            0);
  const ProcessResult check = run_emit({"scene", "check", folder.file("s/hills.toml")});
  EXPECT_EQ(check.out.find("units"), std::string::npos) << check.out;
}

/// Returns what a check says of a box with a change of its scenario.
std::string finding(const Box& box, std::vector<std::string> more) {
  const TemporaryFolder folder;
  write_box(folder.file("car.gltf"), box);
  EXPECT_EQ(
      run_emit({"scene", "new", folder.file("car.gltf"), "--out", folder.file("s")}).exit_code, 0);
  std::vector<std::string> call{"scene", "check", folder.file("s/car.toml"), "--json",
                                folder.file("j")};
  call.insert(call.end(), more.begin(), more.end());
  const ProcessResult result = run_emit(call);
  EXPECT_EQ(result.exit_code, 1) << result.out << result.err;
  EXPECT_FALSE(json_value(read_text(folder.file("j")), "kind").empty());
  return result.out;
}

TEST(CliScene, a_check_names_what_is_wrong) {
  EXPECT_NE(finding({}, {"--set", "object[car].position_m=[0,0,0.7]"})
                .find("ground: car: it floats 0.7 m"),
            std::string::npos);
  // A tool scaled the model so that its longest side is 1.
  EXPECT_NE(finding({.left = 0.4578F, .up = 0.5883F, .forward = 1.0F}, {})
                .find("units: car: its longest side is 1 m, as of models that a tool has scaled"),
            std::string::npos);
  EXPECT_NE(finding({}, {"--set", "object[car].position_m=[0,0,-0.5]"})
                .find("ground: car: it reaches 0.5 m below"),
            std::string::npos);
  // The same of one that drives: it keeps its height. One that climbs is an aircraft.
  const TemporaryFolder paths;
  const auto path = [&paths](const char* name, double from_m, double to_m) {
    write_text(paths.file(name), "time_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg\n0,-2,0," +
                                     std::to_string(from_m) + ",0,0,0\n10,2,0," +
                                     std::to_string(to_m) + ",0,0,0\n");
    return "object[car].trajectory_file=\"" + paths.file(name) + "\"";
  };
  EXPECT_NE(finding({}, {"--set", "object[car].entity_id=7", "--set", path("over.csv", 0.4, 0.4)})
                .find("ground: car: it floats 0.4 m above what is under it all along"),
            std::string::npos);
  EXPECT_NE(finding({}, {"--set", "object[car].entity_id=7", "--set", path("into.csv", 0.0, -0.3)})
                .find("ground: car: it reaches 0.3 m below what is under it at 10.000 s"),
            std::string::npos);
  EXPECT_EQ(finding({.inside_out = true},
                    {"--set", "object[car].entity_id=7", "--set", path("climb.csv", 0.4, 30.0)})
                .find("ground: car"),
            std::string::npos);
  EXPECT_NE(finding({.inside_out = true}, {}).find("faces: car: 100 % of the faces"),
            std::string::npos);
  EXPECT_NE(finding({.material = "red"}, {}).find("material: car: glTF material 'red' is mapped"),
            std::string::npos);
  EXPECT_NE(finding({}, {"--set", "sensor.look_at_m=[0,0,900]"}).find("camera: 0.0 % of the"),
            std::string::npos);
  // y and z swapped: the car stands on its nose, once it is an entity.
  EXPECT_NE(
      finding({.left = 2.0F, .up = 4.0F, .forward = 1.5F}, {"--set", "object[car].entity_id=7"})
          .find("axes: car: it is 4 m high"),
      std::string::npos);
  EXPECT_NE(
      finding({.left = 4.0F, .up = 1.5F, .forward = 2.0F}, {"--set", "object[car].entity_id=7"})
          .find("axes: car: it is 4 m wide and 2 m long in its own axes"),
      std::string::npos);
}

}  // namespace
}  // namespace emit::test
