// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Data of the sweeps of exchange(). The rows stay where the patches have put them: with a million
/// samples they take gigabytes.
struct SampleHistories {
  /// Rows of one sample.
  struct Rows {
    std::span<const float> sun_frac;        ///< by interval
    std::span<const HiddenSky> hidden_sky;  ///< by interval; empty without entities
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

/// Number of sweeps of exchange() after a first guess that takes the surroundings for everything
/// seen. Each sweep follows heat over one more bounce, of which a third at most is reflected or
/// emitted again within minutes.
inline constexpr std::uint32_t kExchangeSweeps = 3;

/// Options of exchange().
struct ExchangeOptions {
  std::uint32_t sweeps = kExchangeSweeps;
  bool exitance = true;  ///< entities send long-wave radiation to the surfaces whose sky they hide
};

/// Integrates all samples over the record several times, each time with the radiation and the heat
/// that the others sent in the time before. These are Jacobi sweeps over whole histories, so the
/// result does not depend on the order of samples (physics.md eq. 20, 22). Fills states and outputs
/// of the model; samples that exchange nothing are left as they are. Uses all cores. Returns false
/// when `report` stopped it.
[[nodiscard]] bool exchange(const SurfaceInputs& inputs, const ExchangeOptions& options,
                            SampleHistories histories, SurfaceModel& model,
                            const SurfaceProgress& report);

}  // namespace emit::renderer
