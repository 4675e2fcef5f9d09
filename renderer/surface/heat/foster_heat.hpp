// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "history/foster_history.hpp"
#include "surface/heat/heat_interval.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Conductances between a stack and its base, W m-2 K-1: for a sudden change of the base, and for a
/// steady one.
struct BaseConductance {
  double sudden_w_m2_k = 0.0;
  double steady_w_m2_k = 0.0;
};

/// Extended thermal model on samples: surface balance, flux-driven states, radiation of other
/// samples and conduction along the surface (physics.md eq. 16-18, 20, 22).
/// Immutable after construction; any thread; RT-safe except for the constructor and size().
class FosterHeat {
 public:
  /// Copies the properties of the materials. States are kelvins above the base of the material;
  /// outputs are offsets from `reference_k`. An interval is split until halving its parts changes
  /// the result by less than `tolerance_k`. It allocates.
  FosterHeat(std::span<const FosterMaterial> materials, double reference_k, double tolerance_k);

  /// Gives `interval` room for the gains. It allocates.
  void size(HeatInterval& interval) const { interval.ladders.resize(materials_.size()); }
  /// Fills the gains of an interval whose forcing is already set.
  void prepare(HeatInterval& interval) const noexcept;

  /// Returns the state at the start of the history. It advances `before_k`, the state of an
  /// unshadowed face, over the tail of the spin-up. `normal` is in world axes.
  [[nodiscard]] SampleState start_state(const SurfaceSample& sample, const glm::vec3& normal,
                                        const physics::FosterState<double>& before_k,
                                        std::span<const HeatInterval> tail) const noexcept;

  /// Advances samples over an interval; see SampleHeat::advance_all().
  void advance(std::span<SampleAdvance> samples, const HeatInterval& interval) const noexcept;

  /// Returns whether a material is a sheet.
  [[nodiscard]] bool is_sheet(std::uint32_t material) const noexcept {
    return materials_[material].sheet;
  }

  /// Returns whether a material rests on the interior of its body.
  [[nodiscard]] bool rests_on_body(std::uint32_t material) const noexcept {
    return materials_[material].body;
  }
  /// Returns the first of the two twins of a material; 0: it has none.
  [[nodiscard]] std::uint32_t first_twin(std::uint32_t material) const noexcept {
    return materials_[material].first_twin;
  }
  [[nodiscard]] bool has_twins() const noexcept {
    return std::ranges::any_of(
        materials_, [](const FosterMaterial& material) { return material.first_twin != 0; });
  }
  [[nodiscard]] bool has_bodies() const noexcept {
    return std::ranges::any_of(materials_, &FosterMaterial::body);
  }
  /// Returns the temperature at which the base of a material starts, from the reference
  /// temperature.
  [[nodiscard]] double base_offset_k(std::uint32_t material) const noexcept {
    return surfaces_[material].base_offset_k;
  }
  /// Returns a temperature as an offset from the reference temperature.
  [[nodiscard]] double offset_of_k(double temperature_k) const noexcept {
    return temperature_k - reference_k_;
  }
  [[nodiscard]] BaseConductance base_conductance(std::uint32_t material) const noexcept;
  /// Returns the flux that a stack in this state would pass into a base of the reference
  /// temperature (physics.md eq. 28).
  [[nodiscard]] double into_base_w_m2(std::uint32_t material,
                                      const SampleState& state) const noexcept;

  /// Returns the mean flux into the solid over an interval of `dt_s` between two states of a
  /// sample, from its slowest mode, which weighs the interval evenly. The base of either state is
  /// `base_offset_k` (the interior of the sample's body, or base_offset_k() of its material). NaN
  /// where no flux drives the state: with prescribed temperatures.
  /// @pre dt_s > 0
  [[nodiscard]] double mean_flux_w_m2(const SurfaceSample& sample, const SampleState& begin,
                                      double begin_base_offset_k, const SampleState& end,
                                      double end_base_offset_k, double dt_s) const noexcept;

  /// Cells of the stacks of a material; none where heat moves straight down alone: in sheets and in
  /// prescribed temperatures.
  [[nodiscard]] const physics::ColumnCells& cells(std::uint32_t material) const noexcept {
    return cells_[material];
  }
  /// Fills the cells of a state at the start of the history from its modes: a steady profile with
  /// the flux of the slowest one, less what a solid beside or above has kept off. A covered sample
  /// loses its modes.
  void begin_column(const SurfaceSample& sample, SampleState& state) const noexcept;
  /// Returns what the cells of a column meet beside them over an interval that all begin in
  /// `states`.
  [[nodiscard]] BesideColumn beside(const SurfaceSamples& all, const SampleColumn& column,
                                    std::span<const SampleState> states) const noexcept;

  /// Returns the output of a sample in this state; see SampleHeat::output().
  SampleOutput output(const SurfaceSample& sample, const glm::vec3& normal,
                      const SurfaceForcing& forcing, const SampleDrive& drive,
                      const SampleState& state) const noexcept;

  /// Brings an output up to a state whose cells have changed since.
  void show_state(std::uint32_t material, const SampleState& state,
                  SampleOutput& output) const noexcept;

  /// Computes the step response of a material; see SampleHeat::step_response().
  void step_response(std::uint32_t material, const ResponseConditions& around,
                     std::span<const double> times_s,
                     std::span<double> response_m2k_w) const noexcept;

 private:
  /// Advances a face that sees the whole sun, and only sky and surroundings, over an interval.
  void advance_unshadowed(std::uint32_t material, const glm::vec3& normal,
                          const HeatInterval& interval,
                          physics::FosterState<double>& modes_k) const noexcept;

  /// Radiation that arrives at a face, before absorption.
  struct Incoming {
    double shortwave_w_m2 = 0.0;
    double longwave_w_m2 = 0.0;
  };
  /// Returns the radiation that arrives at one face (brackets of physics.md eq. 20).
  /// `longwave_seen_w_m2` is the long-wave part from other samples and entities.
  [[nodiscard]] Incoming incoming(const SurfaceSample& sample, const glm::vec3& normal,
                                  const SurfaceForcing& forcing, const SampleDrive& drive,
                                  double longwave_seen_w_m2) const noexcept;
  /// Returns the radiation that drives the body: the mean of both faces of a sheet, else that of
  /// the own face. `longwave_w_m2` selects the begin or the end of the interval in the input of the
  /// back.
  [[nodiscard]] Incoming into_body(const Incoming& own, bool own_covered, const glm::vec3& normal,
                                   const SurfaceForcing& forcing, const SheetBack* back,
                                   double SampleDrive::*longwave_w_m2) const noexcept;
  /// Film and air of a face, or their mean over both faces of a sheet.
  struct FilmDrive {
    double film_w_m2_k = 0.0;
    double air_k = 0.0;
    physics::MoistAir moist;
    double wet_frac = 0.0;  ///< share that rain has wetted
  };
  /// Film and air at both ends of an interval.
  struct FilmSpan {
    FilmDrive begin;
    FilmDrive end;
  };
  /// Fills `lane` and returns true if the surface balance drives the modes of a sample; it advances
  /// those of a covered one. `end` is what arrives at the face at the end of the interval.
  [[nodiscard]] bool begin_advance(const SampleAdvance& each, const HeatInterval& interval,
                                   const Incoming& end, const FilmSpan& film,
                                   physics::FosterLane& lane) const noexcept;
  /// Returns the equations of a column over an interval. The state has its cells at the begin and
  /// its modes at the end.
  [[nodiscard]] ColumnEquations column_equations(
      const SampleAdvance& each, const HeatInterval& interval,
      const physics::FosterDrive<double>& end) const noexcept;
  /// Does with the column of a sample what its drive asks for.
  void conduct_aside(const SampleAdvance& each, const HeatInterval& interval,
                     const physics::FosterDrive<double>& end) const noexcept;
  /// Counts the modes of a sample on a body from its interior (`sign` = -1), or from the base of
  /// its material again (+1), physics.md eq. 27. Returns how much warmer the interior is than that
  /// base.
  double count_from_body(const SampleAdvance& each, double sign) const noexcept;
  /// Advances up to `most` samples.
  template <std::size_t most>
  void advance_group(std::span<SampleAdvance> group, const HeatInterval& interval) const noexcept;
  /// Returns film and air over an interval. The natural part follows the temperature at its begin.
  [[nodiscard]] FilmSpan film_over(const SampleAdvance& each,
                                   const IntervalForcing& forcing) const noexcept;
  /// Returns the input of the surface balance: absorbed flux A, film and air, with the exchange of
  /// water and the heat of a part.
  [[nodiscard]] physics::FosterDrive<double> absorbed(std::uint32_t material, const FilmDrive& film,
                                                      const Incoming& in,
                                                      const PartHeat& part) const noexcept;
  /// Returns the output of a sample of known temperature.
  [[nodiscard]] SampleOutput output_of(const SurfaceSample& sample, const Incoming& in,
                                       const SampleDrive& drive, double offset_k) const noexcept;
  /// Returns the surface temperature as an offset from the reference temperature, with the heat of
  /// neighbours.
  [[nodiscard]] double offset_k(std::uint32_t material, const SampleState& state) const noexcept;

  std::vector<FosterMaterial> materials_;
  std::vector<physics::FosterSurface<double>> surfaces_;
  std::vector<physics::ColumnCells> cells_;  ///< by material; none where heat moves straight down
  double reference_k_ = 0.0;
  double tolerance_k_ = 0.0;
};

}  // namespace emit::renderer
