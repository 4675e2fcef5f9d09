// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Data of the passes of exchange(). The rows stay where the patches have put them: with a million
/// samples they take gigabytes.
struct SampleHistories {
  /// Rows of one sample.
  struct Rows {
    std::span<const float> sun_frac;        ///< by interval
    std::span<const HiddenSky> hidden_sky;  ///< by interval; empty without entities
    std::span<const float> cloud_sun;       ///< by interval; empty without broken clouds
    /// Radiation and heat that the sample sends out, as a first guess. It is empty if samples
    /// exchange nothing.
    std::span<float> sent_w_m2;
  };
  std::vector<Rows> rows;             ///< by sample
  std::vector<SampleState> start;     ///< by sample: state at the first node
  std::vector<SurfacePatch> patches;  ///< owners of the rows; their other arrays are freed
};

/// Gathers the results of the patches' own evaluation in the order of the model's samples. They are
/// the first guess of exchange(), in which everything that a sample sees has the temperature of the
/// surroundings. Fills states and outputs of the model.
/// @pre number_samples() has laid out the model
[[nodiscard]] SampleHistories take_histories(const SurfaceInputs& inputs,
                                             std::vector<SurfacePatch> patches,
                                             SurfaceModel& model);

/// Residual of the exchange: radiation that arrives at a sample and that the iteration has not
/// followed yet, W/m2. What is left of a temperature is below it divided by the radiative
/// conductance (6 W m-2 K-1 at 300 K) and by the share of the radiation that a round trip loses.
inline constexpr double kExchangeResidual_w_m2 = 0.02;
/// Largest number of iterations in a window. Where they do not suffice, the residual that is left
/// stands in SurfaceModel::exchange_left_w_m2.
inline constexpr std::uint32_t kMostIterations = 200;
/// Options of exchange().
struct ExchangeOptions {
  bool exitance = true;  ///< entities send long-wave radiation to the surfaces whose sky they hide
};

/// Integrates all samples over the record, with the radiation that the others send meanwhile. The
/// record is cut into windows of a few intervals; within each, the radiation is iterated until its
/// residual is below kExchangeResidual_w_m2 (physics.md eq. 20), with mixed steps where plain ones
/// are slow. The result does not depend on the order of samples. Columns
/// (eq. 22) are integrated together, interval by interval. Interiors of bodies take several passes
/// over the record, of which the last one iterates. Fills
/// states and outputs of the model; samples that exchange nothing are left as they are. Uses all
/// cores. Returns false when `report` stopped it.
[[nodiscard]] bool exchange(const SurfaceInputs& inputs, const ExchangeOptions& options,
                            SampleHistories histories, SurfaceModel& model,
                            const SurfaceProgress& report);

}  // namespace emit::renderer
