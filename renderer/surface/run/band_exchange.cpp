// SPDX-License-Identifier: Apache-2.0
#include "surface/run/band_exchange.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "surface/heat/view_of_now.hpp"
#include "surface/run/surface_step.hpp"

namespace emit::renderer {
namespace {

/// Largest change of a pass that counts as none, as a share of the surroundings' radiance.
constexpr float kSettledFrac = 1e-5F;
/// Largest number of passes of settle(). Between mirrors of emissivity 0.1 each pass takes a tenth
/// of the rest away.
constexpr int kMostPasses = 100;

EntityStand stand_of(const IntervalRays& rays, const SurfaceSample& sample) noexcept {
  return sample.entity >= 0 ? rays.stand(static_cast<std::size_t>(sample.entity)) : EntityStand{};
}

}  // namespace

BandExchange::BandExchange(const SurfaceSamples& all, const BandLights* lights) {
  if (lights == nullptr || all.seen.empty()) return;
  lights_ = lights;
  bands_ = lights->bands();
  count_ = all.samples.size();
  light_.resize(bands_);
  sent_.assign(count_ * bands_, 0.0F);
}

void BandExchange::begin(const SurfaceNode& to, const WorldInputs& inputs) noexcept {
  worked_ = 0;
  if (count_ == 0) return;
  const physics::SunPosition sun = inputs.environment.sun_at(to.at_ns);
  physics::Forcing forcing = inputs.environment.forcing_at(to.at_ns, sun);
  forcing.environment_k = to.surroundings_k.value_or(forcing.environment_k);
  lights_->light_at(forcing, sun, light_);
  to_sun_ = glm::vec3(sun.direction_enu);
}

void BandExchange::work(std::size_t units, const SurfaceSamples& all, const IntervalRays& rays,
                        const SurfaceNode& from, SurfaceNode& to,
                        threads::WorkerPool& workers) noexcept {
  EMIT_DCHECK_OP(units, <=, this->units());
  // Finish what all samples send before any of them receives.
  if (worked_ < count_) {
    const std::size_t end = std::min(units, count_);
    workers.run(end - worked_, kSamplesPerTask, [&](std::size_t begin, std::size_t task_end) {
      for (std::size_t i = worked_ + begin; i < worked_ + task_end; ++i) {
        send(all, rays, from, to, static_cast<std::uint32_t>(i));
      }
    });
    worked_ = end;
  }
  if (units <= worked_) return;
  const std::size_t first = worked_ - count_;
  const std::size_t end = units - count_;
  workers.run(end - first, kSamplesPerTask, [&](std::size_t begin, std::size_t task_end) {
    for (std::size_t i = first + begin; i < first + task_end; ++i) {
      receive(all, rays, to, static_cast<std::uint32_t>(i));
    }
  });
  worked_ = units;
  const std::size_t drawn = to.drawn;
  to.seen_changes.add(static_cast<std::uint32_t>(std::min(first, drawn)),
                      static_cast<std::uint32_t>(std::min(end, drawn) - std::min(first, drawn)));
}

void BandExchange::settle(const SurfaceSamples& all, const IntervalRays& rays,
                          const WorldInputs& inputs, SurfaceNode& node,
                          threads::WorkerPool& workers) {
  if (count_ == 0) return;
  std::vector<float> before;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    before = node.seen_w_m2_sr;
    begin(node, inputs);
    work(units(), all, rays, node, node, workers);
    const bool settled =
        std::ranges::all_of(light_, [&, band = std::size_t{0}](const BandLight& light) mutable {
          const float limit = kSettledFrac * light.surroundings_w_m2_sr;
          bool quiet = true;
          for (std::size_t i = band; i < before.size(); i += bands_) {
            quiet = quiet && std::abs(node.seen_w_m2_sr[i] - before[i]) <= limit;
          }
          ++band;
          return quiet;
        });
    if (settled) return;
  }
}

void BandExchange::send(const SurfaceSamples& all, const IntervalRays& rays,
                        const SurfaceNode& from, const SurfaceNode& to,
                        std::uint32_t index) noexcept {
  const SurfaceSample& sample = all.samples[index];
  const SampleOutput& output = to.outputs[index];
  const glm::vec3 normal = rays.normal(sample);
  const float sky_frac = view_of_now(all, sample, stand_of(rays, sample)).sky_frac;
  const float facing_frac = output.sun_frac * std::max(0.0F, glm::dot(normal, to_sun_));
  const float kelvin = static_cast<float>(physics::kReferenceK) + output.offset_k;
  for (std::size_t b = 0; b < bands_; ++b) {
    const BandLight& light = light_[b];
    const float around = light.surroundings_w_m2_sr;
    const float emissivity_frac = lights_->emissivity_frac(sample.material, b);
    const float sky = physics::sky_at_tilt(light.sky_w_m2_sr, static_cast<double>(normal.z));
    const float incoming = around + sky_frac * (sky - around) +
                           from.seen_w_m2_sr[index * bands_ + b] +
                           light.sun_w_m2 / static_cast<float>(physics::kPi) * facing_frac;
    sent_[index * bands_ + b] = emissivity_frac * lights_->black_w_m2_sr(b, kelvin) +
                                (1.0F - emissivity_frac) * incoming - around;
  }
}

void BandExchange::receive(const SurfaceSamples& all, const IntervalRays& rays, SurfaceNode& to,
                           std::uint32_t index) const noexcept {
  const SurfaceSample& sample = all.samples[index];
  const ViewOfNow view = view_of_now(all, sample, stand_of(rays, sample));
  float* const sum = &to.seen_w_m2_sr[index * bands_];
  std::fill_n(sum, bands_, 0.0F);
  for (std::uint32_t k = 0; k < sample.seen_count; ++k) {
    const SeenSample& seen = all.seen[sample.first_seen + k];
    const SurfaceSample& other = all.samples[seen.sample];
    float weight_frac =
        seen.weight_frac * (other.entity == sample.entity ? view.own_scale : view.others_scale);
    // Surroundings take the place of an entity that has left.
    if (other.entity >= 0 && other.entity != sample.entity) {
      weight_frac *= 1.0F - stand_of(rays, other).moved_frac;
    }
    for (std::size_t b = 0; b < bands_; ++b) {
      sum[b] += weight_frac * sent_[seen.sample * bands_ + b];
    }
  }
}

}  // namespace emit::renderer
