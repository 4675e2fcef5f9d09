// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/ext/vector_float3.hpp>

#include "history/band_lights.hpp"
#include "surface/heat/surface_node.hpp"
#include "surface/rays/interval_rays.hpp"
#include "surface/run/world_inputs.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// Radiance that samples send to each other in the bands of the picture (physics.md eq. 45). A node
/// of time holds for every sample and band what the other samples in its view send, above the
/// radiance of the surroundings and times their share of the hemisphere. A pass first finds what
/// every sample sends at the node, and then what every sample receives. What they send contains
/// what they received at the node before, so that later bounces come with the next intervals.
///
/// Owner: SurfaceInterval. Thread: the renderer's; work() uses all cores. Real time: everything but
/// the constructor and settle() is RT-safe. The result does not depend on the number of cores, nor
/// on how work() is divided.
class BandExchange {
 public:
  /// Takes memory for the samples. Without bands or seen samples there is nothing to do.
  BandExchange(const SurfaceSamples& all, const BandLights* lights);

  /// Begins the pass for the node, whose instant is set.
  void begin(const SurfaceNode& to, const WorldInputs& inputs) noexcept;
  /// Number of units of work of a pass: 0 if there is nothing to do.
  [[nodiscard]] std::size_t units() const noexcept { return 2 * count_; }
  [[nodiscard]] std::size_t worked() const noexcept { return worked_; }
  /// Works until `units` are done. `to` holds the outputs of all samples at the node. `from` is
  /// the node before. @pre begin(); units <= units()
  void work(std::size_t units, const SurfaceSamples& all, const IntervalRays& rays,
            const SurfaceNode& from, SurfaceNode& to, threads::WorkerPool& workers) noexcept;
  /// Finds the node with all bounces. Setup.
  void settle(const SurfaceSamples& all, const IntervalRays& rays, const WorldInputs& inputs,
              SurfaceNode& node, threads::WorkerPool& workers);
  /// Main memory, in bytes.
  [[nodiscard]] std::uint64_t bytes() const noexcept { return sent_.capacity() * sizeof(float); }

 private:
  /// Finds what a sample sends.
  void send(const SurfaceSamples& all, const IntervalRays& rays, const SurfaceNode& from,
            const SurfaceNode& to, std::uint32_t index) noexcept;
  /// Finds what a sample receives from others.
  void receive(const SurfaceSamples& all, const IntervalRays& rays, SurfaceNode& to,
               std::uint32_t index) const noexcept;

  const BandLights* lights_ = nullptr;
  std::size_t bands_ = 0;
  std::size_t count_ = 0;  ///< samples; 0: there is nothing to do
  std::size_t worked_ = 0;
  std::vector<BandLight> light_;  ///< by band, at the node
  glm::vec3 to_sun_{0.0F};
  std::vector<float> sent_;  ///< by sample, then band; above the surroundings, W m-2 sr-1
};

}  // namespace emit::renderer
