// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/surface_balance.hpp"
#include "emit/scene/scene_desc.hpp"
#include "surface/heat/heat_interval.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Published thermal model on samples: modes relax towards the equilibrium temperature, which is
/// linear over an interval (physics.md eq. 1-6). The sky counts by the full sphere. Samples
/// exchange no radiation, so the fluxes of their output stay zero. Immutable after construction;
/// any thread; RT-safe except for the constructor and size().
class Emit2014Heat {
 public:
  /// Copies the properties of the materials. A material without an initial temperature of its own
  /// starts from `initial_k`. States are offsets from `reference_k`. It allocates.
  Emit2014Heat(std::span<const scene::Material> materials, double initial_k, double reference_k);

  /// Gives `interval` room for the gains. It allocates.
  void size(HeatInterval& interval) const { interval.relaxation.resize(materials_.size()); }
  /// Fills the gains of an interval whose forcing is already set.
  void prepare(HeatInterval& interval) const noexcept;

  /// Returns the state at the start of the history: all modes at the initial temperature.
  [[nodiscard]] SampleState start_state(const SurfaceSample& sample) const noexcept;
  /// Advances samples over an interval; see SampleHeat::advance_all().
  void advance(std::span<SampleAdvance> samples, const HeatInterval& interval) const noexcept;
  /// Returns the output of a sample in this state; see SampleHeat::output().
  [[nodiscard]] SampleOutput output(const SurfaceSample& sample, const SampleDrive& drive,
                                    const SampleState& state) const noexcept;

  /// Computes the step response of a material; see SampleHeat::step_response().
  void step_response(std::uint32_t material, const ResponseConditions& around,
                     std::span<const double> times_s,
                     std::span<double> response_m2k_w) const noexcept;

 private:
  /// Properties of a material that this model uses.
  struct Material {
    double solar_absorptance_frac = 0.0;
    physics::SurfaceExchange<double> exchange;
    std::array<scene::RelaxationMode, kMaxRelaxationModes> modes{};
    std::size_t mode_count = 0;
    double initial_k = 0.0;
    std::optional<double> prescribed_k;
    bool sheet = false;
  };
  /// Returns the absorbed flux E_abs of one face (physics.md eq. 1).
  [[nodiscard]] double absorbed_w_m2(const SurfaceSample& sample, const glm::vec3& normal,
                                     const SurfaceForcing& forcing,
                                     const SampleDrive& drive) const noexcept;
  /// Returns the equilibrium temperature (physics.md eq. 4). A sheet takes the mean of the fluxes
  /// of its two faces.
  [[nodiscard]] double equilibrium_k(const SurfaceSample& sample, const glm::vec3& normal,
                                     const SurfaceForcing& forcing, const SampleDrive& drive,
                                     const SheetBack* back) const noexcept;

  std::vector<Material> materials_;
  double reference_k_ = 0.0;
};

}  // namespace emit::renderer
