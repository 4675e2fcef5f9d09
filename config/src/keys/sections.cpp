// SPDX-License-Identifier: Apache-2.0
#include "campaign_keys.hpp"
#include "emit/config/load.hpp"
#include "keys.hpp"

/// The sections in the order of the documentation, and the text of the documentation.
namespace emit::config {

const std::vector<SectionDoc>& scenario_sections() {
  static const std::vector<SectionDoc> sections = {
      section_doc("", false, "These keys stand above the first section.", scenario_head_keys(),
                  default_scenario_head()),
      section_doc("place", false, "Place of the world origin.", place_keys(),
                  scene::Place{48.56 * 0.017453292519943295, 11.26 * 0.017453292519943295, 0.0}),
      section_doc(
          "weather", false,
          "Sun, sky and air over time. A table that begins after `thermal.history_start_s - "
          "thermal.spin_up_s` is completed by the clear-sky models, with a warning; parameters of "
          "them that are absent then follow the table. One row alone is constant weather.",
          weather_keys(), WeatherDraft{}),
      section_doc("weather.sample", true,
                  "Weather at one instant. It is linear between samples and constant behind the "
                  "last one, but for rain, which ends with its row. The columns of the CSV file "
                  "have the same names.",
                  weather_sample_keys(), scene::WeatherSample{}),
      section_doc("clouds", false,
                  "Clouds with structure ([clouds.md](../renderer/docs/clouds.md)): a layer that "
                  "shades the sun from place to place, drifts, and shows in the sky. It needs "
                  "`thermal.method` cached and `thermal.model` foster.",
                  clouds_keys(), CloudsDraft{}),
      section_doc("atmosphere", false, "The air between surface and sensor.", atmosphere_keys(),
                  AtmosphereDraft{}),
      section_doc("atmosphere.fog", false,
                  "A level layer of fog over the ground, as warm as the air there.", fog_keys(),
                  physics::Fog{}),
      section_doc("atmosphere.band", true, "Transmittance of one band, as terms or as a table.",
                  band_atmosphere_keys(), scene::BandAtmosphere{}),
      section_doc("thermal", false, "The thermal simulation.", thermal_keys(), default_thermal()),
      section_doc("sensor", false,
                  "The camera. It looks along the x axis of its body. Poses of host frames "
                  "override the scenario's.",
                  sensor_keys(), default_sensor()),
      section_doc("channel", true,
                  "An output stream. Without channels there are `lwir` (8-12) and `mwir` (3-5), "
                  "both of kind injection.",
                  channel_keys(), scene::ChannelDesc{}),
      section_doc(
          "channel.optics", false,
          "Optics of an injection channel's seeker ([equations](../server/docs/optics.md)).",
          optics_keys(), scene::ChannelOptics{}),
      section_doc("channel.detector", false,
                  "Detector of an injection channel's seeker. Noise depends on the frame's number "
                  "alone, so that a replay has the same bits.",
                  detector_keys(), scene::ChannelDetector{}),
      section_doc(
          "band", true,
          "A spectral band beside the built-in ones. Each band in use costs one image per frame.",
          band_keys(), BandDraft{}),
      section_doc("object", true, "A glTF file placed in the world.", object_keys(), ObjectDraft{}),
      section_doc("object.instances", true, "One placement of an object that does not move.",
                  instance_keys(), InstanceDraft{}),
      section_doc("object.material_images", true,
                  "An image whose colours give the surfaces of one glTF material several materials "
                  "([materials by image](../renderer/docs/material_images.md)).",
                  material_image_keys(), scene::MaterialImage{}),
      section_doc("object.trajectory", true,
                  "A keyframe of an object or of the sensor (`[[sensor.trajectory]]`). The first "
                  "pose holds before it, the last one after it.",
                  keyframe_keys(), KeyframeDraft{}),
      section_doc("object.parts", true,
                  "A part of an entity that heats itself. Heat flows from its skin into the body, "
                  "and radiation from it to what stands near. It needs `thermal.method` cached and "
                  "`thermal.model` foster.",
                  part_keys(), PartDraft{}),
      section_doc("object.parts.commands", true,
                  "What drives a part from an instant on: one of `temperature_k`, `power_w_m2`, "
                  "`throttle` and `off = true`.",
                  part_command_keys(), PartCommandDraft{}),
      section_doc("contact", true,
                  "A joint with a thermal resistance between bodies that touch. Bodies that touch "
                  "without one conduct to each other as if grown together. The method `cached` "
                  "with `foster` conducts from walls into the ground at their feet alone, and only "
                  "`emit solve` in three dimensions through all contacts; all else ignores the "
                  "section with a warning.",
                  contact_keys(), scene::ContactDesc{}),
      section_doc("clutter", true,
                  "Variation of a material from place to place "
                  "([clutter.md](../renderer/docs/clutter.md)): a random field that changes what "
                  "the material absorbs, emits and stores. It needs `thermal.method` cached and "
                  "`thermal.model` foster.",
                  clutter_keys(), ClutterDraft{}),
      section_doc("plume", true,
                  "The exhaust jet of an object ([gas.md](../renderer/docs/gas.md)): a throttle "
                  "of a part drives it.",
                  plume_keys(), scene::PlumeDesc{}),
      section_doc("flare", true, "A decoy that burns from the instant at which its object appears.",
                  flare_keys(), scene::FlareDesc{}),
      section_doc("smoke", true, "A cloud that a source gives off and the wind carries away.",
                  smoke_keys(), scene::SmokeDesc{}),
      section_doc("fire", true, "The flame of a fire on the ground or on an object.", fire_keys(),
                  scene::FireDesc{}),
      section_doc(
          "material", true,
          "A material of the scenario or of a library file, which holds nothing but materials.",
          material_keys(), scene::Material{}),
      section_doc("material.layers", true, "A layer of a material, outermost first.", layer_keys(),
                  scene::Layer{}),
      section_doc("material.modes", true, "An exponential of a material's step response.",
                  mode_keys(), scene::RelaxationMode{}),
      section_doc("material.foster_modes", true,
                  "A state x of a material, driven by the net flux q into the surface: tau x' = "
                  "resistance q - x. The surface has `base_k` plus the sum of the states.",
                  foster_mode_keys(), scene::FosterMode{}),
      section_doc("material.spread", false,
                  "Uncertainty of a material: half-widths of the ranges in which published values "
                  "lie. 0 says nothing.",
                  spread_keys(), scene::MaterialSpread{}),
      section_doc("material.gloss", false,
                  "Gloss of a material: emission by angle and a lobe around the mirror direction "
                  "([physics.md](../renderer/docs/physics.md), section 5). One source of its "
                  "reflectance is required: `index`, constants of your own, or a table by angle.",
                  gloss_keys(), scene::Gloss{}),
      section_doc("display", false, "Limits of the false-colour display.", display_keys(),
                  scene::DisplayOptions{}),
  };
  return sections;
}

const std::vector<SectionDoc>& daemon_sections() {
  static const std::vector<SectionDoc> sections = {
      section_doc("", false, "These keys stand above the first section.", daemon_head_keys(),
                  DaemonHead{}),
      section_doc("source", false, "Source of the frames.", source_keys(), SourceConfig{}),
      section_doc("pacing", false, "Time at which a frame is due.", pacing_keys(), PacingConfig{}),
      section_doc("trigger", false, "The external sync source of `pacing.mode = \"trigger\"`.",
                  trigger_keys(), TriggerConfig{}),
      section_doc("motion", false,
                  "The flight motion simulator that emitd drives "
                  "([motion.md](../server/docs/motion.md)).",
                  motion_keys(), MotionConfig{}),
      section_doc("cigi", false,
                  "A host that speaks CIGI ([cigi.md](../server/docs/cigi.md)). With one, host "
                  "frames of others are refused.",
                  cigi_keys(), CigiConfig{}),
      section_doc("dis", false,
                  "A DIS exercise that emitd listens to ([dis.md](../server/docs/dis.md)). With "
                  "one, host frames of others are refused.",
                  dis_keys(), DisConfig{}),
      section_doc("net_fdm", false,
                  "A flight dynamics model, such as JSBSim, that sends FlightGear's native FDM "
                  "datagrams ([dis.md](../server/docs/dis.md#flight-dynamics-models)). With one, "
                  "host frames of others are refused.",
                  net_fdm_keys(), NetFdmConfig{}),
      section_doc("clock", false, "Source of the clock's time.", clock_keys(), ClockConfig{}),
      section_doc("realtime", false,
                  "Real-time settings of the agents. `emit doctor --real-time` shows what the "
                  "host would refuse.",
                  realtime_keys(), RealtimeConfig{}),
      section_doc("host", false, "Input of poses.", host_keys(), HostConfig{}),
      section_doc("control", false, "The TCP port for everything but datagrams.", control_keys(),
                  ControlConfig{}),
      section_doc("stream", false, "Output of frames.", stream_keys(), StreamConfig{}),
      section_doc("metrics", false, "Numbers for monitoring.", metrics_keys(), MetricsConfig{}),
      section_doc("console", false,
                  "The operator's console in a browser ([console.md](../server/docs/console.md)).",
                  console_keys(), ConsoleConfig{}),
      section_doc("access", false,
                  "Hosts that may connect. emitd does not start with a port that other hosts reach "
                  "unless it is protected: by `allow`, for `control.tcp` also by `[tls]`, for "
                  "`host.udp` also by `host.key_file` or `[tls]`.",
                  access_keys(), AccessConfig{}),
      section_doc("tls", false,
                  "Mutual TLS 1.3 on `control.tcp`. With a certificate, plain connections are "
                  "refused, and so are host datagrams without a MAC by `host.key_file` or by the "
                  "key that a host agrees over its TLS connection.",
                  tls_keys(), TlsConfig{}),
      section_doc("journal", false, "Record of all inputs, which makes a replay exact.",
                  journal_keys(), JournalConfig{}),
      section_doc("device", false, "The graphics device.", device_keys(), DeviceConfig{}),
      section_doc("log", false, "Messages of emitd.", log_keys(), LogConfig{}),
  };
  return sections;
}

namespace {

/// Text for a cell of a table, where `|` would end the cell.
std::string cell(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '|') {
      out += '\\';
    }
    out += c;
  }
  return out;
}

void append_sections(const std::vector<SectionDoc>& sections, std::string& out) {
  for (const SectionDoc& section : sections) {
    std::string title = "Top level";
    if (!section.path.empty()) {
      title = section.array ? "`[[" + section.path + "]]`" : "`[" + section.path + "]`";
    }
    out += "### " + title + "\n\n" + section.summary + "\n\n";
    out += "| key | type | unit | range | default | meaning |\n|---|---|---|---|---|---|\n";
    for (const SectionDoc::Row& row : section.rows) {
      const std::string shown = row.default_text.empty() ? ""
                                : row.spec.required      ? "required"
                                                         : "`" + row.default_text + "`";
      out += "| `" + row.spec.name + "` | " + row.spec.type + " | " + row.spec.unit + " | " +
             cell(row.spec.range) + " | " + cell(shown) + " | " + cell(row.spec.meaning) + " |\n";
    }
    out += "\n";
  }
}

}  // namespace

std::string key_reference_markdown() {
  std::string out = "## Scenario keys\n\n";
  append_sections(scenario_sections(), out);
  out += "## Daemon keys\n\n";
  append_sections(daemon_sections(), out);
  out += "## Campaign keys\n\nFiles of `emit campaign`.\n\n";
  append_sections(campaign_sections(), out);
  out.pop_back();
  return out;
}

}  // namespace emit::config
