// SPDX-License-Identifier: Apache-2.0
#include "emit/verify/evaluate.hpp"

#include <fmt/format.h>

#include "models.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Model and its function.
struct Model {
  ModelInfo info;
  Result<std::string> (*run)(const EvaluateRequest&, const physics::CsvTable&);
};

constexpr Model kModels[] = {
    {{"equilibrium", kEquilibriumInputs, kEquilibriumOutputs,
      "equilibrium temperature of a surface over a core, with convection"},
     run_equilibrium},
    {{"balance", kBalanceInputs, kBalanceOutputs,
      "absorbed flux, radiative and equilibrium temperature, without and with convection"},
     run_balance},
    {{"band-radiance", kBandRadianceInputs, kBandRadianceOutputs,
      "in-band radiance of a blackbody, W m-2 sr-1"},
     run_band_radiance},
    {{"relaxation", kRelaxationInputs, kRelaxationOutputs,
      "relaxation modes under a given drive (--cases, --nodes)"},
     run_relaxation},
    {{"sun-position", kSunPositionInputs, kSunPositionOutputs,
      "airless topocentric azimuth and elevation of the sun, deg", false},
     run_sun_position},
    {{"air-path", kAirPathInputs, kAirPathOutputs,
      "transmittance and thermal radiance of the air between sensor and target; with the sun, by "
      "its apparent elevation and its azimuth from the line of sight, also what it scatters"},
     run_air_path},
    {{"fog-path", kFogPathInputs, kFogPathOutputs,
      "fog in a band, where a line of sight lies in it, and its transmittance beside the air's",
      false},
     run_fog_path},
    {{"air-sky", kAirSkyInputs, kAirSkyOutputs,
      "transmittance of the air to space and radiance of the clear sky; with the sun likewise"},
     run_air_sky},
    {{"air-sun", kAirSunInputs, kAirSunOutputs,
      "direct sunlight at sea level in a band, normal to the sun, at 1 au"},
     run_air_sun},
    {{"sun-disc", kSunDiscInputs, kSunDiscOutputs,
      "visible share of the sun's disc at an edge; integrated, or by --rays"},
     run_sun_disc},
    {{"wall-shadow", kWallShadowInputs, kWallShadowOutputs,
      "visible share of the sun's disc behind a wall (--rays; gpu: --method)"},
     run_wall_shadow},
    {{"sky-view", kSkyViewInputs, kSkyViewOutputs,
      "cosine-weighted sky view factor and share of the full sphere (--rays; gpu: --method)"},
     run_sky_view},
    {{"conduction-slab", kConductionSlabInputs, kConductionOutputs,
      "slab heated by a flux or a film, base held or insulated: temperature at depth x (--refine)",
      false},
     run_conduction_slab},
    {{"conduction-semi-infinite", kConductionSemiInfiniteInputs, kConductionOutputs,
      "deep body under flux, film, step or periodic face: temperature at depth x (--refine)",
      false},
     run_conduction_semi_infinite},
    {{"conduction-layered", kConductionLayeredInputs, kConductionLayeredOutputs,
      "impedance of one to three layers from the solver's matrices, K m2/W and rad (--refine)",
      false},
     run_conduction_layered},
    {{"conduction-lateral", kConductionLateralInputs, kConductionLateralOutputs,
      "rise of temperature near a lit patch of a deep solid, K (--refine)", false},
     run_conduction_lateral},
    {{"surface-history", kSurfaceHistoryInputs, kSurfaceHistoryOutputs,
      "surface temperature of a layered body (--layers, --base-k, --emissivity, --film-w-m2-k, "
      "--initial, --model)",
      false},
     run_surface_history},
};

}  // namespace

std::span<const ModelInfo> models() {
  static const auto list = [] {
    std::array<ModelInfo, std::size(kModels)> infos;
    for (std::size_t i = 0; i < infos.size(); ++i) infos[i] = kModels[i].info;
    return infos;
  }();
  return list;
}

Result<std::string> evaluate(const EvaluateRequest& request) {
  const Model* model = nullptr;
  std::string known;
  for (const Model& candidate : kModels) {
    if (candidate.info.name == request.model) model = &candidate;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", candidate.info.name);
  }
  if (model == nullptr) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("unknown model '{}'; there are {}", request.model, known));
  }
  if (request.device == Device::gpu && request.precision == Precision::float64) {
    return make_error(ErrorCode::invalid_argument,
                      "the GPU path is float32: use --precision float32 --device gpu, or "
                      "--precision float64 --device cpu");
  }
  if (!model->info.float32 && request.precision == Precision::float32) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("model '{}' runs on the CPU in float64 only", request.model));
  }
  const auto table = physics::CsvTable::read(request.table);
  if (!table) return tl::unexpected(table.error());
  return model->run(request, *table);
}

}  // namespace emit::verify
