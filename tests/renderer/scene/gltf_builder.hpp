// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace emit::test {

/// A fresh folder for the files of one test.
inline std::filesystem::path test_folder() {
  const auto* info = testing::UnitTest::GetInstance()->current_test_info();
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "emit_scene" /
                                       (std::string(info->test_suite_name()) + "." + info->name());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

inline std::filesystem::path write_file(const std::filesystem::path& file,
                                        const std::string& data) {
  std::ofstream(file, std::ios::binary) << data;
  return file;
}

inline std::string base64(const std::string& bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8U | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      out += i + k <= bytes.size() ? kDigits[group >> (18U - 6U * k) & 63U] : '=';
    }
  }
  return out;
}

/// Raw little-endian values, for buffers.
template <class T>
std::string packed(std::initializer_list<T> values) {
  std::string out(values.size() * sizeof(T), '\0');
  std::memcpy(out.data(), values.begin(), out.size());
  return out;
}

/// Parts of a glTF file; each member is the inside of a JSON array. The defaults are one triangle
/// (0,0,0) (1,0,0) (0,1,0) in front of +z with 16-bit indices.
struct GltfText {
  std::string buffer = packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}) +
                       packed<std::uint16_t>({0, 1, 2}) + std::string(2, '\0');
  std::string buffer_uri;  ///< empty: embedded
  std::string views = R"({"buffer":0,"byteOffset":0,"byteLength":36},
                         {"buffer":0,"byteOffset":36,"byteLength":6})";
  std::string accessors = R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                             {"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"})";
  std::string primitive = R"({"attributes":{"POSITION":0},"indices":1})";
  std::string meshes;  ///< empty: one mesh 'part' of `primitive`
  std::string nodes = R"({"name":"root","mesh":0})";
  std::string scenes = R"({"nodes":[0]})";
  std::string materials;
  std::string extra;  ///< further members of the root, each followed by a comma

  [[nodiscard]] std::string json() const {
    const std::string uri =
        buffer_uri.empty() ? "data:application/octet-stream;base64," + base64(buffer) : buffer_uri;
    const std::string mesh_list =
        meshes.empty() ? R"({"name":"part","primitives":[)" + primitive + "]}" : meshes;
    return R"({"asset":{"version":"2.0"},)" + extra + R"("scenes":[)" + scenes + R"(],"nodes":[)" +
           nodes + R"(],"meshes":[)" + mesh_list + R"(],"materials":[)" + materials +
           R"(],"accessors":[)" + accessors + R"(],"bufferViews":[)" + views +
           R"(],"buffers":[{"byteLength":)" + std::to_string(buffer.size()) + R"(,"uri":")" + uri +
           R"("}]})";
  }
};

/// Binary container around JSON without a buffer URI.
inline std::string glb(std::string json, std::string binary) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4, '\0');
  const auto word = [](std::size_t value) {
    return packed<std::uint32_t>({static_cast<std::uint32_t>(value)});
  };
  return "glTF" + word(2) + word(28 + json.size() + binary.size()) + word(json.size()) + "JSON" +
         json + word(binary.size()) + std::string("BIN\0", 4) + binary;
}

}  // namespace emit::test
