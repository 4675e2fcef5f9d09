// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/carry_on.hpp"

#include <algorithm>
#include <utility>

#include "emit/threads/parallel.hpp"
#include "surface/warm_up/sun_tracer.hpp"
#include "surface/warm_up/surface_exchange.hpp"

namespace emit::renderer {
namespace {

/// Samples in one task of a parallel loop.
constexpr std::size_t kGrain = 64;
/// Share of tracing in the whole work, for the progress.
constexpr double kTraceFrac = 0.7;

/// First guess of the radiation that samples send: at all times what they send at the begin.
SentHistory sent_as_before(const SurfaceModel& model, std::size_t intervals) {
  SentHistory sent(intervals);
  sent.resize(model.outputs.size());
  threads::parallel_parts(model.outputs.size(), kGrain, [&](std::size_t from, std::size_t to) {
    for (std::size_t s = from; s < to; ++s) {
      sent.keep_begin(s, model.outputs[s]);
      for (std::size_t j = 0; j < intervals; ++j) sent.keep_end(s, j, model.outputs[s]);
    }
  });
  return sent;
}

}  // namespace

physics::Result<void> carry_on(const SurfaceInputs& inputs, const SurfaceModelOptions& options,
                               SurfaceModel& model, const SurfaceProgress& progress) {
  const auto stopped = [] {
    return physics::make_error(physics::ErrorCode::internal,
                               "stopped while carrying the surface on");
  };
  // Start from the states of the model.
  const std::size_t count = model.samples.samples.size();
  const std::size_t intervals = inputs.record.size();
  SampleHistories histories;
  histories.start = std::move(model.states);
  model.states.resize(count);
  histories.sun_frac.resize(count * intervals);
  if (!inputs.movers_now.empty()) histories.hidden_sky.resize(count * intervals);

  // Trace the sun from the places of the samples, in slices, so that a stop is noticed soon.
  const SunTracer tracer(inputs, options);
  constexpr std::size_t kSlice = 16384;
  for (std::size_t first = 0; first < count; first += kSlice) {
    const std::size_t end = std::min(count, first + kSlice);
    threads::parallel_parts(end - first, kGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t s = first + from; s < first + to; ++s) {
        const auto of_sample = [&](auto& values) {
          return std::span(values).subspan(values.empty() ? 0 : s * intervals,
                                           values.empty() ? 0 : intervals);
        };
        tracer.trace(model.samples.samples[s], of_sample(histories.sun_frac),
                     of_sample(histories.hidden_sky));
      }
    });
    const double done = static_cast<double>(end) / static_cast<double>(count);
    if (progress && !progress(kTraceFrac * done)) return stopped();
  }

  // Integrate. The first guess here knows less than that of the builder, so one more sweep is
  // needed.
  const bool exchanges = options.exchange || options.lateral;
  if (exchanges) histories.sent = sent_as_before(model, intervals);
  const ExchangeOptions how{
      .sweeps = exchanges ? kExchangeSweeps + 1 : 1, .evaluated = false, .glow = options.exchange};
  const auto report = [&](double frac) {
    return !progress || progress(kTraceFrac + (1.0 - kTraceFrac) * frac);
  };
  if (!exchange(inputs, how, std::move(histories), model, report)) return stopped();
  return {};
}

}  // namespace emit::renderer
