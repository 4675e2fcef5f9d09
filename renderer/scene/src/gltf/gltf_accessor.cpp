// SPDX-License-Identifier: Apache-2.0
#include "gltf_accessor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <utility>

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Elements without a buffer view are zeros that take no bytes in the file. No real file has more
/// of them; a file that claims more would only cost memory.
constexpr std::size_t kMaxFreeElements = std::size_t{1} << 20U;

/// A checked region of a buffer: element i begins at data + i * stride.
struct View {
  const unsigned char* data = nullptr;
  std::size_t stride = 0;
};

template <class T>
T load(const unsigned char* bytes) {
  T value{};
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

std::size_t component_bytes(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

Result<View> view_of(const tinygltf::Model& model, int view_index, std::size_t offset,
                     std::size_t count, std::size_t element_bytes, bool strided) {
  if (view_index < 0 || static_cast<std::size_t>(view_index) >= model.bufferViews.size()) {
    return make_error(ErrorCode::parse, fmt::format("bufferView {} does not exist", view_index));
  }
  const tinygltf::BufferView& view = model.bufferViews[static_cast<std::size_t>(view_index)];
  if (view.buffer < 0 || static_cast<std::size_t>(view.buffer) >= model.buffers.size()) {
    return make_error(ErrorCode::parse, fmt::format("bufferView {}: buffer {} does not exist",
                                                    view_index, view.buffer));
  }
  const std::vector<unsigned char>& data =
      model.buffers[static_cast<std::size_t>(view.buffer)].data;
  if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset) {
    return make_error(
        ErrorCode::parse,
        fmt::format("bufferView {}: bytes {} + {} exceed buffer {} of {} bytes", view_index,
                    view.byteOffset, view.byteLength, view.buffer, data.size()));
  }
  const std::size_t stride = strided && view.byteStride != 0 ? view.byteStride : element_bytes;
  if (stride < element_bytes) {
    return make_error(ErrorCode::parse,
                      fmt::format("bufferView {}: byteStride {} is below the element's {} bytes",
                                  view_index, stride, element_bytes));
  }
  const bool fits =
      offset <= view.byteLength &&
      (count == 0 || (element_bytes <= view.byteLength - offset &&
                      count - 1 <= (view.byteLength - offset - element_bytes) / stride));
  if (!fits) {
    return make_error(ErrorCode::parse,
                      fmt::format("{} elements of {} bytes from byte {} exceed bufferView {} of {} "
                                  "bytes",
                                  count, element_bytes, offset, view_index, view.byteLength));
  }
  return View{data.data() + view.byteOffset + offset, stride};
}

float component(const unsigned char* bytes, int type, bool normalized) {
  const auto scaled = [normalized](auto value) {
    using T = decltype(value);
    const auto number = static_cast<float>(value);
    constexpr auto kLimit = static_cast<float>(std::numeric_limits<T>::max());
    return normalized ? std::max(number / kLimit, -1.0F) : number;
  };
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return scaled(load<std::int8_t>(bytes));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return scaled(load<std::uint8_t>(bytes));
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return scaled(load<std::int16_t>(bytes));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return scaled(load<std::uint16_t>(bytes));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return scaled(load<std::uint32_t>(bytes));
    default:
      return load<float>(bytes);
  }
}

std::uint32_t unsigned_integer(const unsigned char* bytes, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load<std::uint8_t>(bytes);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<std::uint16_t>(bytes);
    default:
      return load<std::uint32_t>(bytes);
  }
}

bool is_index_type(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

Result<void> apply_sparse(const tinygltf::Model& model, const tinygltf::Accessor& accessor,
                          std::size_t components, std::vector<float>& values) {
  const auto& sparse = accessor.sparse;
  if (sparse.count < 0 || static_cast<std::size_t>(sparse.count) > accessor.count ||
      sparse.indices.byteOffset < 0 || sparse.values.byteOffset < 0 ||
      !is_index_type(sparse.indices.componentType)) {
    return make_error(ErrorCode::parse, "sparse: count, offset or index type is out of range");
  }
  const auto count = static_cast<std::size_t>(sparse.count);
  const std::size_t bytes = component_bytes(accessor.componentType);
  const Result<View> indices =
      view_of(model, sparse.indices.bufferView, static_cast<std::size_t>(sparse.indices.byteOffset),
              count, component_bytes(sparse.indices.componentType), false);
  if (!indices) {
    return tl::unexpected(physics::Error(indices.error()).with_context("sparse indices"));
  }
  const Result<View> replacements =
      view_of(model, sparse.values.bufferView, static_cast<std::size_t>(sparse.values.byteOffset),
              count, bytes * components, false);
  if (!replacements) {
    return tl::unexpected(physics::Error(replacements.error()).with_context("sparse values"));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t target =
        unsigned_integer(indices->data + i * indices->stride, sparse.indices.componentType);
    if (target >= accessor.count) {
      return make_error(ErrorCode::parse,
                        fmt::format("sparse index {} >= {} elements", target, accessor.count));
    }
    for (std::size_t c = 0; c < components; ++c) {
      values[target * components + c] =
          component(replacements->data + i * replacements->stride + c * bytes,
                    accessor.componentType, accessor.normalized);
    }
  }
  return {};
}

Result<std::vector<float>> read_checked(const tinygltf::Model& model,
                                        const tinygltf::Accessor& accessor, std::size_t components,
                                        NonFinite non_finite) {
  const int found = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(accessor.type));
  const std::size_t bytes = component_bytes(accessor.componentType);
  if (found < 0 || static_cast<std::size_t>(found) != components || bytes == 0) {
    return make_error(ErrorCode::parse,
                      fmt::format("{} components of type {} instead of {} numbers", found,
                                  accessor.componentType, components));
  }
  if (accessor.bufferView < 0 && accessor.count > kMaxFreeElements) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("{} elements without a bufferView", accessor.count));
  }
  std::vector<float> values;
  if (accessor.bufferView >= 0) {
    const Result<View> view = view_of(model, accessor.bufferView, accessor.byteOffset,
                                      accessor.count, bytes * components, true);
    if (!view) {
      return tl::unexpected(view.error());
    }
    values.resize(accessor.count * components);
    for (std::size_t i = 0; i < accessor.count; ++i) {
      for (std::size_t c = 0; c < components; ++c) {
        values[i * components + c] = component(view->data + i * view->stride + c * bytes,
                                               accessor.componentType, accessor.normalized);
      }
    }
  } else {
    values.resize(accessor.count * components);
  }
  if (accessor.sparse.isSparse) {
    if (auto applied = apply_sparse(model, accessor, components, values); !applied) {
      return tl::unexpected(applied.error());
    }
  }
  for (std::size_t i = 0; i < values.size() && non_finite == NonFinite::refuse; ++i) {
    if (!std::isfinite(values[i])) {
      return make_error(ErrorCode::parse, fmt::format("element {} is not finite", i / components));
    }
  }
  return values;
}

const tinygltf::Accessor* find_accessor(const tinygltf::Model& model, int index) {
  const bool exists = index >= 0 && static_cast<std::size_t>(index) < model.accessors.size();
  return exists ? &model.accessors[static_cast<std::size_t>(index)] : nullptr;
}

tl::unexpected<physics::Error> missing(int index) {
  return make_error(ErrorCode::parse, fmt::format("accessor {} does not exist", index));
}

}  // namespace

Result<std::vector<float>> read_floats(const tinygltf::Model& model, int index, int components,
                                       NonFinite non_finite) {
  const tinygltf::Accessor* accessor = find_accessor(model, index);
  if (accessor == nullptr) {
    return missing(index);
  }
  Result<std::vector<float>> values =
      read_checked(model, *accessor, static_cast<std::size_t>(components), non_finite);
  if (!values) {
    return tl::unexpected(
        std::move(values.error()).with_context(fmt::format("accessor {}", index)));
  }
  return values;
}

Result<std::vector<std::uint32_t>> read_indices(const tinygltf::Model& model, int index,
                                                std::size_t vertices) {
  if (index < 0) {
    std::vector<std::uint32_t> sequence(vertices);
    std::iota(sequence.begin(), sequence.end(), 0U);
    return sequence;
  }
  const tinygltf::Accessor* accessor = find_accessor(model, index);
  if (accessor == nullptr) {
    return missing(index);
  }
  const std::string context = fmt::format("accessor {}", index);
  if (accessor->type != TINYGLTF_TYPE_SCALAR || !is_index_type(accessor->componentType) ||
      accessor->sparse.isSparse) {
    return make_error(ErrorCode::parse, context + ": not a list of unsigned indices");
  }
  const Result<View> view =
      view_of(model, accessor->bufferView, accessor->byteOffset, accessor->count,
              component_bytes(accessor->componentType), true);
  if (!view) {
    return tl::unexpected(physics::Error(view.error()).with_context(context));
  }
  std::vector<std::uint32_t> indices(accessor->count);
  for (std::size_t i = 0; i < indices.size(); ++i) {
    indices[i] = unsigned_integer(view->data + i * view->stride, accessor->componentType);
    if (indices[i] >= vertices) {
      return make_error(ErrorCode::parse,
                        fmt::format("{}: index {} >= {} vertices", context, indices[i], vertices));
    }
  }
  return indices;
}

}  // namespace emit::scene
