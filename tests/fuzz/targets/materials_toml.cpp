// SPDX-License-Identifier: Apache-2.0
// Fuzz target: a material library.
#include <cmath>

#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"
#include "resolve/resolve.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  static const std::vector<std::string> bands = config::known_band_names({});
  config::Node root;
  config::Diagnostics diagnostics;
  const std::vector<config::Node> nodes = config::collect_material_nodes(
      root, {fuzz::file_of(fuzz::as_bytes(data, size))}, diagnostics);
  const auto materials = config::resolve_materials(nodes, bands, diagnostics);
  if (!diagnostics.empty()) {
    fuzz::require(!diagnostics.error().text.empty(), "a fault is named");
    return 0;
  }
  for (const scene::Material& material : materials) {
    for (const scene::RelaxationMode& mode : material.modes) {
      fuzz::require(std::isfinite(mode.weight_frac), "weights of modes are numbers");
    }
  }
  return 0;
}
