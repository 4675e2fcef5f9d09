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

/// The published model on samples: modes relax towards the equilibrium temperature, which is linear
/// over an interval (physics.md eq. 1-6). Sky counts by the full sphere; samples exchange nothing
/// with each other, so what they send out stays zero. Immutable; any thread; RT-safe but for the
/// constructor.
class Emit2014Heat {
 public:
  /// Materials without an initial temperature of their own start from `initial_k`. States are
  /// offsets from `reference_k`.
  Emit2014Heat(std::span<const scene::Material> materials, double initial_k, double reference_k);

  /// Gives `interval` room for the gains. Allocates.
  void size(HeatInterval& interval) const { interval.relaxation.resize(materials_.size()); }
  void prepare(HeatInterval& interval) const noexcept;

  [[nodiscard]] SampleState start_state(const SurfaceSample& sample) const noexcept;
  SampleOutput advance(const SurfaceSample& sample, const glm::vec3& normal,
                       const HeatInterval& interval, const SampleDrive& drive, SampleState& state,
                       const SheetBack* back) const noexcept;
  [[nodiscard]] SampleOutput output(const SurfaceSample& sample, const SampleDrive& drive,
                                    const SampleState& state) const noexcept;

  /// As SampleHeat::step_response().
  void step_response(std::uint32_t material, const ResponseConditions& around,
                     std::span<const double> times_s,
                     std::span<double> response_m2k_w) const noexcept;

 private:
  struct Material {
    double solar_absorptance_frac = 0.0;
    physics::SurfaceExchange<double> exchange;
    std::array<scene::RelaxationMode, kMaxRelaxationModes> modes{};
    std::size_t mode_count = 0;
    double initial_k = 0.0;
    std::optional<double> prescribed_k;
    bool sheet = false;
  };
  /// Eq. 1.
  [[nodiscard]] double absorbed_w_m2(const SurfaceSample& sample, const glm::vec3& normal,
                                     const SurfaceForcing& forcing,
                                     const SampleDrive& drive) const noexcept;
  /// Eq. 4, of a sheet by the mean of its two faces.
  [[nodiscard]] double equilibrium_k(const SurfaceSample& sample, const glm::vec3& normal,
                                     const SurfaceForcing& forcing, const SampleDrive& drive,
                                     const SheetBack* back) const noexcept;

  std::vector<Material> materials_;
  double reference_k_ = 0.0;
};

}  // namespace emit::renderer
