// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "check_curve.hpp"
#include "emit/physics/constants.hpp"
#include "resolve.hpp"

namespace emit::config {

using scene::BandAtmosphere;
using scene::ChannelDesc;
using scene::SpectralBand;

const std::vector<SpectralBand>& built_in_bands() {
  static const std::vector<SpectralBand> bands = {{"3-5", 3.0, 5.0, {}},
                                                  {"3.4-4.1", 3.4, 4.1, {}},
                                                  {"8-12", 8.0, 12.0, {}},
                                                  {"7.7-9.3", 7.7, 9.3, {}}};
  return bands;
}

namespace {

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) {
    out += (out.empty() ? "" : ", ") + name;
  }
  return out;
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

void check_response(const SpectralBand& band, const Location& at, Diagnostics& diagnostics) {
  if (!check_curve(band.response, "a response", "response", at, diagnostics)) return;
  const bool dark = std::ranges::all_of(
      band.response, [](const auto& sample) { return sample.response_frac <= 0.0; });
  if (dark) diagnostics.add(at, "the response is zero everywhere");
}

SpectralBand resolve_band(const Node& node, Diagnostics& diagnostics) {
  BandDraft draft;
  const std::size_t faults = diagnostics.size();
  read_table(node, band_keys(), draft, diagnostics);
  SpectralBand& band = draft.desc;
  if (node.has("name") && band.name.empty()) {
    diagnostics.add(key_location(node, "name"), "'name' is empty");
  }
  if (node.has("response") && node.has("response_file")) {
    diagnostics.add(key_location(node, "response_file"),
                    "use only one of 'response' and 'response_file'");
    return band;
  }
  std::string_view response_key = "response";
  if (!draft.response_file.empty()) {
    response_key = "response_file";
    auto loaded = load_response_csv(draft.response_file);
    if (!loaded) {
      report_file_error(loaded.error(), node, response_key, diagnostics);
      return band;
    }
    band.response = std::move(*loaded);
  }
  if (diagnostics.size() != faults) {
    return band;
  }
  if (node.has(response_key)) {
    check_response(band, key_location(node, response_key), diagnostics);
    if (diagnostics.size() != faults) {
      return band;
    }
    const double first = band.response.front().wavelength_um;
    const double last = band.response.back().wavelength_um;
    band.lo_um = node.has("lo_um") ? band.lo_um : first;
    band.hi_um = node.has("hi_um") ? band.hi_um : last;
    if (band.lo_um > last || band.hi_um < first) {
      diagnostics.add(node.at, fmt::format("band '{}' and its response do not overlap", band.name));
      return band;
    }
  } else if (!node.has("lo_um") || !node.has("hi_um")) {
    diagnostics.add(node.at,
                    fmt::format("band '{}' needs 'lo_um' and 'hi_um', or a response", band.name));
    return band;
  }
  if (band.lo_um >= band.hi_um) {
    diagnostics.add(key_location(node, node.has("hi_um") ? "hi_um" : "lo_um"),
                    fmt::format("'hi_um' ({}) must be above 'lo_um' ({})", band.hi_um, band.lo_um));
  }
  return band;
}

/// Place of the [[band]] of that name, else of `fallback`.
const Location& band_location(const Node& root, const std::string& name, const Node& fallback) {
  if (const Node* bands = root.find("band")) {
    for (const Node& node : bands->items) {
      const Node* band_name = node.find("name");
      if (band_name != nullptr && band_name->text == name) {
        return node.at;
      }
    }
  }
  return fallback.at;
}

}  // namespace

std::vector<std::string> known_band_names(const std::vector<SpectralBand>& declared) {
  std::vector<std::string> names;
  for (const SpectralBand& band : built_in_bands()) {
    names.push_back(band.name);
  }
  for (const SpectralBand& band : declared) {
    if (!contains(names, band.name)) {
      names.push_back(band.name);
    }
  }
  return names;
}

std::vector<SpectralBand> resolve_declared_bands(const Node& root, Diagnostics& diagnostics) {
  std::vector<SpectralBand> bands;
  for (const Node& node : section_array(root, "band", diagnostics)) {
    SpectralBand band = resolve_band(node, diagnostics);
    for (const SpectralBand& other : bands) {
      if (other.name == band.name) {
        diagnostics.add(key_location(node, "name"),
                        fmt::format("band '{}' is defined twice", band.name));
      }
    }
    bands.push_back(std::move(band));
  }
  return bands;
}

std::vector<ChannelDesc> resolve_channels(const Node& root,
                                          const std::vector<std::string>& known_bands,
                                          Diagnostics& diagnostics) {
  if (!root.has("channel")) {
    return {{"lwir", scene::ChannelKind::injection, "8-12"},
            {"mwir", scene::ChannelKind::injection, "3-5"}};
  }
  std::vector<ChannelDesc> channels;
  for (const Node& node : section_array(root, "channel", diagnostics)) {
    ChannelDesc channel;
    read_table(node, channel_keys(), channel, diagnostics);
    if (node.has("name") && channel.name.empty()) {
      diagnostics.add(key_location(node, "name"), "'name' is empty");
    }
    if (node.has("band") && !contains(known_bands, channel.band)) {
      diagnostics.add(key_location(node, "band"),
                      fmt::format("there is no band '{}'{} (known: {})", channel.band,
                                  did_you_mean(channel.band, known_bands), listed(known_bands)));
    }
    for (const ChannelDesc& other : channels) {
      if (!channel.name.empty() && other.name == channel.name) {
        diagnostics.add(key_location(node, "name"),
                        fmt::format("channel '{}' is defined twice", channel.name));
      }
    }
    channels.push_back(std::move(channel));
  }
  std::vector<std::string> used;
  for (std::size_t i = 0; i < channels.size() && diagnostics.empty(); ++i) {
    if (contains(used, channels[i].band)) {
      continue;
    }
    used.push_back(channels[i].band);
    if (used.size() == limits::kMaxBands + 1) {
      diagnostics.add(key_location(root.find("channel")->items[i], "band"),
                      fmt::format("channels use more than {} bands", limits::kMaxBands));
    }
  }
  if (channels.empty() && diagnostics.empty()) {
    diagnostics.add(key_location(root, "channel"), "at least one channel is needed");
  }
  return channels;
}

namespace {

/// Reports settings of the optics and the detector that make no sense together.
void check_optics(const Node& table, const ChannelDesc& channel, bool require_files,
                  Diagnostics& diagnostics) {
  const scene::ChannelOptics& optics = channel.output.optics;
  const scene::ChannelDetector& detector = channel.output.detector;
  using scene::SpotKind;
  for (const char* section : {"optics", "detector"}) {
    if (channel.kind != scene::ChannelKind::injection && table.has(section)) {
      diagnostics.add(key_location(table, section),
                      fmt::format("'{}' needs kind = \"injection\": the seeker before a projector "
                                  "has its own",
                                  section));
    }
  }
  // Each shape needs its own numbers, and no others.
  const Node empty{};
  const Node& keys = table.has("optics") ? *table.find("optics") : empty;
  const auto belongs = [&](const char* key, SpotKind kind, const char* shape, bool needed) {
    if (keys.has(key) && optics.spot != kind) {
      diagnostics.add(key_location(keys, key), fmt::format("'{}' needs spot = \"{}\"", key, shape));
    }
    if (needed && optics.spot == kind && !keys.has(key)) {
      diagnostics.add(key_location(keys, "spot"),
                      fmt::format("spot = \"{}\" needs '{}'", shape, key));
    }
  };
  belongs("sigma_px", SpotKind::gaussian, "gaussian", true);
  belongs("airy_px", SpotKind::airy, "airy", true);
  belongs("obscuration_frac", SpotKind::airy, "airy", false);
  belongs("spot_file", SpotKind::file, "file", true);
  std::error_code code;
  if (require_files && !optics.spot_file.empty() &&
      !std::filesystem::is_regular_file(optics.spot_file, code)) {
    diagnostics.add(key_location(keys, "spot_file"),
                    fmt::format("'spot_file': {}: no such file", optics.spot_file.string()));
  }
  if (!table.has("detector")) return;
  const Node& response = *table.find("detector");
  const bool counts = detector.counts_per_w_m2_sr > 0.0;
  for (const char* key : {"counts_offset", "counts_bits"}) {
    if (!counts && response.has(key)) {
      diagnostics.add(key_location(response, key),
                      fmt::format("'{}' needs 'counts_per_w_m2_sr'", key));
    }
  }
  for (const char* key : {"nuc_file", "drive_table_file"}) {
    if (counts && table.has(key)) {
      diagnostics.add(key_location(table, key),
                      fmt::format("use only one of '{}' and 'detector.counts_per_w_m2_sr'", key));
    }
  }
  if (response.has("photon_frac") && !(detector.netd_k > 0.0)) {
    diagnostics.add(key_location(response, "photon_frac"), "'photon_frac' needs 'netd_k'");
  }
}

/// Reports a quantity that the channel cannot have.
void check_quantity(const Node& table, const ChannelDesc& channel,
                    const std::vector<SpectralBand>& bands, Diagnostics& diagnostics) {
  using scene::PictureQuantity;
  const scene::ChannelOutput& output = channel.output;
  if (output.quantity == PictureQuantity::radiance) return;
  const auto refuse = [&](const std::string& text) {
    diagnostics.add(key_location(table, "quantity"), text);
  };
  if (!output.nuc_file.empty() || !output.drive_table_file.empty() ||
      output.detector.counts_per_w_m2_sr > 0.0) {
    refuse(
        "'quantity' is radiance where 'nuc_file', 'drive_table_file' or "
        "'detector.counts_per_w_m2_sr' makes something else of it");
  }
  const auto band =
      std::ranges::find_if(bands, [&](const auto& one) { return one.name == channel.band; });
  if (output.quantity == PictureQuantity::photon_radiance && band != bands.end() &&
      !band->photons) {
    refuse(
        fmt::format("\"photon_radiance\" needs a [[band]] with photons = true, and '{}' has a "
                    "response per power",
                    channel.band));
  }
}

/// Reports settings of an output that make no sense together, and files that do not exist.
void check_output(const Node& table, const ChannelDesc& channel, bool require_files,
                  Diagnostics& diagnostics) {
  const scene::ChannelOutput& output = channel.output;
  if (!output.distortion_file.empty() && output.has_polynomial()) {
    diagnostics.add(key_location(table, "distortion_file"),
                    "use only one of 'distortion_file' and the polynomial of 'distortion_radial' "
                    "and 'distortion_tangential'");
  }
  if (output.apply_shift && channel.kind != scene::ChannelKind::projector) {
    diagnostics.add(key_location(table, "apply_shift"),
                    "'apply_shift' needs kind = \"projector\": an injected image has no shift");
  }
  const bool resamples =
      !output.distortion_file.empty() || output.has_polynomial() || output.apply_shift;
  if (output.outside_w_m2_sr != 0.0 && !resamples) {
    diagnostics.add(key_location(table, "outside_w_m2_sr"),
                    "'outside_w_m2_sr' has no effect without a distortion or 'apply_shift'");
  }
  check_optics(table, channel, require_files, diagnostics);
  for (const auto& [key, file] : {std::pair{"distortion_file", &output.distortion_file},
                                  std::pair{"nuc_file", &output.nuc_file},
                                  std::pair{"drive_table_file", &output.drive_table_file}}) {
    std::error_code code;
    if (require_files && !file->empty() && !std::filesystem::is_regular_file(*file, code)) {
      diagnostics.add(key_location(table, key),
                      fmt::format("'{}': {}: no such file", key, file->string()));
    }
  }
}

/// Reports a camera that the scenario cannot have.
void check_camera(const Node& node, const scene::ChannelCamera& camera,
                  const scene::ScenarioDesc& scenario, Diagnostics& diagnostics) {
  constexpr double kSlackFrac = 1e-9;
  const double lo_rad = scenario.sensor.narrowest_fov_rad();
  const double hi_rad = scenario.sensor.fov_h_rad;
  if (camera.fov_h_rad != 0.0 && (camera.fov_h_rad < (1.0 - kSlackFrac) * lo_rad ||
                                  camera.fov_h_rad > (1.0 + kSlackFrac) * hi_rad)) {
    diagnostics.add(key_location(node, "fov_h_deg"),
                    fmt::format("'fov_h_deg' is {}, must be {} .. {}: the surface is prepared for "
                                "'sensor.fov_h_min_deg' to 'sensor.fov_h_deg'",
                                camera.fov_h_rad / physics::kDegree, lo_rad / physics::kDegree,
                                hi_rad / physics::kDegree));
  }
  if (camera.entity_id && std::ranges::none_of(scenario.objects, [&](const auto& object) {
        return object.entity_id == camera.entity_id;
      })) {
    diagnostics.add(key_location(node, "carrier_entity"),
                    fmt::format("the scenario has no entity {}", *camera.entity_id));
  }
}

}  // namespace

void check_channels(const Node& root, const scene::ScenarioDesc& scenario, bool require_files,
                    Diagnostics& diagnostics) {
  const Node* section = root.find("channel");
  if (section == nullptr || section->items.size() != scenario.channels.size()) {
    return;
  }
  bool all_frames = false;
  std::uint32_t look_ahead_frames = 0;
  for (std::size_t i = 0; i < scenario.channels.size(); ++i) {
    const scene::PixelRect& window = scenario.channels[i].window_px;
    const std::uint32_t width_px = scenario.sensor.width_px;
    const std::uint32_t height_px = scenario.sensor.height_px;
    if (window.x_px + window.width_px > width_px || window.y_px + window.height_px > height_px) {
      diagnostics.add(key_location(section->items[i], "window_px"),
                      fmt::format("'window_px' reaches to column {} and row {}; the sensor's image "
                                  "is {} x {}",
                                  window.x_px + window.width_px, window.y_px + window.height_px,
                                  width_px, height_px));
    }
    check_output(section->items[i], scenario.channels[i], require_files, diagnostics);
    check_quantity(section->items[i], scenario.channels[i], scenario.bands, diagnostics);
    check_camera(section->items[i], scenario.channels[i].camera, scenario, diagnostics);
    const std::uint32_t ahead = scenario.channels[i].camera.look_ahead_frames;
    all_frames = all_frames || (scenario.channels[i].every_nth == 1 && ahead == 0);
    if (look_ahead_frames == 0) look_ahead_frames = ahead;
    if (ahead != 0 && ahead != look_ahead_frames) {
      diagnostics.add(key_location(section->items[i], "look_ahead_frames"),
                      fmt::format("'look_ahead_frames' is {}, but another channel has {}: all "
                                  "channels that look ahead show one instant",
                                  ahead, look_ahead_frames));
    }
  }
  if (!all_frames && !section->items.empty()) {
    diagnostics.add(key_location(section->items.front(), "every_nth"),
                    "no channel shows every frame at its own instant: 'every_nth' of one is 1, and "
                    "its 'look_ahead_frames' 0");
  }
}

std::vector<SpectralBand> bands_in_use(const std::vector<ChannelDesc>& channels,
                                       const std::vector<SpectralBand>& declared) {
  std::vector<SpectralBand> out;
  const auto add = [&out](const SpectralBand& band) {
    if (std::none_of(out.begin(), out.end(),
                     [&band](const SpectralBand& other) { return other.name == band.name; })) {
      out.push_back(band);
    }
  };
  for (const ChannelDesc& channel : channels) {
    for (const std::vector<SpectralBand>* bands : {&declared, &built_in_bands()}) {
      for (const SpectralBand& band : *bands) {
        if (band.name == channel.band) {
          add(band);
        }
      }
    }
  }
  return out;
}

namespace {

/// Names of all bands that a scenario may name, whether a channel shows them or not.
std::vector<std::string> speakable_band_names(const Node& root,
                                              const std::vector<SpectralBand>& bands) {
  std::vector<std::string> names = known_band_names(bands);
  if (const Node* declared = root.find("band")) {
    for (const Node& node : declared->items) {
      const Node* name = node.find("name");
      if (name != nullptr && !contains(names, name->text)) {
        names.push_back(name->text);
      }
    }
  }
  return names;
}

/// Checks that an `[[atmosphere.band]]` has either terms or a complete table.
void check_inline_atmosphere(const Node& node, const BandAtmosphere& entry,
                             Diagnostics& diagnostics) {
  constexpr const char* kTableKeys[] = {"range_m", "elevation_deg", "transmittance_frac",
                                        "path_radiance_w_m2_sr"};
  const bool table = std::any_of(std::begin(kTableKeys), std::end(kTableKeys),
                                 [&node](const char* key) { return node.has(key); });
  if (!table) {
    if (!node.has("terms")) {
      diagnostics.add(node.at,
                      "key 'terms' is missing (or a table: 'range_m', 'elevation_deg', "
                      "'transmittance_frac', 'path_radiance_w_m2_sr')");
    }
    return;
  }
  for (const char* key : {"terms", "vertical_transmittance_frac"}) {
    if (node.has(key)) {
      diagnostics.add(key_location(node, key),
                      fmt::format("'{}' and a table exclude each other", key));
    }
  }
  for (const char* key : kTableKeys) {
    if (!node.has(key)) {
      diagnostics.add(node.at, fmt::format("key '{}' is missing", key));
      return;
    }
  }
  if (auto valid = physics::validate(entry.table); !valid) {
    diagnostics.add(node.at, valid.error().text);
  }
}

}  // namespace

void complete_band_emissivities(const std::vector<SpectralBand>& bands,
                                std::vector<scene::Material>& materials) {
  for (scene::Material& material : materials) {
    const std::vector<scene::BandEmissivity> listed_bands = material.band_emissivity;
    for (const SpectralBand& band : bands) {
      double most = 0.0;
      double emissivity_frac = material.emissivity_frac;
      for (const scene::BandEmissivity& entry : listed_bands) {
        const auto named = [&entry](const SpectralBand& known) { return known.name == entry.band; };
        const auto known = std::ranges::find_if(built_in_bands(), named);
        double likeness = 2.0;  // the band itself is listed
        if (entry.band != band.name) {
          if (known == built_in_bands().end()) continue;
          const double both_um =
              std::min(band.hi_um, known->hi_um) - std::max(band.lo_um, known->lo_um);
          likeness =
              both_um / (std::max(band.hi_um, known->hi_um) - std::min(band.lo_um, known->lo_um));
        }
        if (likeness <= most) continue;
        most = likeness;
        emissivity_frac = entry.emissivity_frac;
      }
      if (most > 0.0 && most <= 1.0)
        material.band_emissivity.push_back({band.name, emissivity_frac});
    }
  }
}

scene::AtmosphereDesc resolve_atmosphere(const Node& root, const scene::ScenarioDesc& scenario,
                                         Diagnostics& diagnostics) {
  const std::vector<SpectralBand>& bands = scenario.bands;
  const Node& table = section(root, "atmosphere", diagnostics);
  AtmosphereDraft draft;
  const bool bands_are_sound = diagnostics.empty();
  const std::size_t faults = diagnostics.size();
  read_table(table, atmosphere_keys(), draft, diagnostics);
  scene::AtmosphereDesc out;
  out.enabled = draft.enabled;
  out.fog = draft.fog;
  if (draft.fog && !draft.enabled) {
    diagnostics.add(key_location(table, "fog"), "'fog' needs air: atmosphere.enabled is false");
  }
  std::vector<BandAtmosphere> from_file;
  if (!draft.file.empty()) {
    auto loaded = load_atmosphere(draft.file, bands, speakable_band_names(root, bands));
    if (!loaded) {
      report_file_error(loaded.error(), table, "file", diagnostics);
    } else {
      from_file = std::move(*loaded);
    }
  }
  const Node* inline_bands = table.find("band");
  for (std::size_t i = 0; i < draft.bands.size() && diagnostics.size() == faults; ++i) {
    const Node& node = inline_bands->items[i];
    const std::string& name = draft.bands[i].band;
    check_inline_atmosphere(node, draft.bands[i], diagnostics);
    const std::vector<std::string> known = speakable_band_names(root, bands);
    if (!contains(known, name)) {
      diagnostics.add(key_location(node, "band"),
                      fmt::format("there is no band '{}'{} (known: {})", name,
                                  did_you_mean(name, known), listed(known)));
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (draft.bands[j].band == name) {
        diagnostics.add(key_location(node, "band"),
                        fmt::format("the atmosphere of band '{}' is given twice", name));
      }
    }
  }
  if (diagnostics.size() != faults) {
    return out;
  }
  const std::optional<physics::AirSpec> built_in = built_in_air(draft, scenario);
  for (const SpectralBand& band : bands) {
    const auto named = [&band](const BandAtmosphere& entry) { return entry.band == band.name; };
    const auto inline_entry = std::find_if(draft.bands.begin(), draft.bands.end(), named);
    const auto file_entry = std::find_if(from_file.begin(), from_file.end(), named);
    if (inline_entry != draft.bands.end()) {
      out.bands.push_back(*inline_entry);
    } else if (file_entry != from_file.end()) {
      out.bands.push_back(*file_entry);
    } else if (draft.enabled && !from_file.empty() && !from_file.front().table.empty() &&
               !table.has("model")) {
      diagnostics.add(key_location(table, "file"),
                      fmt::format("'file': {} has no rows of band '{}': add them, or name the "
                                  "'model' that stands in for it",
                                  draft.file.string(), band.name));
    } else if (built_in && physics::BandAir::covers(scene::spectral_band(band))) {
      BandAtmosphere entry;
      entry.band = band.name;
      entry.model = built_in;
      out.bands.push_back(std::move(entry));
    } else if (draft.enabled && bands_are_sound) {
      diagnostics.add(
          band_location(root, band.name, table),
          fmt::format("band '{}' has no atmosphere: add an [[atmosphere.band]] for it or "
                      "set atmosphere.enabled = false (the built-in air covers {} to {:.4f} um)",
                      band.name, physics::kAirShortestUm, physics::kAirLongestUm));
    }
  }
  return out;
}

}  // namespace emit::config
