// SPDX-License-Identifier: Apache-2.0
#include "console/console_state.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <string_view>

#include "console/console_message.hpp"
#include "emit/image/false_color.hpp"
#include "emit/image/temperature_table.hpp"
#include "emit/physics/constants.hpp"
#include "rt/client_counts.hpp"

namespace emit::server {
namespace {

using Out = std::back_insert_iterator<std::string>;

bool has_radiance(const Channel& channel) noexcept {
  return channel.quantity == protocol::PixelQuantity::radiance_w_m2_sr;
}

physics::Band band_of(const Channel& channel) {
  physics::Band band{channel.band_lo_um, channel.band_hi_um, {}};
  for (const scene::ResponseSample& sample : channel.response) {
    band.response.push_back({sample.wavelength_um, sample.response_frac});
  }
  return band;
}

/// Appends the elements of a range, with commas between them.
template <class Range, class Write>
void list(std::string& text, const Range& range, Write write) {
  text += '[';
  bool first = true;
  for (const auto& element : range) {
    if (!first) text += ',';
    first = false;
    write(element);
  }
  text += ']';
}

void add_colors(std::string& text, image::ColorMap map) {
  text += '"';
  for (const image::Rgb& color : image::color_table(map)) {
    fmt::format_to(Out(text), "{:02x}{:02x}{:02x}", color[0], color[1], color[2]);
  }
  text += '"';
}

/// Name and unit of what the pixels of a channel hold, for the page.
struct QuantityText {
  std::string_view name;
  std::string_view unit;
};
QuantityText quantity_text(protocol::PixelQuantity quantity) noexcept {
  switch (quantity) {
    case protocol::PixelQuantity::radiance_w_m2_sr:
      return {"radiance", "W m\u207b\u00b2 sr\u207b\u00b9"};
    case protocol::PixelQuantity::temperature_k:
      return {"apparent temperature", "K"};
    case protocol::PixelQuantity::drive:
      return {"drive", "drive"};
    case protocol::PixelQuantity::counts:
      return {"counts", "counts"};
    case protocol::PixelQuantity::photon_radiance:
      return {"photon radiance", "s\u207b\u00b9 m\u207b\u00b2 sr\u207b\u00b9"};
  }
  return {"values", ""};
}

void add_channel(std::string& text, const Channel& channel) {
  const QuantityText quantity = quantity_text(channel.quantity);
  const bool radiance = has_radiance(channel);
  fmt::format_to(
      Out(text),
      R"({{"index":{},"name":{},"kind":"{}","sensor":{},"band":{},"lo_um":{},"hi_um":{},)"
      R"("width_px":{},"height_px":{},"every_nth":{},"radiance":{},"temperature":{},)"
      R"("quantity":"{}","unit":"{}"}})",
      channel.index, json_string(channel.name), to_string(channel.kind),
      json_string(channel.sensor), json_string(channel.band), channel.band_lo_um,
      channel.band_hi_um, channel.width_px, channel.height_px, channel.every_nth, radiance,
      radiance && physics::validate(band_of(channel)).has_value(), quantity.name, quantity.unit);
}

double us_between(std::int64_t from_ns, std::int64_t to_ns) noexcept {
  return static_cast<double>(to_ns - from_ns) / 1e3;
}

/// Appends [frame number, flags, age in ms, frame time, its deadline, latency, its deadline], the
/// last four in us. null: not known.
void add_tick(std::string& text, const FrameTick& tick, std::int64_t now_ns) {
  const std::int64_t origin_ns =
      tick.slot_begin_ns != 0 ? tick.slot_begin_ns : tick.host_received_ns;
  const auto add = [&](std::int64_t from_ns, std::int64_t to_ns) {
    if (from_ns == 0 || to_ns == 0) {
      text += ",null";
    } else {
      fmt::format_to(Out(text), ",{:.1f}", us_between(from_ns, to_ns));
    }
  };
  fmt::format_to(Out(text), "[{},{},{:.1f}", tick.frame_number, tick.flags,
                 us_between(tick.published_ns, now_ns) / 1e3);
  add(tick.render_start_ns, tick.readback_end_ns);
  add(tick.render_start_ns, tick.deadline_ns);
  add(origin_ns, tick.published_ns);
  add(origin_ns, tick.deadline_ns);
  text += ']';
}

void add_clients(std::string& text, const Context& context, const StatusBoard& board) {
  list(text, board.clients(), [&](const auto& entry) {
    const auto& [key, client] = entry;
    fmt::format_to(Out(text), R"({{"peer":{},"role":{},"software":{},"channel":{},"transport":{})",
                   json_string(client.peer), json_string(client.role), json_string(client.software),
                   json_string(client.channel), json_string(client.transport));
    const ClientCounts* counts = context.counts_of(key);
    if (counts != nullptr && counts->connection.load(std::memory_order_acquire) == key) {
      fmt::format_to(Out(text), R"(,"frames":{},"skipped":{},"delay_us":{:.1f},"jitter_us":{:.1f})",
                     counts->frames.load(std::memory_order_relaxed),
                     counts->skipped.load(std::memory_order_relaxed),
                     us_between(0, counts->delay_ns.load(std::memory_order_relaxed)),
                     us_between(0, counts->jitter_ns.load(std::memory_order_relaxed)));
    }
    text += '}';
  });
}

void add_warnings(std::string& text, const Context& context, const StatusBoard& board) {
  auto warnings = board.warnings();
  std::ranges::sort(warnings, std::greater(),
                    [](const StatusBoard::Warning& warning) { return warning.entry.last_ns; });
  constexpr std::size_t kMost = 24;
  warnings.resize(std::min(warnings.size(), kMost));
  const std::int64_t now_ns = context.clock.tai_ns();
  list(text, warnings, [&](const StatusBoard::Warning& warning) {
    fmt::format_to(Out(text), R"({{"level":"{}","text":{},"count":{},"age_s":{:.1f}}})",
                   warning.level == LogLevel::error ? "error" : "warn", json_string(warning.text),
                   warning.entry.count, us_between(warning.entry.last_ns, now_ns) / 1e6);
  });
}

void add_axes(std::string& text, Context& context) {
  const AxesBoard& axes = context.axes;
  const std::size_t count = axes.count.load(std::memory_order_relaxed);
  const std::int64_t measured_ns = axes.measured_ns.load(std::memory_order_relaxed);
  fmt::format_to(Out(text), R"({{"state":{},"faults":{},"age_us":)",
                 axes.state.load(std::memory_order_relaxed),
                 axes.faults.load(std::memory_order_relaxed));
  if (measured_ns == 0) {
    text += "null";
  } else {
    fmt::format_to(Out(text), "{:.1f}", us_between(measured_ns, context.clock.tai_ns()));
  }
  const auto add = [&](std::string_view name, const auto& angles) {
    fmt::format_to(Out(text), ",\"{}\":", name);
    list(text, std::span(angles).first(count), [&](const std::atomic<double>& angle_rad) {
      fmt::format_to(Out(text), "{:.6f}",
                     angle_rad.load(std::memory_order_relaxed) / physics::kDegree);
    });
  };
  add("measured_deg", axes.measured_rad);
  add("commanded_deg", axes.commanded_rad);
  text += ",\"ticks\":[";
  while (const AxesTick* tick = context.axes_ticks.front()) {
    if (text.back() != '[') text += ',';
    fmt::format_to(Out(text), "[{:.2f},", us_between(tick->time_ns, context.clock.tai_ns()) / 1e3);
    const auto degrees = [&](double angle_rad) {
      fmt::format_to(Out(text), "{:.7f}", angle_rad / physics::kDegree);
    };
    list(text, std::span(tick->measured_rad).first(tick->count), degrees);
    text += ',';
    list(text, std::span(tick->demanded_rad).first(tick->driven ? tick->count : 0), degrees);
    text += ']';
    context.axes_ticks.pop();
  }
  text += "]}";
}

/// Appends what a host wants people to see; null: it wants nothing.
void add_picture(std::string& text, const PictureBoard& board) {
  const auto picture = board.get();
  if (!picture) {
    text += "null";
    return;
  }
  fmt::format_to(
      Out(text), R"({{"on":{},"black_hot":{},"automatic_gain":{},"low_k":{:.4f},"high_k":{:.4f}}})",
      picture->on, picture->black_hot, picture->automatic_gain, picture->low_k, picture->high_k);
}

}  // namespace

std::string console_hello(const ConsoleFacts& facts, const Context& context, bool may_command) {
  std::string text;
  fmt::format_to(
      Out(text),
      R"({{"type":"hello","software":{},"scenario":{},"pacing":{},"device":{},"rate_hz":{},)"
      R"("budget_ns":{},"image_rate_hz":{},"motion":{},"may_command":{},)"
      R"("table_from_k":{},"table_step_k":{},"nan_color":"{:02x}{:02x}{:02x}")",
      json_string(facts.software), json_string(facts.scenario), json_string(facts.pacing),
      json_string(facts.device), facts.rate_hz, facts.budget_ns, facts.image_rate_hz, facts.motion,
      may_command, image::TemperatureTable::kFromK, image::TemperatureTable::kStepK,
      image::kNanColor[0], image::kNanColor[1], image::kNanColor[2]);
  fmt::format_to(Out(text), R"(,"no_explanation":{},"recording":{})",
                 json_string(facts.no_explanation),
                 facts.recording.empty() ? std::string_view("null") : facts.recording);
  text += ",\"colors\":{\"thermal\":";
  add_colors(text, image::ColorMap::thermal);
  text += ",\"grey\":";
  add_colors(text, image::ColorMap::grey);
  text += "},\"channels\":";
  list(text, context.channels, [&](const Channel& channel) { add_channel(text, channel); });
  text += ",\"flags\":";
  list(text, protocol::kFrameFlagNames, [&](std::string_view name) { text += json_string(name); });
  text += ",\"counters\":";
  list(text, kCounterLabels, [&](const CounterLabel& label) {
    fmt::format_to(Out(text), "[\"{}\",{}]", label.name, json_string(label.label));
  });
  text += '}';
  return text;
}

std::string console_status(Context& context, ConsoleTap& tap, const StatusBoard& board,
                           const NamedDutyCycles& agents, const ConsoleMoment& moment) {
  std::string text;
  fmt::format_to(Out(text),
                 R"({{"type":"status","tai_ms":{},"run_id":"{}","ready":{},"running":{},)"
                 R"("held":{},"uptime_s":{:.1f},"pages":{},"journal_bytes":{})",
                 context.clock.tai_ns() / 1'000'000, context.run_id.load(std::memory_order_relaxed),
                 moment.ready, context.run.running.load(std::memory_order_relaxed),
                 context.run.held.load(std::memory_order_relaxed),
                 static_cast<double>(moment.uptime_ns) / 1e9, moment.pages,
                 context.journal_memory_bytes.load(std::memory_order_relaxed));
  text += ",\"counters\":{";
  for (std::size_t i = 0; i < kCounterCount; ++i) {
    if (const std::uint64_t value = context.counters.get(static_cast<Counter>(i)); value > 0) {
      fmt::format_to(Out(text), "{}\"{}\":{}", text.back() == '{' ? "" : ",",
                     kCounterLabels[i].name, value);
    }
  }
  text += "},\"clients\":";
  add_clients(text, context, board);
  text += ",\"warnings\":";
  add_warnings(text, context, board);
  text += ",\"agents\":";
  list(text, agents, [&](const auto& agent) {
    fmt::format_to(Out(text), R"({{"name":{},"max_us":{:.1f},"over":{},"busy_s":{:.3f}}})",
                   json_string(agent.first), us_between(0, agent.second->max_ns()),
                   agent.second->over_threshold(), us_between(0, agent.second->busy_ns()) / 1e6);
  });
  fmt::format_to(Out(text), R"(,"replay":{})",
                 moment.replay.empty() ? std::string_view("null") : moment.replay);
  text += ",\"axes\":";
  add_axes(text, context);
  text += ",\"picture\":";
  add_picture(text, context.picture);
  text += ",\"ticks\":[";
  while (const FrameTick* tick = tap.ticks().front()) {
    if (text.back() != '[') text += ',';
    add_tick(text, *tick, context.clock.tai_ns());
    tap.ticks().pop();
  }
  text += "]}";
  return text;
}

std::string console_temperatures(const Channel& channel) {
  const physics::Band band = band_of(channel);
  if (!has_radiance(channel) || !physics::validate(band)) {
    return {};
  }
  const image::TemperatureTable table(band);
  const auto bytes = std::as_bytes(table.radiances_w_m2_sr());
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace emit::server
