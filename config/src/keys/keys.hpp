// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <string>
#include <vector>

#include "emit/config/daemon_config.hpp"
#include "emit/scene/scene_desc.hpp"
#include "key.hpp"

/// The key table by sections. A draft holds the values of a file before they are resolved.
namespace emit::config {

/// Position, and the attitude in one of three spellings.
struct PoseDraft {
  glm::dvec3 position_m{0.0, 0.0, 0.0};
  double heading_rad = 0.0;
  double pitch_rad = 0.0;
  double roll_rad = 0.0;
  std::optional<glm::dvec3> look_at_m;
  std::optional<std::array<double, 4>> attitude_wxyz;
};
struct InstanceDraft {
  PoseDraft pose;
};
struct KeyframeDraft {
  std::int64_t time_ns = 0;
  PoseDraft pose;
  bool on = true;
  bool teleport = false;
};
struct PartCommandDraft {
  std::int64_t time_ns = 0;
  std::optional<double> temperature_k;
  std::optional<double> power_w_m2;
  std::optional<double> throttle;
  bool off = false;
};
struct PartDraft {
  scene::PartDesc desc;
  std::optional<double> idle_k;
  std::optional<double> full_k;
  std::vector<PartCommandDraft> commands;
};
struct ObjectDraft {
  scene::ObjectDesc desc;
  std::vector<PartDraft> parts;
  PoseDraft pose;
  std::vector<InstanceDraft> instances;
  std::vector<KeyframeDraft> trajectory;
  std::filesystem::path trajectory_file;
};
struct SensorDraft {
  scene::SensorDesc desc;
  PoseDraft pose;
  std::vector<KeyframeDraft> trajectory;
  std::filesystem::path trajectory_file;
};
struct WeatherDraft {
  std::filesystem::path file;
  scene::ClearSky clear_sky;
  std::vector<scene::WeatherSample> samples;
};
struct AtmosphereDraft {
  bool enabled = true;
  std::string model = "auto";
  double visibility_km = 23.0;
  std::optional<double> water_ratio;
  std::filesystem::path file;
  std::vector<scene::BandAtmosphere> bands;
  std::optional<physics::Fog> fog;
};
struct BandDraft {
  scene::SpectralBand desc;
  std::filesystem::path response_file;
};
/// Keys above the first section.
struct ScenarioHead {
  std::string name;
  std::int64_t epoch_utc_ns = 0;
  std::vector<std::filesystem::path> materials;
  std::string default_material;
};
struct ClutterDraft {
  std::string material;
  scene::Clutter clutter;
};
struct CloudsDraft {
  physics::Clouds clouds;
  std::optional<double> drift_m_s;
  std::optional<double> drift_from_rad;
};
struct DaemonHead {
  std::string scenario;
};

/// Defaults of scenario files where they differ from those of the plain structs.
[[nodiscard]] SensorDraft default_sensor();
[[nodiscard]] ScenarioHead default_scenario_head();
[[nodiscard]] scene::ThermalOptions default_thermal();

[[nodiscard]] const KeyTable<ScenarioHead>& scenario_head_keys();
[[nodiscard]] const KeyTable<scene::Place>& place_keys();
[[nodiscard]] const KeyTable<WeatherDraft>& weather_keys();
[[nodiscard]] const KeyTable<scene::WeatherSample>& weather_sample_keys();
[[nodiscard]] const KeyTable<AtmosphereDraft>& atmosphere_keys();
[[nodiscard]] const KeyTable<physics::Fog>& fog_keys();
[[nodiscard]] const KeyTable<scene::BandAtmosphere>& band_atmosphere_keys();
[[nodiscard]] const KeyTable<scene::ThermalOptions>& thermal_keys();
[[nodiscard]] const KeyTable<scene::DisplayOptions>& display_keys();
[[nodiscard]] const KeyTable<SensorDraft>& sensor_keys();
[[nodiscard]] const KeyTable<BandDraft>& band_keys();
[[nodiscard]] const KeyTable<scene::ChannelDesc>& channel_keys();
[[nodiscard]] const KeyTable<scene::ChannelOptics>& optics_keys();
[[nodiscard]] const KeyTable<scene::ChannelDetector>& detector_keys();
[[nodiscard]] const KeyTable<ObjectDraft>& object_keys();
[[nodiscard]] const KeyTable<scene::ContactDesc>& contact_keys();
[[nodiscard]] const KeyTable<CloudsDraft>& clouds_keys();
/// Returns the keys of clouds, for the printed configuration.
[[nodiscard]] CloudsDraft clouds_draft(const physics::Clouds& clouds);
[[nodiscard]] const KeyTable<ClutterDraft>& clutter_keys();
[[nodiscard]] const KeyTable<scene::PlumeDesc>& plume_keys();
[[nodiscard]] const KeyTable<scene::FlareDesc>& flare_keys();
[[nodiscard]] const KeyTable<scene::SmokeDesc>& smoke_keys();
[[nodiscard]] const KeyTable<scene::FireDesc>& fire_keys();
[[nodiscard]] const KeyTable<InstanceDraft>& instance_keys();
[[nodiscard]] const KeyTable<scene::MaterialImage>& material_image_keys();
[[nodiscard]] const KeyTable<KeyframeDraft>& keyframe_keys();
[[nodiscard]] const KeyTable<PartCommandDraft>& part_command_keys();
[[nodiscard]] const KeyTable<PartDraft>& part_keys();
[[nodiscard]] const KeyTable<scene::Material>& material_keys();
[[nodiscard]] const KeyTable<scene::Layer>& layer_keys();
[[nodiscard]] const KeyTable<scene::RelaxationMode>& mode_keys();
[[nodiscard]] const KeyTable<scene::FosterMode>& foster_mode_keys();
[[nodiscard]] const KeyTable<scene::FosterFit>& foster_fit_keys();
[[nodiscard]] const KeyTable<scene::MaterialSpread>& spread_keys();
[[nodiscard]] const KeyTable<scene::Gloss>& gloss_keys();
/// Returns the key `gloss` of a material.
[[nodiscard]] Key<scene::Material> gloss_key();

[[nodiscard]] const KeyTable<DaemonHead>& daemon_head_keys();
[[nodiscard]] const KeyTable<SourceConfig>& source_keys();
[[nodiscard]] const KeyTable<PacingConfig>& pacing_keys();
[[nodiscard]] const KeyTable<TriggerConfig>& trigger_keys();
[[nodiscard]] const KeyTable<ClockConfig>& clock_keys();
[[nodiscard]] const KeyTable<RealtimeConfig>& realtime_keys();
[[nodiscard]] const KeyTable<HostConfig>& host_keys();
[[nodiscard]] const KeyTable<ControlConfig>& control_keys();
[[nodiscard]] const KeyTable<StreamConfig>& stream_keys();
[[nodiscard]] const KeyTable<MetricsConfig>& metrics_keys();
[[nodiscard]] const KeyTable<ConsoleConfig>& console_keys();
[[nodiscard]] const KeyTable<AccessConfig>& access_keys();
[[nodiscard]] const KeyTable<TlsConfig>& tls_keys();
[[nodiscard]] const KeyTable<MotionConfig>& motion_keys();
[[nodiscard]] const KeyTable<CigiConfig>& cigi_keys();
[[nodiscard]] const KeyTable<DisConfig>& dis_keys();
[[nodiscard]] const KeyTable<NetFdmConfig>& net_fdm_keys();
[[nodiscard]] const KeyTable<JournalConfig>& journal_keys();
[[nodiscard]] const KeyTable<DeviceConfig>& device_keys();
[[nodiscard]] const KeyTable<LogConfig>& log_keys();

inline constexpr std::string_view kShippedLibrary = "share:materials/library.toml";
/// A section for documentation, for the sorting of overrides and for names in the environment.
struct SectionDoc {
  std::string path;    ///< "thermal", "object.instances"; "" for the keys above the sections
  bool array = false;  ///< true for an array of tables
  std::string summary;
  struct Row {
    KeySpec spec;
    std::string default_text;
  };
  std::vector<Row> rows;
};
[[nodiscard]] const std::vector<SectionDoc>& scenario_sections();
[[nodiscard]] const std::vector<SectionDoc>& daemon_sections();

template <class T>
SectionDoc section_doc(std::string path, bool array, std::string summary, const KeyTable<T>& keys,
                       const T& defaults) {
  SectionDoc doc{std::move(path), array, std::move(summary), {}};
  for (const Key<T>& key : keys) {
    std::string text = key.spec.required       ? std::string("required")
                       : key.spec.open_default ? std::string()
                                               : key.write(defaults).value_or("");
    doc.rows.push_back({key.spec, std::move(text)});
  }
  return doc;
}

/// Reads an array of tables under a key, one element per table.
template <class T>
void read_array(const Node& node, const std::string& name, const KeyTable<T>& keys,
                const T& defaults, std::vector<T>& out, Diagnostics& diagnostics) {
  if (!expect_table_array(node, name, diagnostics)) {
    return;
  }
  out.clear();
  for (const Node& item : node.items) {
    T element = defaults;
    read_table(item, keys, element, diagnostics);
    out.push_back(std::move(element));
  }
}
template <class T>
std::optional<std::string> write_array(const std::vector<T>& elements, const KeyTable<T>& keys) {
  if (elements.empty()) {
    return std::nullopt;
  }
  std::string out = "[\n";
  for (const T& element : elements) {
    out += "  " + inline_table(element, keys) + ",\n";
  }
  return out + "]";
}

/// Numbers as a TOML array.
[[nodiscard]] std::string toml_vector(const double* values, std::size_t count);

/// A table with one number by name of a band. `List` is a vector of structs with a member `band`
/// and the number.
template <class T, class Field, class Value>
Key<T> band_numbers(std::string name, std::string unit, Range range, Field field, Value value,
                    std::string meaning) {
  return custom<T>(
      {name, "table", std::move(unit), range.to_string(), std::move(meaning), false},
      [name, range, field, value](T& out, const Node& node, Diagnostics& diagnostics) {
        if (!expect_table(node, name, diagnostics)) return;
        for (const Member& member : node.members) {
          double number = 0.0;
          read_number(member.value, member.key, range, number, diagnostics);
          auto& entry = field(out).emplace_back();
          entry.band = member.key;
          entry.*value = number;
        }
      },
      [field, value](const T& in) -> std::optional<std::string> {
        if (field(in).empty()) return std::nullopt;
        std::string text = "{";
        for (const auto& entry : field(in)) {
          text += (text.size() > 1 ? ", " : " ") + toml_string(entry.band) + " = " +
                  toml_number(entry.*value);
        }
        return text + " }";
      });
}

/// A curve over wavelength: an array of pairs [um, frac]. The field is a vector of structs of these
/// two numbers.
template <class T, class Field>
Key<T> curve(std::string name, Field field, std::string meaning) {
  return custom<T>(
      {name, "array of [um, frac]", "um, 1", "2 or more, ascending, frac in 0 .. 1",
       std::move(meaning), false},
      [name, field](T& out, const Node& node, Diagnostics& diagnostics) {
        if (node.kind != Node::Kind::array) {
          diagnostics.add(node.at, "'" + name + "' must be an array of pairs [um, frac]");
          return;
        }
        field(out).clear();
        for (const Node& item : node.items) {
          double pair[2] = {0.0, 0.0};
          read_vector(item, name, 2, pair, diagnostics);
          field(out).push_back({pair[0], pair[1]});
        }
      },
      [field](const T& in) -> std::optional<std::string> {
        if (field(in).empty()) return std::nullopt;
        std::string text = "[";
        for (const auto& [wavelength_um, share_frac] : field(in)) {
          const double pair[2] = {wavelength_um, share_frac};
          text += (text.size() > 1 ? ", " : "") + toml_vector(pair, 2);
        }
        return text + "]";
      });
}

/// Three numbers, which are multiplied by `scale` when they are read. Nothing is written where the
/// field has no value.
template <class T, class Field>
Key<T> vector3(std::string name, std::string unit, Field field, std::string meaning,
               double scale = 1.0) {
  Key<T> key;
  key.spec = {name, "array of 3 floats", std::move(unit), "finite", std::move(meaning), false};
  key.read = [name, field, scale](T& out, const Node& node, Diagnostics& diagnostics) {
    double values[3] = {0.0, 0.0, 0.0};
    const std::size_t faults = diagnostics.size();
    read_vector(node, name, 3, values, diagnostics);
    if (diagnostics.size() == faults) {
      field(out) = scale * glm::dvec3(values[0], values[1], values[2]);
    }
  };
  key.write = [field, scale](const T& in) -> std::optional<std::string> {
    const std::optional<glm::dvec3> value = field(in);
    if (!value) {
      return std::nullopt;
    }
    return "[" + unscaled_number(value->x, scale) + ", " + unscaled_number(value->y, scale) + ", " +
           unscaled_number(value->z, scale) + "]";
  };
  return key;
}

}  // namespace emit::config
