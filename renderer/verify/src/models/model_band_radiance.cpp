// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "emit/physics/band_radiance_lut.hpp"
#include "emit/physics/planck.hpp"
#include "gpu_rows.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {
namespace {

using physics::BandRadianceLut;
using physics::Result;

constexpr std::size_t kBands = 4;
template <class Real>
using Results = std::array<std::vector<Real>, kBands>;

/// Returns the bands in the order of the output columns.
std::array<physics::Band, kBands> bands() {
  return {physics::Band{3.0, 5.0, {}}, physics::Band{3.4, 4.1, {}}, physics::Band{8.0, 12.0, {}},
          physics::Band{7.7, 9.3, {}}};
}

/// Returns the tables that the renderer uses. Hotter rows extend them with the same spacing.
Result<std::vector<BandRadianceLut>> tables(const std::vector<double>& temperature_k) {
  BandRadianceLut::Options options;
  const double spacing_k = (options.max_k - options.min_k) / (options.nodes - 1);
  for (const double t : temperature_k) {
    if (std::isfinite(t)) options.max_k = std::max(options.max_k, t);
  }
  constexpr double kMaxNodes = 1 << 20;
  options.nodes = static_cast<std::uint32_t>(
      std::min(kMaxNodes, std::ceil((options.max_k - options.min_k) / spacing_k) + 1.0));
  std::vector<BandRadianceLut> luts;
  for (const physics::Band& band : bands()) {
    auto lut = BandRadianceLut::build(band, options);
    if (!lut) return tl::unexpected(std::move(lut.error()));
    luts.push_back(std::move(*lut));
  }
  return luts;
}

bool is_defined(double temperature_k) {
  return temperature_k >= 0.0 && std::isfinite(temperature_k);
}

Results<double> exact(const std::vector<double>& temperature_k) {
  Results<double> out;
  const auto all = bands();
  for (std::size_t band = 0; band < kBands; ++band) {
    for (const double t : temperature_k) {
      out[band].push_back(
          is_defined(t) ? physics::band_radiance(all[band], physics::Kelvin(t)).radiance_w_m2_sr
                        : kUndefined<double>);
    }
  }
  return out;
}

Results<float> looked_up(const std::vector<BandRadianceLut>& luts,
                         const std::vector<double>& temperature_k) {
  Results<float> out;
  for (std::size_t band = 0; band < kBands; ++band) {
    for (const double t : temperature_k) {
      out[band].push_back(is_defined(t) ? luts[band].lookup(static_cast<float>(t)).radiance_w_m2_sr
                                        : kUndefined<float>);
    }
  }
  return out;
}

Result<Results<float>> on_gpu(const std::vector<BandRadianceLut>& luts,
                              const std::vector<double>& temperature_k, int gpu_index) {
  // The constants are four layouts, then the four tables one after the other.
  std::vector<float> constants;
  std::uint32_t first = 4 * kBands;
  for (const BandRadianceLut& lut : luts) {
    const auto layout = lut.shader_layout(first);
    constants.insert(constants.end(), layout.begin(), layout.end());
    first += static_cast<std::uint32_t>(lut.nodes().size());
  }
  for (const BandRadianceLut& lut : luts) {
    constants.insert(constants.end(), lut.nodes().begin(), lut.nodes().end());
  }
  const std::vector<float> inputs(temperature_k.begin(), temperature_k.end());
  GpuRows job;
  job.shader = "passes/evaluate_band_radiance.comp";
  job.inputs = inputs;
  job.output_stride = kBands;
  job.constants = constants;
  job.gpu_index = gpu_index;
  const auto raw = run_gpu_rows(job);
  if (!raw) return tl::unexpected(raw.error());
  Results<float> out;
  for (std::size_t band = 0; band < kBands; ++band) {
    for (std::size_t i = 0; i < temperature_k.size(); ++i) {
      out[band].push_back(is_defined(temperature_k[i]) ? (*raw)[kBands * i + band]
                                                       : kUndefined<float>);
    }
  }
  return out;
}

}  // namespace

Result<std::string> run_band_radiance(const EvaluateRequest& request,
                                      const physics::CsvTable& table) {
  const auto temperature_k = table.numbers(kBandRadianceInputs);
  if (!temperature_k) return tl::unexpected(temperature_k.error());
  if (request.precision == Precision::float64) {
    return write_csv(kBandRadianceOutputs, exact(*temperature_k));
  }
  const auto luts = tables(*temperature_k);
  if (!luts) return tl::unexpected(luts.error());
  if (request.device == Device::cpu) {
    return write_csv(kBandRadianceOutputs, looked_up(*luts, *temperature_k));
  }
  const auto result = on_gpu(*luts, *temperature_k, request.gpu_index);
  if (!result) return tl::unexpected(result.error());
  return write_csv(kBandRadianceOutputs, *result);
}

}  // namespace emit::verify
