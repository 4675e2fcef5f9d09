// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// What the sweeps of exchange() work with, by sample of a model.
struct SampleHistories {
  std::vector<SampleState> start;     ///< at the first node
  std::vector<float> sun_frac;        ///< by sample, then interval
  std::vector<HiddenSky> hidden_sky;  ///< likewise; empty without entities
  /// What the samples send out, as far as it is known; it keeps nothing where they exchange
  /// nothing.
  SentHistory sent;
};

/// Gathers what the patches' own evaluation gave, in the order of the model's samples, as the first
/// guess: there what is seen counts as the surroundings. Fills states and outputs of the model and
/// frees the histories of the patches.
/// @pre number_samples() has laid out the model
[[nodiscard]] SampleHistories take_histories(const SurfaceInputs& inputs,
                                             std::vector<SurfacePatch>& patches,
                                             SurfaceModel& model);

/// Sweeps of exchange() after a first guess that takes the surroundings for whatever is seen. Each
/// passes heat on by one more bounce, of which a third at most is reflected or re-emitted within
/// minutes.
inline constexpr std::uint32_t kExchangeSweeps = 3;

struct ExchangeOptions {
  std::uint32_t sweeps = kExchangeSweeps;
  /// The first guess is each sample's own history among its surroundings, and states and outputs of
  /// the model are its end: samples that exchange nothing are left as they are.
  bool evaluated = true;
  bool glow = true;  ///< entities send long-wave radiation to the surfaces whose sky they hide
};

/// Carries all samples over the record several times, each time with the radiation and the heat
/// that the others sent the time before (Jacobi sweeps over whole histories, so the result does not
/// depend on the order of samples). Fills states and outputs of the model. Uses all cores. False
/// when `report` stopped it.
[[nodiscard]] bool exchange(const SurfaceInputs& inputs, const ExchangeOptions& options,
                            SampleHistories histories, SurfaceModel& model,
                            const SurfaceProgress& report);

}  // namespace emit::renderer
