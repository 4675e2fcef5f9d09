// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <vector>

#include "emit/physics/foster.hpp"
#include "emit/physics/relaxation.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Relaxation modes of a material that count (physics.md eq. 5).
inline constexpr std::size_t kMaxRelaxationModes = 2;

/// What a sample receives over one interval beside the forcing that all share.
struct SampleDrive {
  float sun_frac = 0.0F;         ///< visible share of the disc, mean
  float hidden_sky_frac = 0.0F;  ///< share of the sample's sky behind entities, mean
  /// What those entities send counts in the long wave below; else they send what the surroundings
  /// do.
  bool hidden_is_seen = false;
  /// From the samples it sees, their weights included.
  double longwave_begin_w_m2 = 0.0;
  double longwave_end_w_m2 = 0.0;
  double shortwave_w_m2 = 0.0;
  /// Net fluxes into the partners' faces.
  std::array<double, kMaxPartners> partner_begin_w_m2{};
  std::array<double, kMaxPartners> partner_end_w_m2{};
};

/// What a step response is linearised around.
struct ResponseConditions {
  double film_w_m2_k = 0.0;
  double surface_k = 300.0;
};

/// The other face of a sheet: its normal is opposite.
struct SheetBack {
  const SurfaceSample& sample;
  const SampleDrive& drive;
};

/// The forcing of an interval and, by material, the gains of the thermal model's steps; those of
/// the other model are empty.
struct HeatInterval {
  using Relaxation = std::array<physics::RelaxationGains<double>, kMaxRelaxationModes>;

  IntervalForcing forcing;
  std::vector<physics::FosterLadder> ladders;  ///< foster
  std::vector<Relaxation> relaxation;          ///< emit2014
};

}  // namespace emit::renderer
