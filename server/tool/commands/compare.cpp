// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "emit/image/image_diff.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/json.hpp"

namespace emit::tool {
namespace {

struct CompareOptions {
  std::filesystem::path a;
  std::filesystem::path b;
  std::optional<double> max_error_k;
  std::optional<std::filesystem::path> json;
};

Json stats_json(const image::DiffStats& stats) {
  Json json = Json::object();
  json.set("pixels_compared", stats.pixels_compared).set("one_sided_nan", stats.one_sided_nan);
  json.set("max", stats.max_abs).set("rms", stats.rms).set("mean", stats.mean);
  json.set("p50", stats.p50).set("p95", stats.p95).set("p99", stats.p99).set("p999", stats.p999);
  json.set("max_x_px", stats.max_x_px).set("max_y_px", stats.max_y_px);
  return json;
}

void add_row(TextTable& table, const std::string& name, const std::string& unit,
             const image::DiffStats& stats) {
  table.add({name, unit, fmt::format("{:.6g}", stats.max_abs), fmt::format("{:.6g}", stats.rms),
             fmt::format("{:.6g}", stats.mean), fmt::format("{:.6g}", stats.p50),
             fmt::format("{:.6g}", stats.p95), fmt::format("{:.6g}", stats.p99),
             fmt::format("{}", stats.pixels_compared), fmt::format("{}", stats.one_sided_nan)});
}

std::string list(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

Json names_json(const std::vector<std::string>& names) {
  Json json = Json::array();
  for (const auto& name : names) json.push(name);
  return json;
}

/// Errors: those of read_exr(); invalid_argument where the image has no radiance, as every frame of
/// emit has.
physics::Result<image::ExrImage> read_frame(const std::filesystem::path& file) {
  auto exr = image::read_exr(file);
  if (!exr) return exr;
  std::vector<std::string> names;
  for (const image::ExrChannel& channel : exr->channels) {
    if (channel.name.starts_with(image::kRadianceChannel)) return exr;
    names.push_back(channel.name);
  }
  return physics::make_error(
      physics::ErrorCode::invalid_argument,
      fmt::format("{}: there is no channel '{}', so that it is no frame of emit; the file has {}",
                  file.string(), image::kRadianceChannel,
                  names.empty() ? "no channel" : list(names)));
}

int run(const CompareOptions& command) {
  const auto a = read_frame(command.a);
  if (!a) return fail(a.error());
  const auto b = read_frame(command.b);
  if (!b) return fail(b.error());

  // Radiance in kelvin needs the band, which the reference names in its attributes.
  image::KelvinPerRadiance conversion;
  std::string conversion_note;
  if (const auto metadata = image::frame_metadata(*b)) {
    if (const auto other = image::frame_metadata(*a);
        other &&
        (other->band_lo_um != metadata->band_lo_um || other->band_hi_um != metadata->band_hi_um)) {
      warn(fmt::format("radiance of different bands: {:g}-{:g} um and {:g}-{:g} um",
                       other->band_lo_um, other->band_hi_um, metadata->band_lo_um,
                       metadata->band_hi_um));
    }
    if (const auto band = spectral_band(*metadata)) {
      conversion = [table = ApparentTemperature(*band)](double radiance) {
        return table.kelvin_per_radiance(radiance);
      };
      conversion_note = conversion_text(*band, metadata->band_response.has_value());
    }
  }
  const auto diff = image::compare_images(*a, *b, conversion);
  if (!diff) return fail(diff.error());

  std::uint64_t no_surface_px = 0;
  TextTable table(
      {"channel", "unit", "max", "rms", "mean", "p50", "p95", "p99", "pixels", "one-sided nan"});
  Json channels = Json::object();
  double worst_k = 0.0;
  std::uint64_t one_sided = 0;
  for (const auto& channel : diff->channels) {
    add_row(table, channel.channel, channel.unit, channel.absolute);
    Json row = Json::object();
    row.set("unit", channel.unit).set("absolute", stats_json(channel.absolute));
    one_sided += channel.absolute.one_sided_nan;
    if (channel.unit == "K") worst_k = std::max(worst_k, channel.absolute.max_abs);
    if (channel.percent.pixels_compared > 0) {
      add_row(table, channel.channel, "%", channel.percent);
      row.set("percent", stats_json(channel.percent));
    }
    if (channel.kelvin_equivalent.pixels_compared > 0) {
      add_row(table, channel.channel, "K equivalent", channel.kelvin_equivalent);
      row.set("kelvin", stats_json(channel.kelvin_equivalent));
      worst_k = std::max(worst_k, channel.kelvin_equivalent.max_abs);
    }
    if (const image::DiffStats& bare = channel.no_surface_absolute;
        bare.pixels_compared + bare.one_sided_nan > 0) {
      no_surface_px = bare.pixels_compared;
      one_sided += bare.one_sided_nan;
      const std::string name = channel.channel + ", no surface";
      add_row(table, name, channel.unit, bare);
      Json other = Json::object();
      other.set("absolute", stats_json(bare));
      if (channel.no_surface_percent.pixels_compared > 0) {
        add_row(table, name, "%", channel.no_surface_percent);
        other.set("percent", stats_json(channel.no_surface_percent));
      }
      if (channel.no_surface_kelvin.pixels_compared > 0) {
        add_row(table, name, "K equivalent", channel.no_surface_kelvin);
        other.set("kelvin", stats_json(channel.no_surface_kelvin));
        worst_k = std::max(worst_k, channel.no_surface_kelvin.max_abs);
      }
      row.set("no_surface", std::move(other));
    }
    channels.set(channel.channel, std::move(row));
  }
  const bool quiet = command.json == std::filesystem::path("-");
  if (!quiet) {
    fmt::print("{}", table.to_string());
    if (no_surface_px > 0) {
      fmt::print(
          "no surface: {} pixels show no surface in both frames; the other rows leave them "
          "out\n",
          no_surface_px);
    }
    if (!conversion_note.empty()) fmt::print("K equivalent: {}\n", conversion_note);
    if (!diff->only_in_a.empty()) fmt::print("only in a: {}\n", list(diff->only_in_a));
    if (!diff->only_in_b.empty()) fmt::print("only in b: {}\n", list(diff->only_in_b));
    fmt::print("{}\n", diff->identical() ? "identical" : "different");
  }
  if (command.json) {
    Json json = Json::object();
    json.set("a", command.a.string()).set("b", command.b.string());
    json.set("identical", diff->identical()).set("max_error_k", worst_k);
    json.set("kelvin_conversion", conversion_note);
    json.set("channels", std::move(channels));
    json.set("only_in_a", names_json(diff->only_in_a));
    json.set("only_in_b", names_json(diff->only_in_b));
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  if (command.max_error_k && (worst_k > *command.max_error_k || one_sided > 0)) {
    return fail(kExitFailure, fmt::format("the frames differ by {:.6g} K and in {} one-sided "
                                          "non-finite pixels; {:.6g} K is allowed",
                                          worst_k, one_sided, *command.max_error_k));
  }
  return kExitOk;
}

void add_options(CommandLine& line, CompareOptions& options) {
  line.path("a", options.a, "OpenEXR frame").required();
  line.path("b", options.b, "OpenEXR frame, taken as the reference").required();
  line.option("--max-error-k", options.max_error_k,
              "Exit 1 when temperatures differ by more than this anywhere (radiance by the band "
              "and response in b's attributes; without a response as of a rectangular band)")
      .type_name("K");
  add_json(line, options.json);
}

}  // namespace

void add_compare(CommandLine& tool) {
  tool.command<CompareOptions>({.name = "compare",
                                .text = "Difference of two frames, in kelvin and per cent",
                                .example = "emit compare a.exr b.exr --json diff.json"},
                               add_options, run);
}

}  // namespace emit::tool
