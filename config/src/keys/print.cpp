// SPDX-License-Identifier: Apache-2.0
#include "emit/config/load.hpp"
#include "keys.hpp"

/// Writer of the effective configuration, by the key table that also reads it.
namespace emit::config {

namespace {

PoseDraft draft_of(const physics::Pose& pose) {
  PoseDraft draft;
  draft.position_m = pose.position_world_m;
  const glm::dquat& q = pose.world_from_body;
  draft.attitude_wxyz = {q.w, q.x, q.y, q.z};
  return draft;
}

std::vector<KeyframeDraft> drafts_of(const scene::Trajectory& trajectory) {
  std::vector<KeyframeDraft> drafts;
  for (const scene::Keyframe& keyframe : trajectory) {
    drafts.push_back(
        {keyframe.sim_time_ns, draft_of(keyframe.pose), keyframe.on, keyframe.teleport});
  }
  return drafts;
}

PartDraft draft_of(const scene::PartDesc& part) {
  PartDraft draft;
  draft.desc = part;
  if (part.curve.given) {
    draft.idle_k = part.curve.idle_k;
    draft.full_k = part.curve.full_k;
  }
  for (const auto& [time_ns, command] : part.commands) {
    PartCommandDraft out;
    out.time_ns = time_ns;
    switch (command.kind) {
      case scene::PartCommand::Kind::off:
        out.off = true;
        break;
      case scene::PartCommand::Kind::temperature:
        out.temperature_k = command.value;
        break;
      case scene::PartCommand::Kind::power:
        out.power_w_m2 = command.value;
        break;
      case scene::PartCommand::Kind::throttle:
        out.throttle = command.value;
        break;
    }
    draft.commands.push_back(out);
  }
  return draft;
}

template <class T>
bool is_pose_key(const Key<T>& key) {
  for (const Key<InstanceDraft>& pose_key : instance_keys()) {
    if (pose_key.spec.name == key.spec.name) {
      return true;
    }
  }
  return false;
}

template <class T>
KeyTable<T> without_pose(const KeyTable<T>& keys) {
  KeyTable<T> out;
  for (const Key<T>& key : keys) {
    if (!is_pose_key(key)) {
      out.push_back(key);
    }
  }
  return out;
}

template <class T>
void print_section(const std::string& title, const T& value, const KeyTable<T>& keys,
                   std::string& out) {
  out += "\n" + title + "\n";
  write_table(value, keys, out);
}

void print_object(const scene::ObjectDesc& object, std::string& out) {
  ObjectDraft draft;
  draft.desc = object;
  draft.trajectory = drafts_of(object.trajectory);
  for (const scene::PartDesc& part : object.parts) draft.parts.push_back(draft_of(part));
  const bool pose_at_object = object.instances.size() == 1;
  if (pose_at_object) {
    draft.pose = draft_of(object.instances.front());
  } else {
    for (const physics::Pose& instance : object.instances) {
      draft.instances.push_back({draft_of(instance)});
    }
  }
  print_section("[[object]]", draft, pose_at_object ? object_keys() : without_pose(object_keys()),
                out);
}

}  // namespace

std::string print_scenario(const scene::ScenarioDesc& scenario) {
  std::string out;
  ScenarioHead head;
  head.name = scenario.name;
  head.epoch_utc_ns = scenario.epoch_utc_ns;
  head.default_material = scenario.default_material;
  write_table(head, scenario_head_keys(), out);  // all materials are written out below
  print_section("[place]", scenario.place, place_keys(), out);

  WeatherDraft weather;
  weather.clear_sky = scenario.clear_sky;
  weather.samples = scenario.weather;
  KeyTable<WeatherDraft> weather_table = weather_keys();
  if (!scenario.weather.empty()) {
    std::erase_if(weather_table, [](const auto& key) { return key.spec.name != "sample"; });
  }
  if (scenario.clouds) {
    std::erase_if(weather_table, [](const auto& key) {
      return key.spec.name == "cloud_frac" || key.spec.name == "cloud_base_m";
    });
  }
  print_section("[weather]", weather, weather_table, out);
  if (scenario.clouds) {
    print_section("[clouds]", clouds_draft(*scenario.clouds), clouds_keys(), out);
  }

  AtmosphereDraft atmosphere;
  atmosphere.enabled = scenario.atmosphere.enabled;
  atmosphere.model = "none";
  // Bands with built-in air share its description; the others are written out.
  for (const scene::BandAtmosphere& band : scenario.atmosphere.bands) {
    if (!band.model) {
      atmosphere.bands.push_back(band);
      continue;
    }
    atmosphere.model = physics::air_climate_name(band.model->climate);
    atmosphere.visibility_km = band.model->visibility_km;
    atmosphere.water_ratio = band.model->water_ratio;
  }
  atmosphere.fog = scenario.atmosphere.fog;
  print_section("[atmosphere]", atmosphere, atmosphere_keys(), out);

  print_section("[thermal]", scenario.thermal, thermal_keys(), out);

  SensorDraft sensor;
  sensor.desc = scenario.sensor;
  sensor.trajectory = drafts_of(scenario.sensor.trajectory);
  print_section("[sensor]", sensor, without_pose(sensor_keys()), out);

  print_section("[display]", scenario.display, display_keys(), out);
  for (const scene::SpectralBand& band : scenario.bands) {
    print_section("[[band]]", BandDraft{band, {}}, band_keys(), out);
  }
  for (const scene::ChannelDesc& channel : scenario.channels) {
    print_section("[[channel]]", channel, channel_keys(), out);
  }
  for (const scene::ObjectDesc& object : scenario.objects) {
    print_object(object, out);
  }
  for (const scene::ContactDesc& contact : scenario.contacts) {
    print_section("[[contact]]", contact, contact_keys(), out);
  }
  for (const scene::Material& material : scenario.materials) {
    if (!material.clutter) continue;
    print_section("[[clutter]]", ClutterDraft{material.name, *material.clutter}, clutter_keys(),
                  out);
  }
  for (const auto& plume : scenario.gas.plumes) {
    print_section("[[plume]]", plume, plume_keys(), out);
  }
  for (const auto& flare : scenario.gas.flares) {
    print_section("[[flare]]", flare, flare_keys(), out);
  }
  for (const auto& smoke : scenario.gas.smokes) {
    print_section("[[smoke]]", smoke, smoke_keys(), out);
  }
  for (const auto& fire : scenario.gas.fires) {
    print_section("[[fire]]", fire, fire_keys(), out);
  }
  for (const scene::Material& material : scenario.materials) {
    print_section("[[material]]", material, material_keys(), out);
  }
  return out;
}

std::string print_material(const scene::Material& material) {
  std::string out;
  print_section("[[material]]", material, material_keys(), out);
  return out;
}

std::string print_daemon(const DaemonConfig& daemon) {
  std::string out;
  write_table(DaemonHead{daemon.scenario.string()}, daemon_head_keys(), out);
  print_section("[source]", daemon.source, source_keys(), out);
  print_section("[pacing]", daemon.pacing, pacing_keys(), out);
  print_section("[trigger]", daemon.trigger, trigger_keys(), out);
  print_section("[motion]", daemon.motion, motion_keys(), out);
  print_section("[cigi]", daemon.cigi, cigi_keys(), out);
  print_section("[dis]", daemon.dis, dis_keys(), out);
  print_section("[net_fdm]", daemon.net_fdm, net_fdm_keys(), out);
  print_section("[clock]", daemon.clock, clock_keys(), out);
  print_section("[realtime]", daemon.realtime, realtime_keys(), out);
  print_section("[host]", daemon.host, host_keys(), out);
  print_section("[control]", daemon.control, control_keys(), out);
  print_section("[stream]", daemon.stream, stream_keys(), out);
  print_section("[metrics]", daemon.metrics, metrics_keys(), out);
  print_section("[console]", daemon.console, console_keys(), out);
  print_section("[access]", daemon.access, access_keys(), out);
  print_section("[tls]", daemon.tls, tls_keys(), out);
  print_section("[journal]", daemon.journal, journal_keys(), out);
  print_section("[device]", daemon.device, device_keys(), out);
  print_section("[log]", daemon.log, log_keys(), out);
  return out;
}

}  // namespace emit::config
