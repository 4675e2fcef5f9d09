// SPDX-License-Identifier: Apache-2.0
#include "stages/gas_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "emit/physics/air_film.hpp"
#include "emit/physics/check.hpp"
#include "emit/physics/gas/puff.hpp"
#include "passes/gas_pass.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

static_assert(scene::kMaxGasPuffs == EMIT_MAX_GAS_PUFFS);
static_assert(physics::kGasTerms == 4);

constexpr double kAtmospherePa = 101'325.0;
constexpr double kRootTwoPi = 2.5066282746310002;
/// Puffs along a line have this standard deviation by their distance. Their sum is then level
/// within 1e-4.
constexpr double kSigmaPerSpacing = 0.7;
/// Share of exhaust gas at which a plume ends.
constexpr double kLastExhaust = 0.04;
/// Image of a puff, in pixels of standard deviation, above which averages over pixels no longer
/// differ from the value in the middle, and the angle above which the image is no plain Gaussian.
constexpr double kSmallSigmaPx = 4.0;
constexpr double kSmallSigmaRad = 0.1;
/// Optical depth of a row of puffs below which averages of the depth do for those of the light, and
/// the samples that its image then needs, as kGasSampleSigmas.
constexpr double kThin = 0.1;
constexpr float kThinSampleSigmas = 0.7F;
/// Least width of the image of a puff by its length.
constexpr double kNarrowest = 1.0 / 200.0;
/// Growth of smoke by its way through the air, for neutral air over open land (Briggs 1973, class
/// D): the mean of 0.08 across and 0.06 upwards.
constexpr double kSmokeSpread = 0.07;
constexpr double kCalmM_s = 0.5;
/// Ages of smoke puffs: the youngest are the closest together.
constexpr double kAgePower = 2.5;

/// Nodes and weights of Gauss and Legendre on 0..1.
constexpr std::array<std::pair<double, double>, 5> kGauss{
    {{0.04691007703066802, 0.11846344252809454},
     {0.23076534494715845, 0.23931433524968324},
     {0.5, 0.28444444444444444},
     {0.76923465505284155, 0.23931433524968324},
     {0.95308992296933198, 0.11846344252809454}}};

/// Opacity of a line of gas whose optical depth falls off as a Gaussian across it: the integral of
/// 1
/// - exp(-depth exp(-x^2 / 2)) over x, by that of the Gaussian. A line too narrow for the image is
/// drawn wider, with the depth that leaves width times opacity the same.
class LineOpacity {
 public:
  LineOpacity() {
    for (std::size_t i = 0; i < kNodes; ++i) {
      const double depth = std::exp(kFirstLog + kLogStep * static_cast<double>(i));
      double sum = 0.0;
      constexpr int kSteps = 400;
      constexpr double kEdge = 10.0;
      for (int k = 0; k < kSteps; ++k) {
        const double x = kEdge * (k + 0.5) / kSteps;
        sum -= std::expm1(-depth * std::exp(-0.5 * x * x));
      }
      log_opacity_[i] = std::log(2.0 * sum * kEdge / kSteps / kRootTwoPi);
    }
  }
  /// Depth of a line that is wider by 1 / `narrow_frac` and as opaque in all.
  [[nodiscard]] double widened_depth(double depth, double narrow_frac) const noexcept {
    if (!(depth > 0.0)) return 0.0;
    const double place = (std::log(depth) - kFirstLog) / kLogStep;
    // Thin gas is as opaque as it is deep.
    if (place <= 0.0) return depth * narrow_frac;
    const auto low = std::min(static_cast<std::size_t>(place), kNodes - 2);
    const double frac = place - static_cast<double>(low);
    const double log_opacity = std::lerp(log_opacity_[low], log_opacity_[low + 1], frac);
    const double wanted = log_opacity + std::log(narrow_frac);
    if (wanted <= log_opacity_.front()) return std::exp(wanted);
    const auto above = std::upper_bound(log_opacity_.begin(), log_opacity_.end() - 1, wanted);
    const auto high = static_cast<std::size_t>(above - log_opacity_.begin());
    const double part =
        (wanted - log_opacity_[high - 1]) / (log_opacity_[high] - log_opacity_[high - 1]);
    return std::exp(kFirstLog + kLogStep * (static_cast<double>(high - 1) + part));
  }

 private:
  static constexpr std::size_t kNodes = 161;
  static constexpr double kFirstLog = -9.0;
  static constexpr double kLogStep = 0.125;
  std::array<double, kNodes> log_opacity_{};
};

/// Table of every model. It is made when the first model is built.
const LineOpacity& line_opacity() {
  static const LineOpacity opacity;
  return opacity;
}

/// Image of a puff as its two axes: variances and the direction of the first.
struct ImageAxes {
  std::array<double, 2> variance_px2{};
  glm::dvec2 first{1.0, 0.0};

  explicit ImageAxes(const glm::dvec3& covariance_px2) {
    const double middle = 0.5 * (covariance_px2.x + covariance_px2.z);
    const double half = 0.5 * (covariance_px2.x - covariance_px2.z);
    const double radius = std::hypot(half, covariance_px2.y);
    variance_px2 = {middle + radius, std::max(middle - radius, 0.0)};
    const double angle = 0.5 * std::atan2(covariance_px2.y, half);
    first = {std::cos(angle), std::sin(angle)};
  }
  [[nodiscard]] glm::dvec3 covariance_px2() const {
    const glm::dvec2 second(-first.y, first.x);
    const auto part = [&](const glm::dvec2& axis, double variance) {
      return variance * glm::dvec3(axis.x * axis.x, axis.x * axis.y, axis.y * axis.y);
    };
    return part(first, variance_px2[0]) + part(second, variance_px2[1]);
  }
};

/// Value that a band has in a list, if it is there.
double in_band(const std::vector<scene::BandValue>& list, const std::string& band,
               double otherwise) noexcept {
  for (const scene::BandValue& entry : list) {
    if (entry.band == band) return entry.value;
  }
  return otherwise;
}

}  // namespace

template <class Desc>
std::optional<GasModel::Stand> GasModel::stand_of(const Source<Desc>& source,
                                                  const SceneHistory& history,
                                                  std::int64_t sim_time_ns) noexcept {
  if (!source.entity) return Stand{source.placement, glm::dvec3(0.0)};
  const PoseHistory& entity = history.entities[*source.entity];
  const scene::TrajectoryState state = entity.at(sim_time_ns);
  if (!state.on) return std::nullopt;
  constexpr std::int64_t kSpanNs = 100'000'000;
  return Stand{state.pose, entity.motion(sim_time_ns - kSpanNs, sim_time_ns).velocity_m_s};
}

Result<GasModel> GasModel::build(const scene::ScenarioDesc& scenario) {
  const scene::GasDesc& gas = scenario.gas;
  if (gas.puffs() > EMIT_MAX_GAS_PUFFS) {
    return make_error(
        ErrorCode::config,
        fmt::format("plumes, flares, smoke and fires take {} puffs of gas: {} are possible ({} a "
                    "plume, {} a flare, {} a smoke, {} a fire)",
                    gas.puffs(), EMIT_MAX_GAS_PUFFS, scene::PlumeDesc::kPuffs,
                    scene::FlareDesc::kPuffs, scene::SmokeDesc::kPuffs, scene::FireDesc::kPuffs));
  }
  GasModel model;
  (void)line_opacity();
  const std::vector<std::int32_t> histories = histories_of_objects(scenario);
  const auto source_of = [&](const auto& desc) {
    Source<std::decay_t<decltype(desc)>> source{desc, std::nullopt, {}};
    for (std::size_t i = 0; i < scenario.objects.size(); ++i) {
      if (scenario.objects[i].name != desc.object) continue;
      source.placement = scenario.objects[i].instances.front();
      if (histories[i] >= 0) source.entity = static_cast<std::size_t>(histories[i]);
    }
    return source;
  };
  for (const auto& desc : gas.plumes) {
    Plume& plume = model.plumes_.emplace_back();
    plume.source = source_of(desc);
    plume.source.desc.direction_body = glm::normalize(desc.direction_body);
    for (const scene::ObjectDesc& object : scenario.objects) {
      if (object.name != desc.object) continue;
      for (const scene::PartDesc& part : object.parts) {
        if (part.name == desc.part) plume.part_id = part.id;
      }
    }
  }
  for (const auto& desc : gas.flares) model.flares_.push_back(source_of(desc));
  for (const auto& desc : gas.smokes) model.smokes_.push_back(source_of(desc));
  for (const auto& desc : gas.fires) model.fires_.push_back(source_of(desc));
  for (const scene::SpectralBand& band : scenario.bands) model.band_names_.push_back(band.name);
  model.place_m_ = scenario.place.height_m;
  model.start_ns_ = scenario.thermal.history_start_ns;
  if (auto built = model.build_spectra(scenario); !built) {
    return tl::unexpected(std::move(built.error()));
  }
  if (auto built = model.build_air(scenario); !built) {
    return tl::unexpected(std::move(built.error()));
  }
  return model;
}

Result<void> GasModel::build_spectra(const scene::ScenarioDesc& scenario) {
  // One set of terms holds for all exhausts: that of the mean one.
  physics::GasState reference{.mixture = {}, .kelvin = 800.0};
  if (plumes_.empty()) {
    reference.mixture = {0.06, 0.06};
  } else {
    const double share = 1.0 / static_cast<double>(plumes_.size());
    reference.kelvin = 0.0;
    for (const Plume& plume : plumes_) {
      const scene::PlumeDesc& desc = plume.source.desc;
      reference.mixture.co2_frac += share * desc.exhaust.co2_frac;
      reference.mixture.h2o_frac += share * desc.exhaust.h2o_frac;
      reference.kelvin += share * desc.full.exit_k;
    }
  }
  for (std::size_t b = 0; b < scenario.bands.size(); ++b) {
    auto band = physics::GasBand::build(scene::spectral_band(scenario.bands[b]), reference);
    if (!band) {
      return make_error(ErrorCode::config,
                        fmt::format("band '{}': {}", scenario.bands[b].name, band.error().text));
    }
    for (std::size_t t = 0; t < physics::kGasTerms; ++t) {
      term_frac_[b][static_cast<glm::length_t>(t)] = static_cast<float>(band->share_frac()[t]);
    }
    spectra_.push_back(std::move(*band));
  }
  return {};
}

Result<void> GasModel::build_air(const scene::ScenarioDesc& scenario) {
  // Hot gas emits where cold gas of the same kind absorbs. Give the built-in air the spectrum that
  // a plume emits at its nozzle as the response of a band of its own.
  for (Plume& plume : plumes_) {
    const scene::PlumeDesc& desc = plume.source.desc;
    const physics::GasState exit{.mixture = desc.exhaust, .kelvin = desc.full.exit_k};
    for (std::size_t b = 0; scenario.atmosphere.enabled && b < scenario.bands.size(); ++b) {
      const scene::BandAtmosphere* air = nullptr;
      for (const scene::BandAtmosphere& entry : scenario.atmosphere.bands) {
        if (entry.band == scenario.bands[b].name) air = &entry;
      }
      if (air == nullptr || !air->model) continue;
      const physics::Band band = scene::spectral_band(scenario.bands[b]);
      physics::Band shaped = band;
      shaped.response.clear();
      constexpr std::size_t kPoints = 400;
      double most = 0.0;
      for (std::size_t i = 0; i < kPoints; ++i) {
        const double um = band.lo_um + (band.hi_um - band.lo_um) * static_cast<double>(i) /
                                           static_cast<double>(kPoints - 1);
        const double emissivity =
            1.0 - physics::gas_transmittance(exit, 1e4 / um, 2.0 * desc.radius_m) *
                      std::exp(-2.0 * desc.soot_per_m * desc.radius_m);
        shaped.response.push_back({um, emissivity * physics::response_frac(band, um)});
        most = std::max(most, shaped.response.back().response_frac);
      }
      if (!(most > 0.0)) continue;  // the plume does not emit in this band
      auto column = physics::AirColumn::build(*air->model);
      if (!column) {
        return make_error(ErrorCode::config, fmt::format("band '{}': {}", scenario.bands[b].name,
                                                         column.error().text));
      }
      auto own = physics::BandAir::build(shaped);
      if (!own) {
        return make_error(ErrorCode::config, fmt::format("plume '{}' in band '{}': {}", desc.name,
                                                         scenario.bands[b].name, own.error().text));
      }
      const physics::AirView::Subject subject{&*own};
      plume.air.push_back(
          {b, std::move(physics::AirView::build(*column, std::span(&subject, 1)).front()),
           std::vector<physics::AirView::Node>(physics::AirView::kNodes)});
    }
  }
  return {};
}

void GasModel::update(const View& view, const physics::Forcing& forcing,
                      const SceneHistory& history, const BandModel& bands,
                      const gpu::FrameParams& frame) noexcept {
  count_ = 0;
  forcing_ = forcing;
  to_sun_ = frame.to_sun;
  const glm::dvec2 tan_per_px =
      glm::dvec2(frame.ray_per_px) * glm::dvec2(frame.rendered_px) / glm::dvec2(frame.output_px);
  px_per_tan_ = 1.0 / tan_per_px;
  px_at_axis_ = -glm::dvec2(frame.ray_at_corner) / tan_per_px;
  for (Plume& plume : plumes_) add_plume(plume, view, history, bands);
  for (const auto& flare : flares_) add_flare(flare, view, history, bands);
  for (const auto& smoke : smokes_) add_smoke(smoke, view, history, bands);
  for (const auto& fire : fires_) add_fire(fire, view, history, bands);
  std::sort(puffs_.begin(), puffs_.begin() + static_cast<std::ptrdiff_t>(count_),
            [](const gpu::GasPuff& a, const gpu::GasPuff& b) { return a.range_m < b.range_m; });
}

void GasModel::add_plume(Plume& plume, const View& view, const SceneHistory& history,
                         const BandModel& bands) noexcept {
  const scene::PlumeDesc& desc = plume.source.desc;
  const auto stand = stand_of(plume.source, history, view.sim_time_ns);
  if (!stand) return;
  // Find the setting of the engine.
  double throttle = 1.0;
  if (!desc.part.empty()) {
    std::optional<double> driven;
    for (const PartHistory& part : history.parts) {
      if (!plume.source.entity || part.entity() != *plume.source.entity) continue;
      if (part.id() == plume.part_id) driven = part.throttle_frac(view.sim_time_ns);
    }
    if (!driven) return;
    throttle = *driven;
  }
  const physics::JetExit exit{
      .radius_m = desc.radius_m,
      .speed_m_s = std::lerp(desc.idle.exit_m_s, desc.full.exit_m_s, throttle),
      .kelvin = std::lerp(desc.idle.exit_k, desc.full.exit_k, throttle)};
  // Follow the jet through the air that passes the body, which carries it aside too.
  const glm::dvec3 nozzle_m =
      stand->pose.position_world_m + stand->pose.world_from_body * desc.nozzle_body_m;
  const glm::dvec3 direction = stand->pose.world_from_body * desc.direction_body;
  const physics::AirFlow flow = physics::raised_flow(physics::air_flow(forcing_), nozzle_m.z);
  const glm::dvec3 past_m_s = flow.flow_m_s - stand->velocity_m_s;
  const double along_m_s = glm::dot(past_m_s, direction);
  const glm::dvec3 aside_m_s = past_m_s - along_m_s * direction;
  const physics::JetAir air{.kelvin = flow.air_k, .along_m_s = std::max(0.0, along_m_s)};
  std::array<physics::JetNode, scene::PlumeDesc::kPuffs + 1> nodes;
  physics::jet_nodes(exit, air, kLastExhaust, nodes);
  for (GasAir& own : plume.air) own.view.at(view.sensor_height_m, {}, own.nodes);
  const double atmospheres = flow.pressure_pa / kAtmospherePa;
  double age_s = 0.0;
  for (std::size_t i = 0; i < scene::PlumeDesc::kPuffs; ++i) {
    const physics::JetNode& from = nodes[i];
    const physics::JetNode& to = nodes[i + 1];
    const double way_m = to.from_nozzle_m - from.from_nozzle_m;
    const double exhaust = std::sqrt(from.exhaust_frac * to.exhaust_frac);
    const double sigma_m = 0.5 * (from.sigma_m + to.sigma_m);
    const double speed_m_s = 0.5 * (from.speed_m_s + to.speed_m_s);
    const double half_s = 0.5 * way_m / std::max(speed_m_s, 0.1);
    age_s += half_s;
    Puff puff;
    puff.world_m =
        nozzle_m + direction * 0.5 * (from.from_nozzle_m + to.from_nozzle_m) + aside_m_s * age_s;
    age_s += half_s;
    const glm::dvec3 course_m_s = direction * speed_m_s + aside_m_s;
    puff.axis = glm::normalize(course_m_s);
    puff.along_m = kSigmaPerSpacing * way_m;
    puff.in_row = kRootTwoPi * kSigmaPerSpacing;
    puff.kelvin = physics::jet_k(exit, air, exhaust);
    // Add up absorption and emission over the cross-section, whose share of exhaust q falls off as
    // a Gaussian: an area dA is 2 pi sigma^2 dq / q.
    Light emitted{};
    double density = 0.0;
    for (const auto& [q, weight] : kGauss) {
      const double kelvin = physics::jet_k(exit, air, q * exhaust);
      density += weight * puff.kelvin / kelvin;
      for (std::size_t b = 0; b < spectra_.size(); ++b) {
        const auto mean = spectra_[b].mean_per_m_atm(kelvin);
        const double gas_per_m =
            weight * exhaust * atmospheres *
            (desc.exhaust.co2_frac * mean[0] + desc.exhaust.h2o_frac * mean[1]);
        const double grey_per_m =
            weight * exhaust * atmospheres * desc.soot_per_m * exit.kelvin / kelvin;
        puff.gas_per_m[b] += gas_per_m;
        puff.grey_per_m[b] += grey_per_m;
        emitted[b] +=
            (gas_per_m + grey_per_m) * double{bands.black_w_m2_sr(b, static_cast<float>(kelvin))};
      }
    }
    // Hot gas is thin, so that absorption reaches farther out than the share of exhaust.
    puff.across_m = sigma_m * std::sqrt(density);
    const double at_middle =
        way_m * sigma_m * sigma_m / (kRootTwoPi * puff.across_m * puff.across_m * puff.along_m);
    for (std::size_t b = 0; b < spectra_.size(); ++b) {
      const double all_per_m = puff.gas_per_m[b] + puff.grey_per_m[b];
      puff.source_w_m2_sr[b] = all_per_m > 0.0 ? emitted[b] / all_per_m : 0.0;
      puff.gas_per_m[b] *= at_middle;
      puff.grey_per_m[b] *= at_middle;
    }
    add(puff, view, bands, plume.air);
  }
}

void GasModel::add_flare(const Source<scene::FlareDesc>& flare, const View& view,
                         const SceneHistory& history, const BandModel& bands) noexcept {
  const auto stand = stand_of(flare, history, view.sim_time_ns);
  if (!stand) return;
  // Find when it appeared.
  std::int64_t lit_ns = start_ns_;
  if (flare.entity) {
    lit_ns = history.entities[*flare.entity].on_since_ns(view.sim_time_ns).value_or(start_ns_);
  }
  const scene::FlareDesc& desc = flare.desc;
  const double age_s = static_cast<double>(view.sim_time_ns - lit_ns) * 1e-9;
  const double rising = desc.rise_s > 0.0 ? age_s / desc.rise_s : 1.0;
  const double left_s = desc.rise_s + desc.burn_s + desc.fall_s - age_s;
  const double falling = desc.fall_s > 0.0 ? left_s / desc.fall_s : (left_s > 0.0 ? 1.0 : 0.0);
  const double share = std::clamp(std::min(rising, falling), 0.0, 1.0);
  if (!(share > 0.0)) return;
  Puff puff;
  puff.world_m = stand->pose.position_world_m;
  puff.across_m = puff.along_m = 0.5 * desc.radius_m;
  puff.kelvin = desc.kelvin;
  puff.flare = true;
  for (std::size_t b = 0; b < band_names_.size(); ++b) {
    const double grey_w_sr =
        desc.area_m2 * double{bands.black_w_m2_sr(b, static_cast<float>(desc.kelvin))};
    const double intensity_w_sr = in_band(desc.intensity_w_sr, band_names_[b], grey_w_sr);
    puff.source_w_m2_sr[b] =
        share * intensity_w_sr / (2.0 * std::numbers::pi * puff.across_m * puff.across_m);
  }
  add(puff, view, bands, {});
}

void GasModel::add_smoke(const Source<scene::SmokeDesc>& smoke, const View& view,
                         const SceneHistory& history, const BandModel& bands) noexcept {
  const scene::SmokeDesc& desc = smoke.desc;
  const physics::AirFlow wind = physics::air_flow(forcing_);
  const double wind_m_s = std::hypot(glm::length(wind.flow_m_s), wind.undirected_m_s);
  const glm::dvec3 drift_m_s = wind.flow_m_s + glm::dvec3(0.0, 0.0, desc.rise_m_s);
  // Smoke of an age lies where the source was then, carried on by the wind.
  const double oldest_s = static_cast<double>(view.sim_time_ns - desc.start_ns) * 1e-9;
  const double youngest_s = desc.stop_ns < view.sim_time_ns
                                ? static_cast<double>(view.sim_time_ns - desc.stop_ns) * 1e-9
                                : 0.0;
  const auto place_m = [&](double age_s) -> std::optional<glm::dvec3> {
    const auto then_ns = view.sim_time_ns - static_cast<std::int64_t>(age_s * 1e9);
    const auto stand = stand_of(smoke, history, then_ns);
    if (!stand) return std::nullopt;
    return stand->pose.position_world_m + stand->pose.world_from_body * desc.position_m +
           drift_m_s * age_s;
  };
  const double first_sigma_m = 0.5 * desc.radius_m;
  const double puff_slack_m = desc.radius_m;  // a source that turns is nearer than its way is long
  for (std::size_t i = 0; i < scene::SmokeDesc::kPuffs; ++i) {
    const auto age_at = [&](std::size_t edge) {
      return desc.lifetime_s *
             std::pow(static_cast<double>(edge) / scene::SmokeDesc::kPuffs, kAgePower);
    };
    const double from_s = std::max(age_at(i), youngest_s);
    const double to_s = std::min(age_at(i + 1), oldest_s);
    if (from_s >= to_s) continue;
    const auto middle_m = place_m(0.5 * (from_s + to_s));
    if (!middle_m) continue;
    const glm::dvec3 young_m = place_m(from_s).value_or(*middle_m);
    const glm::dvec3 old_m = place_m(to_s).value_or(*middle_m);
    const double age_s = 0.5 * (from_s + to_s);
    // A jump of the source leaves no smoke on the way.
    double length_m = glm::distance(young_m, old_m);
    if (smoke.entity) {
      const auto at_ns = [&](double edge_s) {
        return view.sim_time_ns - static_cast<std::int64_t>(edge_s * 1e9);
      };
      const double way_m = history.entities[*smoke.entity].path_m(at_ns(to_s), at_ns(from_s)) +
                           glm::length(drift_m_s) * (to_s - from_s);
      if (length_m > 2.0 * way_m + puff_slack_m) length_m = 0.0;
    }
    Puff puff;
    puff.world_m = *middle_m;
    puff.across_m = first_sigma_m + kSmokeSpread * std::max(wind_m_s, kCalmM_s) * age_s;
    puff.along_m = std::hypot(puff.across_m, kSigmaPerSpacing * length_m);
    if (length_m > 1e-6) {
      puff.axis = (young_m - old_m) / length_m;
      puff.in_row = std::min(kRootTwoPi * puff.along_m / length_m,
                             static_cast<double>(scene::SmokeDesc::kPuffs));
    }
    // Air that mixes in takes the heat of the source.
    const double air_k = physics::raised_flow(wind, puff.world_m.z).air_k;
    puff.kelvin = air_k + (desc.source_k.value_or(air_k) - air_k) *
                              std::pow(first_sigma_m / puff.across_m, 3.0);
    const double density_g_m3 =
        desc.rate_g_s * (to_s - from_s) /
        (std::pow(kRootTwoPi, 3.0) * puff.across_m * puff.across_m * puff.along_m);
    // Old smoke fades out at the end of its life, so that nothing vanishes at once.
    const double fading = std::clamp(5.0 * (1.0 - age_s / desc.lifetime_s), 0.0, 1.0);
    for (std::size_t b = 0; b < band_names_.size(); ++b) {
      const double extinction_m2_g =
          in_band(desc.band_extinction_m2_g, band_names_[b], desc.extinction_m2_g);
      const double albedo = in_band(desc.band_albedo_frac, band_names_[b], desc.albedo_frac);
      puff.grey_per_m[b] = fading * density_g_m3 * extinction_m2_g;
      // Scattered light comes alike from sky, ground and sun: once, and alike to all sides.
      const gpu::BandParams& params = bands.params()[b];
      physics::SkyByTilt sky{};
      for (std::size_t t = 0; t < physics::kSkyTilts; ++t) {
        sky[t] = params.sky_by_tilt_w_m2_sr[t / 4][static_cast<glm::length_t>(t % 4)];
      }
      const double around_w_m2_sr =
          0.5 * (physics::sky_at_tilt(sky, 1.0F) + params.surroundings_radiance_w_m2_sr) +
          params.sun_irradiance_w_m2 / (4.0 * std::numbers::pi);
      puff.source_w_m2_sr[b] =
          (1.0 - albedo) * double{bands.black_w_m2_sr(b, static_cast<float>(puff.kelvin))} +
          albedo * around_w_m2_sr;
    }
    add(puff, view, bands, {});
  }
}

void GasModel::add_fire(const Source<scene::FireDesc>& fire, const View& view,
                        const SceneHistory& history, const BandModel& bands) noexcept {
  const scene::FireDesc& desc = fire.desc;
  if (view.sim_time_ns < desc.start_ns || view.sim_time_ns >= desc.stop_ns) return;
  const auto stand = stand_of(fire, history, view.sim_time_ns);
  if (!stand) return;
  const glm::dvec3 base_m =
      stand->pose.position_world_m + stand->pose.world_from_body * desc.position_m;
  // A weak fire is a flat one: it is no lower than a quarter of its width.
  const double height_m = std::max(physics::flame_height_m(desc.heat_release_w, desc.diameter_m),
                                   0.25 * desc.diameter_m);
  constexpr auto kPuffs = static_cast<double>(scene::FireDesc::kPuffs);
  const double spacing_m = height_m / kPuffs;
  for (std::size_t i = 0; i < scene::FireDesc::kPuffs; ++i) {
    const double up_frac = (static_cast<double>(i) + 0.5) / kPuffs;
    Puff puff;
    puff.world_m = base_m + glm::dvec3(0.0, 0.0, up_frac * height_m);
    puff.across_m = 0.25 * desc.diameter_m * (1.0 - 0.7 * up_frac);
    puff.along_m = kSigmaPerSpacing * spacing_m;
    puff.in_row = kRootTwoPi * kSigmaPerSpacing;
    puff.kelvin = desc.kelvin;
    for (std::size_t b = 0; b < band_names_.size(); ++b) {
      puff.grey_per_m[b] = desc.absorption_per_m / (kRootTwoPi * kSigmaPerSpacing);
      puff.source_w_m2_sr[b] = bands.black_w_m2_sr(b, static_cast<float>(desc.kelvin));
    }
    add(puff, view, bands, {});
  }
}

void GasModel::add(const Puff& puff, const View& view, const BandModel& bands,
                   std::span<const GasAir> air) noexcept {
  EMIT_DCHECK_OP(count_, <, puffs_.size());
  const glm::dvec3 from_camera_m = puff.world_m - view.camera_world_m;
  const glm::dvec3 centre_m = glm::transpose(view.world_from_sensor) * from_camera_m;
  const glm::dvec3 axis = glm::transpose(view.world_from_sensor) * puff.axis;
  const double range_m = glm::length(centre_m);
  const double widest_m = std::max(puff.across_m, puff.along_m);
  if (centre_m.z < -5.0 * widest_m || count_ == puffs_.size()) return;
  gpu::GasPuff& out = puffs_[count_++];
  out = {};
  out.range_m = static_cast<float>(range_m);
  out.centre_m = glm::vec3(centre_m);
  out.axis = glm::vec3(axis);
  const double across_m2 = puff.across_m * puff.across_m;
  const double along_m2 = puff.along_m * puff.along_m;
  out.per_across_m2 = static_cast<float>(1.0 / across_m2);
  out.per_along_axis_m2 = static_cast<float>(1.0 / along_m2);
  const glm::dvec3 to_centre = range_m > 0.0 ? centre_m / range_m : glm::dvec3(0.0, 0.0, 1.0);
  const double cosine = glm::dot(to_centre, axis);
  const double sine = glm::length(glm::cross(to_centre, axis));
  const double line_m = 1.0 / std::sqrt(sine * sine / across_m2 + cosine * cosine / along_m2);
  out.per_along_m = static_cast<float>(1.0 / line_m);
  // Give a small or distant puff the Gaussian image of its density.
  std::array<double, 2> narrow_frac{1.0, 1.0};
  unsigned kind = puff.flare ? EMIT_GAS_FLARE : 0U;
  if (centre_m.z > 0.0 && widest_m < kSmallSigmaRad * centre_m.z) {
    const glm::dvec2 tan(centre_m.x / centre_m.z, centre_m.y / centre_m.z);
    const glm::dvec2 scale = px_per_tan_ / centre_m.z;
    const glm::dvec2 v = scale * (glm::dvec2(axis.x, axis.y) - tan * axis.z);
    const double stretched_m2 = along_m2 - across_m2;
    glm::dvec3 covariance(
        across_m2 * scale.x * scale.x * (1.0 + tan.x * tan.x) + stretched_m2 * v.x * v.x,
        across_m2 * scale.x * scale.y * tan.x * tan.y + stretched_m2 * v.x * v.y,
        across_m2 * scale.y * scale.y * (1.0 + tan.y * tan.y) + stretched_m2 * v.y * v.y);
    ImageAxes axes(covariance);
    if (std::sqrt(axes.variance_px2[1]) < kSmallSigmaPx) {
      kind |= EMIT_GAS_SMALL;
      out.centre_px = glm::vec2(tan * px_per_tan_ + px_at_axis_);
      // Widen an image that the samples of a pixel would miss, or that is so narrow for its length
      // that float32 could not tell it from a line.
      const double finest_px = std::max(double{kGasSampleSigmas} / kMostGasSamples,
                                        kNarrowest * std::sqrt(axes.variance_px2[0]));
      for (std::size_t a = 0; a < 2; ++a) {
        const double sigma_px = std::sqrt(axes.variance_px2[a]);
        if (sigma_px >= finest_px) continue;
        narrow_frac[a] = sigma_px / finest_px;
        axes.variance_px2[a] = finest_px * finest_px;
      }
      covariance = axes.covariance_px2();
      out.covariance_px2 = glm::vec3(covariance);
    }
  }
  // See the puff through the air, and its optical depth by spectral term.
  const LineOpacity& opacity = line_opacity();
  const BandModel::Sight sight{
      .range_m = static_cast<float>(range_m),
      .sin_elevation = static_cast<float>(range_m > 0.0 ? from_camera_m.z / range_m : 0.0),
      .sensor_height_m = static_cast<float>(view.sensor_height_m),
      .ray_sun_cosine = static_cast<float>(
          range_m > 0.0 ? glm::dot(from_camera_m, glm::dvec3(to_sun_)) / range_m : 0.0)};
  const auto kelvin = static_cast<float>(puff.kelvin);
  double deepest = 0.0;
  for (std::size_t b = 0; b < band_names_.size(); ++b) {
    const auto k = static_cast<glm::length_t>(b);
    const BandModel::AirWay way = bands.air_way(b, sight, kelvin);
    // The air leaves a smaller share of what hot gas sends than of a blackbody, because cold gas of
    // the same kind absorbs it. It leaves as small a share of what that gas takes from behind.
    out.air_share_frac[k] = 1.0F;
    for (const GasAir& own : air) {
      if (own.band != b || !(way.air_frac > 0.0)) continue;
      const double air_alone_frac = way.air_frac / way.fog_frac;
      out.air_share_frac[k] = static_cast<float>(
          std::min(1.0, air_transmittance(own.nodes, sight, kelvin) / air_alone_frac));
    }
    out.source_w_m2_sr[k] = static_cast<float>(
        puff.flare
            ? narrow_frac[0] * narrow_frac[1] * puff.source_w_m2_sr[b] * way.air_frac
            : puff.source_w_m2_sr[b] * way.air_frac + way.path_w_m2_sr + way.scattered_w_m2_sr);
    for (std::size_t t = 0; t < physics::kGasTerms; ++t) {
      double depth =
          kRootTwoPi * line_m * (puff.gas_per_m[b] * spectra_[b].depth()[t] + puff.grey_per_m[b]);
      for (const double frac : narrow_frac) {
        // The neighbours in the row lie over the puff and make its line opaque with it.
        if (frac < 1.0) {
          depth = opacity.widened_depth(puff.in_row * depth, frac) / puff.in_row;
        }
      }
      out.depth[b][static_cast<glm::length_t>(t)] = static_cast<float>(depth);
      deepest = std::max(deepest, puff.in_row * depth);
    }
  }
  // A flare adds light, and thin gas nearly so: its mean over a pixel needs no samples of the tile.
  if ((kind & EMIT_GAS_SMALL) != 0 && deepest < kThin) {
    const float sigma_px = gas_least_sigma_px(out.covariance_px2);
    const auto parts = static_cast<unsigned>(std::ceil(kThinSampleSigmas / sigma_px));
    kind |= std::clamp(parts, 1U, kMostGasSamples) << EMIT_GAS_SAMPLES_SHIFT;
  }
  out.kind = static_cast<float>(kind);
}

GasModel::Seen GasModel::seen(const gpu::GasImage& image, const glm::uvec2& px, float boresight_m,
                              std::uint32_t samples) const noexcept {
  Seen out;
  out.through_frac.fill(samples == 0 ? 1.0 : 0.0);
  const glm::vec2 tan = (glm::vec2(px) + 0.5F) * image.ray_per_px + image.ray_at_corner;
  const float surface_m = std::min(boresight_m, EMIT_GAS_FAR_M) * glm::length(glm::vec3(tan, 1.0F));
  const glm::vec2 side_px = image.side_px / static_cast<float>(samples);
  const double share = 1.0 / (double{1} * samples * samples);
  for (std::uint32_t s = 0; s < samples * samples; ++s) {
    const glm::vec2 in_px =
        (glm::vec2(s % samples, s / samples) + 0.5F) / static_cast<float>(samples) - 0.5F;
    const glm::vec2 sample_tan = tan + in_px * image.ray_per_px;
    const glm::vec2 place_px = sample_tan * image.px_per_tan + image.px_at_axis;
    const glm::vec3 ray = glm::normalize(glm::vec3(sample_tan, 1.0F));
    std::array<glm::vec4, EMIT_MAX_BANDS> through;
    std::array<glm::vec4, EMIT_MAX_BANDS> taken{};
    std::array<glm::vec4, EMIT_MAX_BANDS> added{};
    through.fill(glm::vec4(1.0F));
    for (const gpu::GasPuff& puff : puffs()) {
      const auto kind = static_cast<unsigned>(puff.kind);
      float column = 0.0F;
      if ((kind & EMIT_GAS_SMALL) != 0) {
        const auto parts = std::max(kind >> EMIT_GAS_SAMPLES_SHIFT, 1U);
        const glm::vec2 part_px = side_px / static_cast<float>(parts);
        const glm::vec2 first = place_px - puff.centre_px - 0.5F * (side_px - part_px);
        for (unsigned i = 0; i < parts * parts; ++i) {
          column += physics::gas_image_column(first + glm::vec2(i % parts, i / parts) * part_px,
                                              puff.covariance_px2, part_px);
        }
        column *=
            1.0F / static_cast<float>(parts * parts) *
            physics::gas_before(puff.range_m * puff.per_along_m, surface_m * puff.per_along_m);
      } else {
        const physics::GasLine line = physics::gas_line(ray, puff.centre_m, puff.per_across_m2,
                                                        puff.axis, puff.per_along_axis_m2);
        column = std::exp(-0.5F * line.square) * line.sigma_m * puff.per_along_m *
                 physics::gas_before(line.place_m / line.sigma_m, surface_m / line.sigma_m);
      }
      for (std::size_t b = 0; b < band_names_.size(); ++b) {
        const glm::vec4 passed = glm::exp(-column * puff.depth[b]);
        const glm::vec4 emitted = (kind & EMIT_GAS_FLARE) != 0 ? glm::vec4(column) : 1.0F - passed;
        const auto k = static_cast<glm::length_t>(b);
        const glm::vec4 counted = through[b] * puff.air_share_frac[k];
        added[b] += counted * emitted * puff.source_w_m2_sr[k];
        taken[b] += counted * (1.0F - passed);
        through[b] *= passed;
      }
    }
    for (std::size_t b = 0; b < band_names_.size(); ++b) {
      out.through_frac[b] += share * (1.0 - double{glm::dot(term_frac_[b], taken[b])});
      out.added_w_m2_sr[b] += share * double{glm::dot(term_frac_[b], added[b])};
    }
  }
  return out;
}

}  // namespace emit::renderer
