// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "history/foster_history.hpp"
#include "surface/heat/heat_interval.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// The extended model on samples: surface balance and flux-driven states (physics.md eq. 16-18,
/// extended by what a sample sees and by what its partners conduct). Immutable after construction;
/// any thread; RT-safe.
class FosterHeat {
 public:
  FosterHeat(std::span<const FosterMaterial> materials, double reference_k, double tolerance_k);

  /// Gives `interval` room for the gains. Allocates.
  void size(HeatInterval& interval) const { interval.ladders.resize(materials_.size()); }
  void prepare(HeatInterval& interval) const noexcept;

  /// State at the history's start: `before_k` of an unshadowed face, carried over the tail of the
  /// spin-up; `normal` in world axes.
  [[nodiscard]] SampleState start_state(const SurfaceSample& sample, const glm::vec3& normal,
                                        const physics::FosterState<double>& before_k,
                                        std::span<const HeatInterval> tail) const noexcept;

  /// As SampleHeat::advance().
  SampleOutput advance(const SurfaceSample& sample, const glm::vec3& normal,
                       const HeatInterval& interval, const SampleDrive& drive, SampleState& state,
                       const SheetBack* back) const noexcept;

  [[nodiscard]] bool is_sheet(std::uint32_t material) const noexcept {
    return materials_[material].sheet;
  }

  /// As SampleHeat::output().
  SampleOutput output(const SurfaceSample& sample, const glm::vec3& normal,
                      const SurfaceForcing& forcing, const SampleDrive& drive,
                      const SampleState& state) const noexcept;

  /// As SampleHeat::step_response().
  void step_response(std::uint32_t material, const ResponseConditions& around,
                     std::span<const double> times_s,
                     std::span<double> response_m2k_w) const noexcept;

 private:
  /// Over an interval, for a face that sees sky and surroundings only.
  void advance_unshadowed(std::uint32_t material, const glm::vec3& normal,
                          const HeatInterval& interval,
                          physics::FosterState<double>& modes_k) const noexcept;

  struct Incoming {
    double shortwave_w_m2 = 0.0;
    double longwave_w_m2 = 0.0;
  };
  [[nodiscard]] Incoming incoming(const SurfaceSample& sample, const glm::vec3& normal,
                                  const SurfaceForcing& forcing, const SampleDrive& drive,
                                  double longwave_seen_w_m2) const noexcept;
  /// Of a sheet's two faces the mean.
  [[nodiscard]] Incoming into_body(const Incoming& own, bool own_covered, const glm::vec3& normal,
                                   const SurfaceForcing& forcing, const SheetBack* back,
                                   double SampleDrive::*longwave_w_m2) const noexcept;
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
