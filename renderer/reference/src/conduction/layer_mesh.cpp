// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/layer_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;

constexpr double kMaxCells = 20000.0;
/// Depth of the deep ground in diffusion lengths of the whole run.
constexpr double kDeepGroundLengths = 10.0;

bool positive(double value) noexcept {
  return std::isfinite(value) && value > 0.0;
}

/// Number of cells between the face and s, and the inverse function. The cell length at s is
/// first + growth * (distance to the nearest fine end).
class Grading {
 public:
  Grading(double first, double growth, double total, bool fine_base)
      : first_(first), growth_(growth), total_(total), half_(fine_base ? 0.5 * total : total) {}

  [[nodiscard]] double cells_to(double s) const noexcept {
    return s <= half_ ? from_end(s) : 2.0 * from_end(half_) - from_end(total_ - s);
  }
  [[nodiscard]] double s_of(double cells) const noexcept {
    const double half_cells = from_end(half_);
    return cells <= half_cells ? to_s(cells) : total_ - to_s(2.0 * half_cells - cells);
  }

 private:
  // Integrate 1 / (cell length) from a fine end.
  [[nodiscard]] double from_end(double s) const noexcept {
    return growth_ > 0.0 ? std::log1p(growth_ * s / first_) / growth_ : s / first_;
  }
  // Invert from_end().
  [[nodiscard]] double to_s(double cells) const noexcept {
    return growth_ > 0.0 ? first_ * std::expm1(growth_ * cells) / growth_ : first_ * cells;
  }

  double first_;
  double growth_;
  double total_;
  double half_;
};

/// Checks the ranges of layers, base and options.
physics::Result<void> check(std::span<const SolidLayer> layers, const Base& base,
                            const MeshOptions& options) {
  if (layers.empty()) return make_error(ErrorCode::invalid_argument, "a body needs a layer");
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const auto bad = [&](std::string_view what) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("layer {}: {} must be positive and finite", i + 1, what));
    };
    if (!positive(layers[i].thickness_m)) return bad("thickness");
    if (!positive(layers[i].conductivity_w_m_k)) return bad("conductivity");
    if (!positive(layers[i].heat_capacity_j_m3_k)) return bad("heat capacity");
  }
  if (base.kind != BaseKind::adiabatic &&
      !(std::isfinite(base.temperature_k) && base.temperature_k >= 0.0)) {
    return make_error(ErrorCode::invalid_argument, "base temperature must be finite, not negative");
  }
  if (!positive(options.shortest_time_s) || !positive(options.cells_per_length) ||
      !(std::isfinite(options.growth_frac) && options.growth_frac >= 0.0) ||
      !positive(options.horizon_s) || options.min_cells == 0 || options.refine == 0) {
    return make_error(ErrorCode::invalid_argument, "mesh options must be positive and finite");
  }
  return {};
}

}  // namespace

std::vector<SolidLayer> solid_layers(std::span<const scene::Layer> layers) {
  std::vector<SolidLayer> solid;
  solid.reserve(layers.size());
  for (const scene::Layer& layer : layers) {
    solid.push_back({layer.thickness_m, layer.conductivity_w_m_k,
                     layer.density_kg_m3 * layer.specific_heat_j_kg_k});
  }
  return solid;
}

physics::Result<LayerMesh> LayerMesh::build(std::span<const SolidLayer> given, const Base& base,
                                            const MeshOptions& options) {
  if (auto fine = check(given, base, options); !fine) return tl::unexpected(fine.error());
  // Extend the last layer if it stands for the deep ground.
  std::vector<SolidLayer> layers(given.begin(), given.end());
  if (base.kind == BaseKind::deep_ground && !layers.empty()) {
    SolidLayer& last = layers.back();
    const double diffusivity = last.conductivity_w_m_k / last.heat_capacity_j_m3_k;
    last.thickness_m =
        std::max(last.thickness_m, kDeepGroundLengths * std::sqrt(diffusivity * options.horizon_s));
  }

  // Measure every layer in the diffusion coordinate s = integral dz / sqrt(a).
  double total_s = 0.0;
  std::vector<double> length_s;  // one per layer, s^0.5
  for (const SolidLayer& layer : layers) {
    length_s.push_back(layer.thickness_m *
                       std::sqrt(layer.heat_capacity_j_m3_k / layer.conductivity_w_m_k));
    total_s += length_s.back();
  }
  const Grading grading(std::sqrt(options.shortest_time_s) / options.cells_per_length,
                        options.growth_frac, total_s, options.fine_base);

  // Count the cells of each layer first, so that a senseless request costs no memory.
  std::vector<double> cells;
  double all_cells = 0.0;
  double top_s = 0.0;
  for (const double length : length_s) {
    const double wanted = std::ceil(grading.cells_to(top_s + length) - grading.cells_to(top_s));
    cells.push_back(std::max(wanted, static_cast<double>(options.min_cells)) *
                    static_cast<double>(options.refine));
    all_cells += cells.back();
    top_s += length;
  }
  if (!(all_cells <= kMaxCells)) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("the mesh would have {:.0f} cells, more than {:.0f}", all_cells, kMaxCells));
  }

  // Place the nodes of each layer at equal shares of its cells.
  LayerMesh mesh;
  mesh.base_ = base;
  mesh.face_effusivity_ =
      std::sqrt(layers.front().conductivity_w_m_k * layers.front().heat_capacity_j_m3_k);
  mesh.depth_m_.push_back(0.0);
  double top_m = 0.0;
  top_s = 0.0;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    const SolidLayer& layer = layers[i];
    const double first = grading.cells_to(top_s);
    const double share = (grading.cells_to(top_s + length_s[i]) - first) / cells[i];
    const auto count = static_cast<std::size_t>(cells[i]);
    double above_m = 0.0;  // depth within the layer, so that thin cells far down keep their digits
    for (std::size_t j = 1; j <= count; ++j) {
      const double below_m = j == count
                                 ? layer.thickness_m
                                 : (grading.s_of(first + share * static_cast<double>(j)) - top_s) /
                                       length_s[i] * layer.thickness_m;
      // Fall back to even cells if rounding in a far, thin layer would make an empty cell.
      const double even_m =
          above_m + (layer.thickness_m - above_m) / static_cast<double>(count - j + 1);
      const double next_m =
          below_m > above_m && (j == count || below_m < layer.thickness_m) ? below_m : even_m;
      const double cell_m = next_m - above_m;
      mesh.depth_m_.push_back(top_m + next_m);
      mesh.conductance_w_m2_k_.push_back(layer.conductivity_w_m_k / cell_m);
      mesh.capacity_j_m2_k_.push_back(layer.heat_capacity_j_m3_k * cell_m);
      above_m = next_m;
    }
    top_m += layer.thickness_m;
    top_s += length_s[i];
  }
  mesh.assemble_mass();
  return mesh;
}

void LayerMesh::assemble_mass() {
  const std::size_t cells = capacity_j_m2_k_.size();
  mass_above_.assign(cells + 1, 0.0);
  mass_own_.assign(cells + 1, 0.0);
  mass_below_.assign(cells + 1, 0.0);
  // Choose the weights of every row of the mass matrix.
  for (std::size_t i = 0; i <= cells; ++i) {
    const double above = i > 0 ? capacity_j_m2_k_[i - 1] : 0.0;
    const double below = i < cells ? capacity_j_m2_k_[i] : 0.0;
    // Start with the consistent mass: it is exact for a rate of change linear in each cell.
    double from_above = above / 6.0;
    double from_below = below / 6.0;
    if (i > 0 && i < cells) {
      // Improve inner rows: be exact for u0 + F z/k + W z^2 rho c/(2 k) on both sides, with F and W
      // common to both.
      const double resist_above = 1.0 / conductance_w_m2_k_[i - 1];
      const double resist_below = 1.0 / conductance_w_m2_k_[i];
      const double time_above = above * resist_above;
      const double time_below = below * resist_below;
      const double both = 12.0 * (above + below);
      const double a = (above * time_above + 2.0 * below * time_above - below * time_below) /
                       (both * resist_above);
      const double b = (below * time_below + 2.0 * above * time_below - above * time_above) /
                       (both * resist_below);
      // Keep the consistent mass if the neighbours are too unlike for positive weights.
      if (a >= 0.0 && b >= 0.0 && a + b <= 0.2 * (above + below)) {
        from_above = a;
        from_below = b;
      }
    } else if (i == cells && !base_held()) {
      from_above = above / 12.0;  // the profile is even about a base without flux
    }
    mass_above_[i] = from_above;
    mass_below_[i] = from_below;
    mass_own_[i] = 0.5 * (above + below) - from_above - from_below;
  }
}

std::vector<ProfilePoint> steady_profile(std::span<const SolidLayer> layers, double face_k,
                                         double base_k) {
  // Divide the drop of temperature in proportion to the resistance passed.
  double resistance = 0.0;
  for (const SolidLayer& layer : layers) resistance += layer.thickness_m / layer.conductivity_w_m_k;
  std::vector<ProfilePoint> profile{{0.0, face_k}};
  double depth_m = 0.0;
  double passed = 0.0;
  for (const SolidLayer& layer : layers) {
    depth_m += layer.thickness_m;
    passed += layer.thickness_m / layer.conductivity_w_m_k;
    profile.push_back({depth_m, face_k + (base_k - face_k) * (passed / resistance)});
  }
  return profile;
}

}  // namespace emit::reference
