// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "emit/physics/foster.hpp"
#include "emit/physics/relaxation.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "history/entity_air.hpp"
#include "history/part_history.hpp"
#include "surface/heat/column_equations.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Largest number of relaxation modes of a material (physics.md eq. 5). Further modes are ignored.
inline constexpr std::size_t kMaxRelaxationModes = 2;

/// Inputs that act on entities alone over an interval: the drives of their parts, by entity and
/// material, and the air past them. The type is plain data; find() is RT-safe.
struct EntityForcing {
  struct Part {
    std::size_t entity = 0;
    std::uint32_t material = 0;
    PartHeatSpan heat;
  };
  std::vector<Part> parts;      ///< ascending by entity
  std::vector<EntityAir> airs;  ///< by entity; empty before the history

  /// Returns the drive of the samples of an entity with a material; null if no part has them.
  [[nodiscard]] const Part* find(const SurfaceSample& sample) const noexcept {
    if (sample.entity < 0 || parts.empty()) return nullptr;
    const auto entity = static_cast<std::size_t>(sample.entity);
    auto part = std::ranges::lower_bound(parts, entity, {}, &Part::entity);
    for (; part != parts.end() && part->entity == entity; ++part) {
      if (part->material == sample.material) return &*part;
    }
    return nullptr;
  }
  /// Sets the drives and the air for an interval, of the same parts and entities in the same order.
  /// It allocates the first time.
  void update(std::span<const PartHistory> histories, std::span<const PoseHistory> entities,
              const IntervalForcing& forcing, std::int64_t begin_ns, std::int64_t end_ns) {
    airs.resize(entities.size());
    for (std::size_t i = 0; i < entities.size(); ++i) {
      airs[i] = entity_air(entities[i], forcing, begin_ns, end_ns);
    }
    parts.resize(histories.size());
    for (std::size_t i = 0; i < histories.size(); ++i) {
      parts[i] = {histories[i].entity(), histories[i].material(),
                  histories[i].over(begin_ns, end_ns)};
    }
  }
};

/// Cells with which those of a column exchange heat over an interval, by cell of the column
/// (physics.md eq. 22).
struct BesideColumn {
  physics::CellState<double> conductance_w_m2_k{};  ///< sum over them
  physics::CellState<double>
      mean_k{};  ///< their mean by conductance, from the reference temperature
};
/// The type says how a step treats the column of a sample. Without `beside` and `equations` it
/// leaves the cells as they are.
struct ColumnDrive {
  const SampleColumn* column = nullptr;
  const BesideColumn* beside = nullptr;  ///< the cells advance with these neighbours
  ColumnEquations* equations = nullptr;  ///< filled, for neighbours that are to be found together
  /// Expected change over the interval of what neighbours add to the surface temperature.
  double change_k = 0.0;
};

/// Input of one sample over one interval, in addition to the forcing that all samples share.
struct SampleDrive {
  /// Visible share of the sun's disc, mean over the interval. Broken clouds multiply it by the sun
  /// that they leave, by the mean of the weather (IntervalRays::cloud_sun()).
  float sun_frac = 0.0F;
  /// Share of the sample's sky that entities hide, mean over the interval.
  float hidden_sky_frac = 0.0F;
  /// True if the long-wave terms below include what those entities send. Otherwise the hidden part
  /// of the sky counts as surroundings.
  bool hidden_is_seen = false;
  /// Radiation from other samples in view, already multiplied by their weights: long-wave at the
  /// begin and the end of the interval, short-wave as one value for the interval.
  double longwave_begin_w_m2 = 0.0;
  double longwave_end_w_m2 = 0.0;
  double shortwave_w_m2 = 0.0;
  /// Temperature of the interior of the sample's body, mean over the interval, from the reference
  /// temperature. It counts if the sample has a body.
  double body_k = 0.0;
  ColumnDrive aside;
  /// Heat of the part that the sample belongs to (physics.md eq. 29).
  PartHeatSpan part;
  /// Air past the sample's entity, in the forcing of the interval. Null: the air of the scenery.
  const EntityAir* air = nullptr;

  /// Takes the heat of the sample's part and the air past its entity from the forcing of an
  /// interval, which must outlive the drive.
  void take_entity(const EntityForcing& entities, const SurfaceSample& sample) noexcept {
    if (const EntityForcing::Part* found = entities.find(sample)) part = found->heat;
    if (sample.entity >= 0 && !entities.airs.empty()) {
      air = &entities.airs[static_cast<std::size_t>(sample.entity)];
    }
  }
};

/// State of the air and the surface around which a step response is linearised.
struct ResponseConditions {
  double film_w_m2_k = 0.0;
  double surface_k = 300.0;
  physics::MoistAir moist = {};
};

/// Other face of a sheet: its sample and its input. Its normal is opposite to that of the first
/// face.
struct SheetBack {
  const SurfaceSample& sample;
  const SampleDrive& drive;
};

/// One sample on its way over an interval: what goes into SampleHeat::advance_all(), and what comes
/// out of it.
struct SampleAdvance {
  const SurfaceSample* sample = nullptr;
  glm::vec3 normal{0.0F};  ///< world axes, in the middle of the interval
  SampleDrive drive;
  SampleState* state = nullptr;     ///< at the begin of the interval, then at its end
  const SheetBack* back = nullptr;  ///< other face of a sheet; null for all other samples
  SampleOutput output;              ///< at the end of the interval
  double bow_k = 0.0;               ///< see SampleVertex
};
/// Number of samples that are best advanced together.
inline constexpr std::size_t kAdvanceTogether = physics::kFosterLanes;

/// Forcing of an interval and the gains of the thermal model over it, one entry per material. The
/// vector of the model that is not in use stays empty.
struct HeatInterval {
  using Relaxation = std::array<physics::RelaxationGains<double>, kMaxRelaxationModes>;

  IntervalForcing forcing;
  /// The host has changed the weather at its begin or shortly before: then temperatures have a bow.
  bool after_weather = false;
  EntityForcing entities;
  std::vector<physics::FosterLadder> ladders;  ///< gains of the model foster
  std::vector<Relaxation> relaxation;          ///< gains of the model emit2014
};

}  // namespace emit::renderer
