// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <string_view>
#include <vector>

#include "app/scenario_identity.hpp"
#include "app/sha256.hpp"
#include "emit/config/load.hpp"

namespace emit::server {
namespace {

namespace fs = std::filesystem;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Returns a name of a file that does not depend on the place of the scenario's folder. A file
/// outside the folder (data that came with the program) goes by its file name.
std::string label_of(const fs::path& file, const fs::path& folder) {
  std::error_code code;
  const fs::path relative =
      fs::absolute(file, code).lexically_normal().lexically_relative(folder).lexically_normal();
  const bool beneath = !relative.empty() && *relative.begin() != "..";
  return (beneath ? relative : file.filename()).generic_string();
}

/// Adds label, content and length of a file to the hash, and the file to the list. Bytes that move
/// from one file to the next, and new names, change the hash.
Result<void> hash_file(const fs::path& file, const std::string& label, Sha256& hash,
                       std::vector<SceneFile>& files) {
  std::error_code code;
  std::ifstream in(file, std::ios::binary);
  if (!in || fs::is_directory(file, code)) {
    return make_error(ErrorCode::io, file.string() + ": cannot be read");
  }
  hash.update(std::as_bytes(std::span(label.c_str(), label.size() + 1)));
  Sha256 of_file;
  std::vector<char> buffer(1u << 20);
  std::uint64_t bytes = 0;
  while (in) {
    in.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    const auto count = static_cast<std::size_t>(in.gcount());
    const auto part = std::as_bytes(std::span(buffer.data(), count));
    hash.update(part);
    of_file.update(part);
    bytes += count;
  }
  if (in.bad()) {
    return make_error(ErrorCode::io, file.string() + ": reading failed");
  }
  hash.update(std::as_bytes(std::span(&bytes, 1)));
  files.push_back({label, of_file.finish(), bytes});
  return {};
}

/// Returns the JSON of a .gltf file, or the first chunk of a .glb file (glTF 2.0, section 4.4).
std::string json_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::array<char, 20> head{};
  in.read(head.data(), static_cast<std::streamsize>(head.size()));
  if (in.gcount() == static_cast<std::streamsize>(head.size()) &&
      std::memcmp(head.data(), "glTF", 4) == 0) {
    std::uint32_t json_bytes = 0;
    std::memcpy(&json_bytes, head.data() + 12, sizeof(json_bytes));
    std::error_code code;
    const std::uintmax_t limit = fs::file_size(file, code);
    std::string json(code ? 0 : std::min<std::uintmax_t>(json_bytes, limit), '\0');
    in.read(json.data(), static_cast<std::streamsize>(json.size()));
    return json;
  }
  in.clear();
  in.seekg(0);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::string percent_decoded(const std::string& uri) {
  std::string out;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    unsigned value = 0;
    const char* first = uri.data() + i + 1;
    if (uri[i] == '%' && i + 2 < uri.size() &&
        std::from_chars(first, first + 2, value, 16).ptr == first + 2) {
      out += static_cast<char>(value);
      i += 2;
    } else {
      out += uri[i];
    }
  }
  return out;
}

/// Returns the file beside a glTF file that an element of it names; nothing where its content is
/// part of the glTF file.
std::optional<fs::path> file_of(const google::protobuf::Struct& element, const fs::path& gltf) {
  const auto uri = element.fields().find("uri");
  if (uri == element.fields().end() || uri->second.string_value().empty() ||
      uri->second.string_value().starts_with("data:")) {
    return std::nullopt;
  }
  return (gltf.parent_path() / percent_decoded(uri->second.string_value())).lexically_normal();
}

/// Returns the files of a glTF model beside it: its geometry, and those of its images that are
/// there. Images cut out surfaces and give them materials.
Result<std::vector<fs::path>> files_beside(const fs::path& gltf) {
  std::vector<fs::path> out;
  google::protobuf::Struct root;
  if (const auto status = google::protobuf::util::JsonStringToMessage(json_of(gltf), &root);
      !status.ok()) {
    return make_error(ErrorCode::parse, fmt::format("{}: {}", gltf.string(), status.ToString()));
  }
  for (const char* const kind : {"buffers", "images"}) {
    const auto list = root.fields().find(kind);
    if (list == root.fields().end()) continue;
    for (const auto& element : list->second.list_value().values()) {
      const auto file = file_of(element.struct_value(), gltf);
      std::error_code code;
      if (!file || (kind == std::string_view("images") && !fs::is_regular_file(*file, code))) {
        continue;
      }
      out.push_back(*file);
    }
  }
  return out;
}

/// Returns the paths of the files that the output of a channel names.
std::vector<fs::path*> files_of(scene::ChannelOutput& output) {
  std::vector<fs::path*> out{&output.distortion_file, &output.nuc_file, &output.drive_table_file,
                             &output.optics.spot_file};
  std::erase_if(out, [](const fs::path* file) { return file->empty(); });
  return out;
}

}  // namespace

Result<ScenarioIdentity> identify_scenario(const scene::ScenarioDesc& scenario) {
  ScenarioIdentity identity;
  Sha256 hash;
  std::error_code code;
  const fs::path folder = fs::absolute(scenario.file, code).lexically_normal().parent_path();
  // Folders differ from machine to machine, but the hash must not.
  scene::ScenarioDesc plain = scenario;
  plain.file.clear();
  plain.thermal.state_file.clear();  // holds what the rest makes, nothing of its own
  for (auto& object : plain.objects) {
    object.gltf = label_of(object.gltf, folder);
    for (auto& image : object.material_images) {
      if (!image.image.empty()) image.image = label_of(image.image, folder);
    }
  }
  for (auto& channel : plain.channels) {
    for (fs::path* file : files_of(channel.output)) {
      *file = label_of(*file, folder);
    }
  }
  identity.printed = config::print_scenario(plain);
  hash.update(std::as_bytes(std::span(identity.printed)));
  for (const auto& object : scenario.objects) {
    if (auto done = hash_file(object.gltf, label_of(object.gltf, folder), hash, identity.files);
        !done) {
      return tl::unexpected<physics::Error>(std::move(done.error()));
    }
    auto beside = files_beside(object.gltf);
    if (!beside) {
      return tl::unexpected<physics::Error>(std::move(beside.error()));
    }
    for (const auto& image : object.material_images) {
      if (!image.image.empty()) beside->push_back(image.image);
    }
    for (const fs::path& file : *beside) {
      if (auto done = hash_file(file, label_of(file, folder), hash, identity.files); !done) {
        return tl::unexpected<physics::Error>(
            std::move(done.error()).with_context(object.gltf.string()));
      }
    }
  }
  // A copy, because files_of() gives paths that may be changed.
  for (scene::ChannelDesc channel : scenario.channels) {
    for (const fs::path* file : files_of(channel.output)) {
      if (auto done = hash_file(*file, label_of(*file, folder), hash, identity.files); !done) {
        return tl::unexpected<physics::Error>(std::move(done.error()));
      }
    }
  }
  identity.sha256 = hash.finish();
  return identity;
}

}  // namespace emit::server
