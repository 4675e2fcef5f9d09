// SPDX-License-Identifier: Apache-2.0
// Fuzz target: saved thermal states. The input is the file. Sizes in the header and the checksum at
// the end are corrected, so that inputs pass their checks. When the first byte is not 'E', it is
// dropped and the rest is taken unchanged.
#include "surface/state/state_file.hpp"
#include "surface/state/file_sink.hpp"

#include <cstring>
#include <vector>

#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"
#include "fuzz/state_world.hpp"
#include "surface/state/state_bytes.hpp"

namespace {

using namespace emit;

constexpr std::size_t kInstantAt = 8 + 4 + 4 + sizeof(renderer::StateKey);
constexpr std::size_t kBodySizeAt = kInstantAt + 8;
constexpr std::size_t kBodyAt = kBodySizeAt + 8;

void seal(std::vector<std::byte>& file) {
  if (file.size() < kBodyAt + 8) return;
  const std::uint64_t body_bytes = file.size() - kBodyAt - 8;
  std::memcpy(file.data() + kBodySizeAt, &body_bytes, sizeof body_bytes);
  const std::uint64_t value =
      renderer::crc64_xz(std::span<const std::byte>(file).first(file.size() - 8));
  std::memcpy(file.data() + file.size() - 8, &value, sizeof value);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const scene::SceneGeometry geometry = fuzz::state_geometry();
  const auto input = fuzz::as_bytes(data, size);
  std::vector<std::byte> file(input.begin(), input.end());
  if (!file.empty() && file.front() != std::byte{'E'}) {
    file.erase(file.begin());
  } else {
    seal(file);
  }
  renderer::SurfaceModelOptions options;
  options.max_samples = 1000;
  // Ask for the instant in the header, whatever it is, so that the body is read.
  renderer::StateWanted wanted{[](std::int64_t) { return fuzz::state_key(); }, 0, 0};
  if (file.size() >= kBodySizeAt) {
    std::memcpy(&wanted.start_ns, file.data() + kInstantAt, sizeof wanted.start_ns);
    wanted.earliest_ns = wanted.start_ns;
  }
  const auto model =
      renderer::read_state(fuzz::file_of(file), wanted, geometry, fuzz::kEntities, options);
  if (!model) return 0;
  fuzz::require(model->meshes.size() == geometry.meshes.size(), "a mesh for every mesh");
  for (const renderer::RefinedMesh& mesh : model->meshes) {
    for (std::uint32_t slot = 0; slot < mesh.leaf_count(); ++slot) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        fuzz::require(mesh.leaf(slot)[corner] < mesh.vertices().size(), "leaves name vertices");
      }
    }
  }
  // The operations of a frame show whether the tree is consistent.
  const renderer::RefinedMesh& mesh = model->meshes[0];
  for (std::uint32_t triangle = 0; triangle < geometry.meshes[0].indices.size() / 3; ++triangle) {
    for (const glm::vec2 place : {glm::vec2(0.0F), glm::vec2(0.2F, 0.7F), glm::vec2(1.0F, 0.0F)}) {
      for (const std::uint32_t vertex : mesh.locate(triangle, place).vertex) {
        fuzz::require(vertex < mesh.vertices().size(), "places name vertices");
      }
    }
  }
  std::vector<std::uint32_t> indices;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> ranges;
  mesh.write_indices(indices, ranges);
  fuzz::require(indices.size() == 3 * std::size_t{mesh.leaf_count()}, "every leaf is drawn");
  return 0;
}
