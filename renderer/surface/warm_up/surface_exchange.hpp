// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Data of the sweeps of exchange(), by sample of a model.
struct SampleHistories {
  std::vector<SampleState> start;     ///< state at the first node
  std::vector<float> sun_frac;        ///< by sample, then interval
  std::vector<HiddenSky> hidden_sky;  ///< by sample, then interval; empty without entities
  /// Radiation and heat that the samples send out, as a first guess. It stores nothing if samples
  /// exchange nothing.
  SentHistory sent;
};

/// Gathers the results of the patches' own evaluation in the order of the model's samples. They are
/// the first guess of exchange(), in which everything that a sample sees has the temperature of the
/// surroundings. Fills states and outputs of the model and frees the histories of the patches.
/// @pre number_samples() has laid out the model
[[nodiscard]] SampleHistories take_histories(const SurfaceInputs& inputs,
                                             std::vector<SurfacePatch>& patches,
                                             SurfaceModel& model);

/// Number of sweeps of exchange() after a first guess that takes the surroundings for everything
/// seen. Each sweep follows heat over one more bounce, of which a third at most is reflected or
/// emitted again within minutes.
inline constexpr std::uint32_t kExchangeSweeps = 3;

/// Options of exchange().
struct ExchangeOptions {
  std::uint32_t sweeps = kExchangeSweeps;
  /// The flag is true if the first guess is each sample's own history among its surroundings and
  /// the model holds its end. Then samples that exchange nothing are left as they are.
  bool evaluated = true;
  bool glow = true;  ///< entities send long-wave radiation to the surfaces whose sky they hide
};

/// Integrates all samples over the record several times, each time with the radiation and the heat
/// that the others sent in the time before. These are Jacobi sweeps over whole histories, so the
/// result does not depend on the order of samples (physics.md eq. 20, 22). Fills states and outputs
/// of the model. Uses all cores. Returns false when `report` stopped it.
[[nodiscard]] bool exchange(const SurfaceInputs& inputs, const ExchangeOptions& options,
                            SampleHistories histories, SurfaceModel& model,
                            const SurfaceProgress& report);

}  // namespace emit::renderer
