// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "app/scenario_identity.hpp"
#include "support/daemon_process.hpp"

namespace emit::server {
namespace {

namespace fs = std::filesystem;

constexpr const char* kGltf =
    R"({"asset":{"version":"2.0"},"buffers":[{"uri":"my%20buffer.bin","byteLength":4},)"
    R"({"uri":"data:application/octet-stream;base64,AAAA","byteLength":3},{"byteLength":1}]})";

/// A scenario with one glTF file in a folder of its own and a buffer beside that.
struct Files {
  explicit Files(const std::string& glb_folder = "models") {
    gltf_folder = fs::path(folder.file(glb_folder));
    fs::create_directories(gltf_folder);
    write("block.gltf", kGltf);
    write("my buffer.bin", "abcd");
    scenario.file = folder.file("scenario.toml");
    scenario.objects.resize(1);
    scenario.objects[0].gltf = gltf_folder / "block.gltf";
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(gltf_folder / name, std::ios::binary) << text;
  }
  [[nodiscard]] std::string hash() const {
    const auto result = identify_scenario(scenario);
    EXPECT_TRUE(result.has_value()) << result.error().text;
    return result ? result->sha256 : std::string();
  }
  test::ScratchFolder folder;
  fs::path gltf_folder;
  scene::ScenarioDesc scenario;
};

TEST(ScenarioIdentity, IsTheSameWhereverTheFolderLies) {
  EXPECT_EQ(Files().hash(), Files().hash());
  EXPECT_EQ(Files().hash().size(), 64U);
}

TEST(ScenarioIdentity, DoesNotHangOnWhereTheWarmedUpStateIsKept) {
  Files files;
  const std::string before = files.hash();
  files.scenario.thermal.state_file = "/var/cache/emit/x.emitstate";
  EXPECT_EQ(files.hash(), before);
}

TEST(ScenarioIdentity, FollowsTheFilesOfOutputsAndNotTheirFolder) {
  const auto with_table = [](const std::string& text) {
    auto files = std::make_unique<Files>();
    files->folder.write("drive.csv", text);
    files->scenario.channels = {{"a", scene::ChannelKind::projector, "8-12"}};
    files->scenario.channels[0].output.drive_table_file = files->folder.file("drive.csv");
    return files;
  };
  const std::string table = "radiance_w_m2_sr,drive\n0,0\n1,1\n";
  EXPECT_EQ(with_table(table)->hash(), with_table(table)->hash());
  EXPECT_NE(with_table(table)->hash(), with_table(table + "2,2\n")->hash());
  auto files = with_table(table);
  const std::string before = files->hash();
  files->scenario.channels[0].output.rotate_deg = 90;
  EXPECT_NE(files->hash(), before) << "settings count too";
  const auto with_spot = [](const std::string& content) {
    Files spotted;
    spotted.folder.write("spot.exr", content);
    spotted.scenario.channels = {{"a", scene::ChannelKind::injection, "8-12"}};
    spotted.scenario.channels[0].output.optics.spot = scene::SpotKind::file;
    spotted.scenario.channels[0].output.optics.spot_file = spotted.folder.file("spot.exr");
    return spotted.hash();
  };
  EXPECT_EQ(with_spot("one"), with_spot("one"));
  EXPECT_NE(with_spot("one"), with_spot("two"));
}

TEST(ScenarioIdentity, FollowsBuffersBesideAGltfFile) {
  const Files files;
  const std::string before = files.hash();
  files.write("my buffer.bin", "abce");
  EXPECT_NE(files.hash(), before);
  files.write("my buffer.bin", "abcd");
  EXPECT_EQ(files.hash(), before);
  fs::remove(files.gltf_folder / "my buffer.bin");
  const auto missing = identify_scenario(files.scenario);
  ASSERT_FALSE(missing.has_value());
  EXPECT_NE(missing.error().text.find("my buffer.bin"), std::string::npos) << missing.error().text;
}

TEST(ScenarioIdentity, FollowsBuffersOfABinaryGltfFile) {
  Files files;
  std::string json = kGltf;
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const auto number = [](std::size_t value) {
    std::string out(4, '\0');
    for (std::size_t i = 0; i < 4; ++i) {
      out[i] = static_cast<char>((value >> (8 * i)) & 0xFFU);
    }
    return out;
  };
  files.write("block.glb",
              "glTF" + number(2) + number(20 + json.size()) + number(json.size()) + "JSON" + json);
  files.scenario.objects[0].gltf = files.gltf_folder / "block.glb";
  const std::string before = files.hash();
  files.write("my buffer.bin", "abce");
  EXPECT_NE(files.hash(), before);
}

TEST(ScenarioIdentity, TellsFoldersWithinTheScenarioApart) {
  EXPECT_NE(Files("models").hash(), Files("other").hash());
}

TEST(ScenarioIdentity, NamesAGltfFileThatCannotBeParsed) {
  const Files files;
  files.write("block.gltf", "{\"buffers\": [");
  const auto result = identify_scenario(files.scenario);
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().code, physics::ErrorCode::parse);
  EXPECT_NE(result.error().text.find("block.gltf"), std::string::npos);
}

}  // namespace
}  // namespace emit::server
