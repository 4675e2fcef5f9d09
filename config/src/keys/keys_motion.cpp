// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/constants.hpp"
#include "keys.hpp"

/// Keys of the flight motion simulator.
namespace emit::config {

using physics::kDegree;

namespace {

const KeyTable<MotionAxisConfig>& motion_axis_keys() {
  static const KeyTable<MotionAxisConfig> keys = {
      required(number<MotionAxisConfig>("min_deg", "deg", between(-36000, 36000),
                                        EMIT_FIELD(min_rad), "Lower end of the travel.", kDegree)),
      required(number<MotionAxisConfig>("max_deg", "deg", between(-36000, 36000),
                                        EMIT_FIELD(max_rad), "Upper end of the travel.", kDegree)),
      required(number<MotionAxisConfig>("rate_deg_s", "deg/s", above_to(0, 1e5),
                                        EMIT_FIELD(rate_rad_s), "Greatest rate.", kDegree)),
      required(number<MotionAxisConfig>("acceleration_deg_s2", "deg/s2", above_to(0, 1e7),
                                        EMIT_FIELD(acceleration_rad_s2), "Greatest acceleration.",
                                        kDegree)),
      number<MotionAxisConfig>("park_deg", "deg", between(-36000, 36000), EMIT_FIELD(park_rad),
                               "Park position.", kDegree),
  };
  return keys;
}

template <class Field>
Key<MotionConfig> rotation(std::string name, Field field, std::string meaning) {
  return custom<MotionConfig>(
      {name, "array of 3 floats", "deg", "finite", std::move(meaning), false},
      [name, field](MotionConfig& out, const Node& node, Diagnostics& diagnostics) {
        std::array<double, 3> values_deg{};
        const std::size_t faults = diagnostics.size();
        read_vector(node, name, 3, values_deg.data(), diagnostics);
        if (diagnostics.size() != faults) return;
        for (std::size_t i = 0; i < 3; ++i) field(out)[i] = values_deg[i] * kDegree;
      },
      [field](const MotionConfig& in) -> std::optional<std::string> {
        std::array<double, 3> values_deg{};
        for (std::size_t i = 0; i < 3; ++i) values_deg[i] = field(in)[i] / kDegree;
        return toml_vector(values_deg.data(), 3);
      });
}

}  // namespace

const KeyTable<MotionConfig>& motion_keys() {
  static const KeyTable<MotionConfig> keys = {
      text<MotionConfig>(
          "controller", EMIT_FIELD(controller),
          "`address:port` of a controller that takes messages of wire.md section 12, "
          "`memory:PATH@OFFSET` (section 13), or `acutrol:address:port` (ACUTROL "
          "commands). Empty: no motion simulator."),
      number<MotionConfig>("rate_hz", "Hz", between(10, 2000), EMIT_FIELD(rate_hz),
                           "Commands a second."),
      choice<MotionConfig>(
          "unit_rings",
          std::vector<std::pair<std::string, std::string>>{{"yaw-pitch-roll", "yaw-pitch-roll"},
                                                           {"yaw-roll-pitch", "yaw-roll-pitch"},
                                                           {"pitch-yaw-roll", "pitch-yaw-roll"},
                                                           {"pitch-roll-yaw", "pitch-roll-yaw"},
                                                           {"roll-yaw-pitch", "roll-yaw-pitch"},
                                                           {"roll-pitch-yaw", "roll-pitch-yaw"}},
          EMIT_FIELD(unit_rings), "Rings of the unit under test, the outermost first."),
      choice<MotionConfig>("target_rings",
                           std::vector<std::pair<std::string, TargetRings>>{
                               {"none", TargetRings::none},
                               {"azimuth-elevation", TargetRings::azimuth_elevation},
                               {"elevation-azimuth", TargetRings::elevation_azimuth}},
                           EMIT_FIELD(target_rings),
                           "Rings of target or projector, the outermost first. none: it is fixed."),
      integer<MotionConfig>("target_entity", "", 0, 4294967295, EMIT_FIELD(target_entity),
                            "Entity that the target rings point to. 0 means none."),
      custom<MotionConfig>(
          {"axes", "array of tables", "", "3 or 5 axes",
           "Axes of the unit, outermost first, then azimuth and elevation: `min_deg`, `max_deg`, "
           "`rate_deg_s`, `acceleration_deg_s2`, `park_deg` (0).",
           false},
          [](MotionConfig& out, const Node& node, Diagnostics& diagnostics) {
            read_array(node, "axes", motion_axis_keys(), MotionAxisConfig{}, out.axes, diagnostics);
          },
          [](const MotionConfig& in) { return write_array(in.axes, motion_axis_keys()); }),
      rotation("lab_deg", EMIT_FIELD(lab_rad),
               "Heading, pitch and roll of the laboratory in the world of the scenario."),
      rotation("unit_base_deg", EMIT_FIELD(unit_base_rad),
               "Yaw, pitch and roll of the base of the unit's rings in the laboratory."),
      rotation("unit_mount_deg", EMIT_FIELD(unit_mount_rad),
               "Yaw, pitch and roll of the seeker in its innermost ring."),
      rotation("target_base_deg", EMIT_FIELD(target_base_rad),
               "Yaw, pitch and roll of the base of the target's rings in the laboratory."),
      rotation("target_mount_deg", EMIT_FIELD(target_mount_rad),
               "Yaw, pitch and roll of the projector in its innermost ring."),
      nanoseconds<MotionConfig>("feedback_timeout_ms", "ms", 1e6, between(1, 60000),
                                EMIT_FIELD(feedback_timeout_ns),
                                "After so long without a measurement the axes park, and frames "
                                "are flagged."),
      nanoseconds<MotionConfig>("host_timeout_ms", "ms", 1e6, between(1, 60000),
                                EMIT_FIELD(host_timeout_ns),
                                "After so long without a pose the axes park, and frames are "
                                "flagged."),
      integer<MotionConfig>("controller_timeout_ms", "ms", 1, 60000,
                            EMIT_FIELD(controller_timeout_ms),
                            "After so long without a command the controller parks by itself."),
      number<MotionConfig>("soft_frac", "", above_to(0, 1), EMIT_FIELD(soft_frac),
                           "Share of rate and acceleration with which the axes set off."),
  };
  return keys;
}

}  // namespace emit::config
