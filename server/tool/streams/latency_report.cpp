// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/latency_report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "tool/support/console.hpp"

namespace emit::tool {

void LatencyReport::add(const protocol::FrameHeader& header, std::int64_t sent_ns,
                        std::int64_t last_byte_ns) {
  const auto add = [&](Stage stage, std::int64_t from_ns, std::int64_t to_ns) {
    stages_[stage].add(static_cast<double>(to_ns - from_ns) * 1e-3);
  };
  const std::int64_t received_ns = header.host_received_ns;
  add(kInbound, sent_ns, received_ns);
  std::int64_t begin_ns = received_ns;
  if (header.slot_begin_ns != 0) {
    // A pose may arrive in the instants between the slot's begin and the render's.
    begin_ns = std::max(begin_ns, header.slot_begin_ns);
    add(kSampling, received_ns, begin_ns);
  }
  add(kWait, begin_ns, header.render_start_ns);
  add(kRender, header.render_start_ns, header.render_end_ns);
  add(kReadback, header.render_end_ns, header.readback_end_ns);
  add(kHandOver, header.readback_end_ns, header.send_start_ns);
  add(kTransport, header.send_start_ns, last_byte_ns);
  add(kTotal, sent_ns, last_byte_ns);
}

Json LatencyReport::figures(const Samples& samples_us) {
  Json json = Json::object();
  const auto figure = [&](double value) { return samples_us.empty() ? Json() : Json(value); };
  json.set("p50_us", figure(samples_us.percentile(0.5)));
  json.set("p99_us", figure(samples_us.percentile(0.99)));
  json.set("p999_us", figure(samples_us.percentile(0.999)));
  json.set("max_us", figure(samples_us.empty() ? 0.0 : samples_us.max()));
  json.set("mean_us", figure(samples_us.empty() ? 0.0 : samples_us.mean()));
  return json;
}

Json LatencyReport::stages_json() const {
  Json list = Json::array();
  for (std::size_t i = 0; i < kStages; ++i) {
    if (stages_[i].empty()) continue;
    Json json = Json::object();
    json.set("stage", kKeys[i]).merge(figures(stages_[i]));
    list.push(std::move(json));
  }
  return list;
}

std::string LatencyReport::table() const {
  TextTable table({"stage, us", "frames", "p50", "p99", "p99.9", "max"});
  for (std::size_t i = 0; i < kStages; ++i) {
    const Samples& samples = stages_[i];
    if (samples.empty()) continue;
    const auto text = [](double value) { return fmt::format("{:.0f}", value); };
    table.add({kNames[i], fmt::format("{}", samples.count()), text(samples.percentile(0.5)),
               text(samples.percentile(0.99)), text(samples.percentile(0.999)),
               text(samples.max())});
  }
  return table.to_string();
}

}  // namespace emit::tool
