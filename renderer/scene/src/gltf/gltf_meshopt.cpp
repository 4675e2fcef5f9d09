// SPDX-License-Identifier: Apache-2.0
#include "gltf_meshopt.hpp"

#include <fmt/format.h>
#include <meshoptimizer.h>

#include <cstdint>
#include <string>
#include <utility>

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// No codec reaches this ratio; a file that claims more would only cost memory.
constexpr std::size_t kMaxRatio = 256;
/// Largest element of the vertex codec.
constexpr std::size_t kMaxStride = 256;

/// Content of the extension's object.
struct Compressed {
  std::size_t buffer = 0;
  std::size_t offset = 0;
  std::size_t length = 0;
  std::size_t stride = 0;
  std::size_t count = 0;
  std::string mode;
  std::string filter = "NONE";
};

/// A codec of the extension: the high half of the data's first byte names it, the low half its
/// version.
struct Codec {
  std::string_view mode;
  unsigned char header = 0;
  unsigned char max_version = 0;
};
constexpr Codec kCodecs[] = {{"ATTRIBUTES", 0xa0, 0}, {"TRIANGLES", 0xe0, 1}, {"INDICES", 0xd0, 1}};

Result<std::size_t> size_of(const tinygltf::Value& object, const std::string& name, bool required) {
  if (!object.Has(name)) {
    if (!required) return std::size_t{0};
    return make_error(ErrorCode::parse, name + " is missing");
  }
  const tinygltf::Value& value = object.Get(name);
  if (!value.IsInt() || value.GetNumberAsInt() < 0) {
    return make_error(ErrorCode::parse, name + " is not a size below 2 GiB");
  }
  return static_cast<std::size_t>(value.GetNumberAsInt());
}

Result<Compressed> read_extension(const tinygltf::Value& object) {
  if (!object.IsObject()) return make_error(ErrorCode::parse, "not an object");
  Compressed view;
  const std::pair<const char*, std::size_t*> sizes[] = {{"buffer", &view.buffer},
                                                        {"byteOffset", &view.offset},
                                                        {"byteLength", &view.length},
                                                        {"byteStride", &view.stride},
                                                        {"count", &view.count}};
  for (const auto& [name, target] : sizes) {
    const Result<std::size_t> size = size_of(object, name, target != &view.offset);
    if (!size) return tl::unexpected(size.error());
    *target = *size;
  }
  for (const auto& [name, target] :
       {std::pair{"mode", &view.mode}, std::pair{"filter", &view.filter}}) {
    if (object.Has(name) && object.Get(name).IsString()) {
      *target = object.Get(name).Get<std::string>();
    }
  }
  return view;
}

/// The decoders assert what is checked here.
Result<void> check_layout(const Compressed& view) {
  const bool indices = view.mode != "ATTRIBUTES";
  const bool stride_fits =
      indices ? view.stride == 2 || view.stride == 4
              : view.stride > 0 && view.stride <= kMaxStride && view.stride % 4 == 0;
  if (!stride_fits) {
    return make_error(ErrorCode::parse,
                      fmt::format("byteStride {} does not fit mode {}", view.stride, view.mode));
  }
  if (view.mode == "TRIANGLES" && view.count % 3 != 0) {
    return make_error(ErrorCode::parse,
                      fmt::format("{} indices are not whole triangles", view.count));
  }
  if (view.filter == "NONE") return {};
  const bool known =
      view.filter == "OCTAHEDRAL" || view.filter == "QUATERNION" || view.filter == "EXPONENTIAL";
  if (!known) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("filter '{}' is not supported", view.filter));
  }
  const bool filter_fits = !indices && (view.filter == "EXPONENTIAL" || view.stride == 8 ||
                                        (view.filter == "OCTAHEDRAL" && view.stride == 4));
  if (!filter_fits) {
    return make_error(ErrorCode::parse, fmt::format("filter {} does not fit mode {}, byteStride {}",
                                                    view.filter, view.mode, view.stride));
  }
  return {};
}

Result<std::vector<unsigned char>> decode(const Compressed& view, const tinygltf::Model& model) {
  const Codec* codec = nullptr;
  for (const Codec& known : kCodecs) {
    if (known.mode == view.mode) codec = &known;
  }
  if (codec == nullptr) {
    return make_error(ErrorCode::unsupported, fmt::format("mode '{}' is not supported", view.mode));
  }
  if (auto checked = check_layout(view); !checked) return tl::unexpected(checked.error());
  if (view.buffer >= model.buffers.size()) {
    return make_error(ErrorCode::parse, fmt::format("buffer {} does not exist", view.buffer));
  }
  const std::vector<unsigned char>& source = model.buffers[view.buffer].data;
  if (view.offset > source.size() || view.length > source.size() - view.offset) {
    return make_error(ErrorCode::parse,
                      fmt::format("bytes {} + {} exceed buffer {} of {} bytes", view.offset,
                                  view.length, view.buffer, source.size()));
  }
  const unsigned char* data = source.data() + view.offset;
  if (view.length == 0 || (data[0] & 0xf0U) != codec->header) {
    return make_error(ErrorCode::parse, fmt::format("the data are not of mode {}", view.mode));
  }
  if ((data[0] & 0x0fU) > codec->max_version) {
    return make_error(
        ErrorCode::unsupported,
        fmt::format("version {} of the codec for {} is not supported", data[0] & 0x0fU, view.mode));
  }
  if (view.count > kMaxRatio * view.length / view.stride) {
    return make_error(ErrorCode::parse,
                      fmt::format("{} elements of {} bytes cannot come out of {} bytes", view.count,
                                  view.stride, view.length));
  }
  std::vector<unsigned char> out(view.count * view.stride);
  using Decoder = int(void*, std::size_t, std::size_t, const unsigned char*, std::size_t);
  Decoder* decoder = meshopt_decodeVertexBuffer;
  if (view.mode == "TRIANGLES") decoder = meshopt_decodeIndexBuffer;
  if (view.mode == "INDICES") decoder = meshopt_decodeIndexSequence;
  if (decoder(out.data(), view.count, view.stride, data, view.length) != 0) {
    return make_error(ErrorCode::parse,
                      fmt::format("the data of mode {} are malformed", view.mode));
  }
  if (view.filter == "OCTAHEDRAL") {
    meshopt_decodeFilterOct(out.data(), view.count, view.stride);
  } else if (view.filter == "QUATERNION") {
    meshopt_decodeFilterQuat(out.data(), view.count, view.stride);
  } else if (view.filter == "EXPONENTIAL") {
    meshopt_decodeFilterExp(out.data(), view.count, view.stride);
  }
  return out;
}

}  // namespace

Result<void> decode_meshopt_views(tinygltf::Model& model) {
  for (std::size_t i = 0; i < model.bufferViews.size(); ++i) {
    for (const std::string_view name : kMeshoptExtensions) {
      tinygltf::BufferView& view = model.bufferViews[i];
      const auto extension = view.extensions.find(std::string(name));
      if (extension == view.extensions.end()) continue;
      const Result<Compressed> compressed = read_extension(extension->second);
      Result<std::vector<unsigned char>> data =
          compressed ? decode(*compressed, model) : tl::unexpected(compressed.error());
      if (!data) {
        return tl::unexpected(
            std::move(data.error()).with_context(fmt::format("bufferView {}: {}", i, name)));
      }
      view.buffer = static_cast<int>(model.buffers.size());
      view.byteOffset = 0;
      view.byteLength = data->size();
      view.byteStride = compressed->mode == "ATTRIBUTES" ? compressed->stride : 0;
      model.buffers.emplace_back().data = std::move(*data);
      break;
    }
  }
  return {};
}

}  // namespace emit::scene
