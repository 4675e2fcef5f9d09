// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/foster.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/environment.hpp"
#include "history/ground_state.hpp"
#include "history/open_grounds.hpp"
#include "history/opening_states.hpp"
#include "history/start_table.hpp"
#include "history/step_plan.hpp"

/// CPU part of the extended thermal model (`thermal.model = "foster"`): the temperature of the
/// surroundings, and the states of unshadowed surfaces before the history begins.
namespace emit::renderer {

/// Returns the forcing at an instant, without the radiation of the surroundings. RT-safe.
[[nodiscard]] SurfaceForcing open_forcing(const physics::SunPosition& sun,
                                          const physics::Forcing& weather) noexcept;
/// Returns an interval with sun and weather at both ends, without an instant for shadows. Weather
/// that changes at the end has not acted within the interval. When the host changes the weather
/// within the interval, a line with the same mean replaces it. RT-safe.
[[nodiscard]] HistoryInterval interval_between(std::int64_t begin_ns, std::int64_t end_ns,
                                               const Environment& environment) noexcept;

/// Returns the drive of an unshadowed face with that normal. `offset_k` is its temperature from the
/// reference, which sets the film. RT-safe.
[[nodiscard]] physics::FosterDrive<double> unshadowed_drive(const SurfaceForcing& forcing,
                                                            const FosterMaterial& material,
                                                            const glm::dvec3& normal,
                                                            double reference_k,
                                                            double offset_k) noexcept;

/// Returns numbers of the modes as texels. RT-safe.
[[nodiscard]] StateTexels texels_of(const physics::FosterState<double>& x) noexcept;

/// Returns the states of a steady profile between the surface's first temperature and the base.
/// RT-safe.
[[nodiscard]] physics::FosterState<double> foster_initial_states(
    const FosterMaterial& material) noexcept;
/// Returns the surface of a material over its base. RT-safe.
[[nodiscard]] physics::FosterSurface<double> foster_surface_of(const FosterMaterial& material,
                                                               double reference_k) noexcept;

/// Grounds that update() follows.
enum class DryGrounds : std::uint8_t {
  followed,  ///< dry ones too, since a host may let it rain after the last interval
  skipped,   ///< those that something may wet or freeze; the others keep their start
};

/// History of the surroundings' temperature, and table of the states in which unshadowed surfaces
/// begin the history. Owner: Renderer.
/// Thread: the renderer's.  Real time: update is RT-safe and takes some microseconds per interval
/// and per ground that holds water. When the host changed the weather before the history's start,
/// the spin-up runs again (tens of milliseconds per material, if all nodes of the table are found).
class FosterHistory {
 public:
  /// Number and total length of the intervals at the end of the spin-up that are computed per
  /// pixel. States of two hours ago vary smoothly enough with direction for the table. States of
  /// now do not, because they depend on where the sun is just grazing.
  static constexpr std::uint32_t kTailSteps = 10;
  static constexpr std::int64_t kTailNs = 7'200'000'000'000;
  /// Number of nodes per axis of the octahedral grid of directions. It is odd, so that the axes are
  /// nodes.
  static constexpr std::uint32_t kGridNodes = 49;

  /// Runs the spin-up. `materials` are in the order of the scene's shaders; temperatures are
  /// offsets from reference_k. It allocates.
  FosterHistory(const scene::ScenarioDesc& scenario, std::vector<FosterMaterial> materials,
                FosterMaterial surroundings, const Environment& environment, double reference_k,
                DryGrounds dry_grounds = DryGrounds::followed,
                StartNodes start_nodes = StartNodes::all);

  /// Computes the forcing of the plan's intervals. Returns true when the table has changed.
  /// extend() may follow only if dry grounds are followed.
  bool update(const StepPlan& plan, const Environment& environment) noexcept;

  /// Computes the forcing between given instants, from the history's start on. Entry i covers node
  /// i to node i + 1.
  /// @pre out.size() + 1 == nodes_ns.size(), and nodes_ns ascends
  void forcing_over(std::span<const std::int64_t> nodes_ns, const Environment& environment,
                    std::span<IntervalForcing> out) noexcept;

  [[nodiscard]] std::span<const FosterMaterial> materials() const noexcept { return materials_; }
  [[nodiscard]] std::span<const IntervalForcing> intervals() const noexcept { return intervals_; }
  /// Returns the last intervals of the spin-up. The span is empty without spin-up.
  [[nodiscard]] std::span<const IntervalForcing> tail() const noexcept { return tail_; }
  /// Returns the temperature of the surroundings at the end of the last interval, K.
  [[nodiscard]] double surroundings_now_k() const noexcept { return surroundings_now_k_; }

  /// Returns the table of states by material, row and column of the grid. Node (i, j) of a grid of
  /// m nodes per axis is the direction of octahedral coordinates (2 i / (m - 1) - 1, 2 j / (m - 1)
  /// - 1). Nodes are zero that nobody has asked for, unless all are found.
  [[nodiscard]] std::span<const StateTexels> table() const noexcept { return table_.texels(); }
  [[nodiscard]] std::uint32_t grid_nodes() const noexcept { return grid_nodes_; }

  /// Returns states from the table by bilinear interpolation. Thread: any. RT-safe.
  /// @pre material < materials().size()
  [[nodiscard]] physics::FosterState<double> start_states(std::size_t material,
                                                          const glm::dvec3& normal) const noexcept;

  /// Returns by how much the states of a face differ from those of an unshadowed one at the instant
  /// of the table, because less sun and sky have reached it all the time. They are 0 for a material
  /// that has a stated temperature at the start. Thread: any. RT-safe.
  /// @pre material < materials().size()
  [[nodiscard]] physics::FosterState<double> hidden_states(std::size_t material,
                                                           const FaceOpening& face) const noexcept;

  /// Returns the sun on an unshadowed face over the day in whose balance surfaces begin, J m-2. It
  /// is 0 where none does. Thread: any. RT-safe.
  [[nodiscard]] double day_sun_j_m2(const glm::dvec3& normal) const noexcept;

  /// Advances the surroundings over an interval that follows the last one and returns its forcing.
  /// RT-safe.
  [[nodiscard]] IntervalForcing extend(std::int64_t begin_ns, std::int64_t end_ns,
                                       const Environment& environment) noexcept;

  /// Returns the state of the surroundings after the last update() or extend().
  [[nodiscard]] const GroundState& surroundings() const noexcept { return ground_; }
  /// Restores a state that surroundings() returned.
  void restore_surroundings(const GroundState& state) noexcept { ground_ = state; }
  /// Returns whether rain wets something here.
  [[nodiscard]] bool holds_water() const noexcept {
    return std::ranges::any_of(
        materials_, [](const FosterMaterial& material) { return material.water_slot >= 0; });
  }

  /// Returns the states of an unshadowed face of materials()[material], with any normal, at the
  /// instant of the table. They come from the full spin-up rather than the table.
  /// @pre material < materials().size()
  [[nodiscard]] physics::FosterState<double> spun_up(std::size_t material,
                                                     const glm::dvec3& normal) const noexcept;

 private:
  /// Makes the table of spun-up states. `each(rows, fill)` calls fill(row) for every row, in any
  /// order.
  template <class Loop>
  void spin_up(const Environment& environment, const Loop& each);
  void spin_up_surroundings(const Environment& environment) noexcept;
  /// Returns whether anything begins in the balance of its first day.
  [[nodiscard]] bool balances() const noexcept;
  /// Finds the forcing of the first day, and the states of the surroundings at its start.
  void take_day(const Environment& environment) noexcept;
  /// Returns the states of an unshadowed face at the start of the spin-up, or of the history.
  [[nodiscard]] physics::FosterState<double> first_states(std::size_t material,
                                                          const glm::dvec3& normal) const noexcept;
  /// Returns the states of a node of the table.
  [[nodiscard]] StateTexels node(std::size_t material, std::size_t row,
                                 std::size_t column) const noexcept;
  /// Advances the surroundings over one interval and writes its forcing.
  void carry(const HistoryInterval& interval, double tolerance_k, IntervalForcing& out) noexcept;
  [[nodiscard]] SurfaceForcing forcing(const physics::SunPosition& sun,
                                       const physics::Forcing& weather) const noexcept;

  std::vector<FosterMaterial> materials_;
  FosterMaterial surroundings_;
  double reference_k_ = 0.0;
  double tolerance_k_ = 0.0;
  std::int64_t history_start_ns_ = 0;
  std::int64_t spin_up_ns_ = 0;
  std::uint32_t grid_nodes_ = 2;

  physics::FosterSurface<double> surroundings_surface_;
  GroundState ground_;           ///< current state
  GroundState ground_at_start_;  ///< state at the history's start
  OpenGrounds grounds_;
  DryGrounds dry_grounds_;
  StartNodes start_nodes_;
  bool follow_ = true;  ///< carry() advances the grounds
  double surroundings_now_k_ = 0.0;

  std::vector<IntervalForcing> day_;  ///< first day; empty where nothing begins in its balance
  OpeningStates openings_;  ///< by material, then those of the surroundings; sized like day_
  physics::FosterState<double> surroundings_start_{};  ///< at the start of the spin-up
  std::vector<IntervalForcing> spin_up_;               ///< intervals up to the instant of the table
  /// Gains of these intervals, by material.
  std::vector<std::vector<physics::FosterGains<double>>> spin_up_gains_;
  std::vector<IntervalForcing> tail_;
  std::vector<IntervalForcing> intervals_;
  std::vector<std::int64_t> nodes_ns_;
  StartTable table_;

  std::uint64_t revision_ = 0;
  bool weather_before_start_ = false;
};

}  // namespace emit::renderer
