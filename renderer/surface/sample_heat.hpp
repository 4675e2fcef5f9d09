// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "history/foster_history.hpp"
#include "surface/surface_samples.hpp"

namespace emit::renderer {

/// What a sample receives over one interval beside the forcing that all share.
struct SampleDrive {
  float sun_frac = 0.0F;         ///< visible share of the disc, mean
  float hidden_sky_frac = 0.0F;  ///< share of the sample's sky behind entities, mean
  /// From the samples it sees, their weights included.
  double longwave_begin_w_m2 = 0.0;
  double longwave_end_w_m2 = 0.0;
  double shortwave_w_m2 = 0.0;
  /// Net fluxes into the partners' faces.
  std::array<double, kMaxPartners> partner_begin_w_m2{};
  std::array<double, kMaxPartners> partner_end_w_m2{};
};

/// The forcing of an interval and, by material, the gains of its steps.
struct HeatInterval {
  IntervalForcing forcing;
  std::vector<physics::FosterLadder> ladders;
};

/// Surface balance and states of a sample (physics.md eq. 16-18, extended by what it sees and by
/// what its partners conduct). Immutable after construction; any thread; RT-safe.
class SampleHeat {
 public:
  SampleHeat(std::span<const FosterMaterial> materials, double reference_k, double tolerance_k);

  /// Fills the gains; `interval.ladders` must have the size of the materials.
  void prepare(HeatInterval& interval) const noexcept;

  /// Advances a sample over an interval; `normal` in world axes, in its middle.
  SampleOutput advance(const SurfaceSample& sample, const glm::vec3& normal,
                       const HeatInterval& interval, const SampleDrive& drive,
                       SampleState& state) const noexcept;

  /// The same for an unshadowed face that sees sky and surroundings only: before the history.
  void advance_unshadowed(std::uint32_t material, const glm::vec3& normal,
                          const HeatInterval& interval,
                          physics::FosterState<double>& modes_k) const noexcept;

  /// What a sample of that state sends out at the start of the history.
  SampleOutput output(const SurfaceSample& sample, const glm::vec3& normal,
                      const SurfaceForcing& forcing, const SampleDrive& drive,
                      const SampleState& state) const noexcept;

  [[nodiscard]] double reference_k() const noexcept { return reference_k_; }

 private:
  struct Incoming {
    double shortwave_w_m2 = 0.0;
    double longwave_w_m2 = 0.0;
  };
  [[nodiscard]] Incoming incoming(const SurfaceSample& sample, const glm::vec3& normal,
                                  const SurfaceForcing& forcing, const SampleDrive& drive,
                                  double longwave_seen_w_m2) const noexcept;
  [[nodiscard]] physics::FosterDrive<double> absorbed(std::uint32_t material,
                                                      const SurfaceForcing& forcing,
                                                      const Incoming& in) const noexcept;
  [[nodiscard]] SampleOutput output_of(const SurfaceSample& sample, const SurfaceForcing& forcing,
                                       const Incoming& in, const SampleDrive& drive,
                                       double offset_k) const noexcept;
  [[nodiscard]] double offset_k(std::uint32_t material, const SampleState& state) const noexcept;

  std::vector<FosterMaterial> materials_;
  std::vector<physics::FosterSurface<double>> surfaces_;
  double reference_k_ = 0.0;
  double tolerance_k_ = 0.0;
};

}  // namespace emit::renderer
