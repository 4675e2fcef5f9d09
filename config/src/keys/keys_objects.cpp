// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <string_view>

#include "emit/physics/constants.hpp"
#include "keys.hpp"

/// Keys of what stands and moves in the world: objects, the sensor, their placements.
namespace emit::config {

using physics::kDegree;

namespace {

/// An angle that is written only where angles are the chosen spelling of the attitude.
template <class T, class Field, class Pose>
Key<T> angle(std::string name, Range range, Field field, Pose pose, std::string meaning) {
  Key<T> key = number<T>(std::move(name), "deg", range, field, std::move(meaning), kDegree);
  key.write = [inner = std::move(key.write), pose](const T& in) -> std::optional<std::string> {
    if (pose(in).attitude_wxyz || pose(in).look_at_m) {
      return std::nullopt;
    }
    return inner(in);
  };
  return key;
}

template <class T, class Pose>
void append_pose_keys(KeyTable<T>& keys, Pose pose, const std::string& subject) {
  keys.push_back(vector3<T>(
      "position_m", "m", [pose](auto& object) -> auto& { return pose(object).position_m; },
      "Position of " + subject + ": east, north, up from the world origin."));
  keys.push_back(angle<T>(
      "heading_deg",
      between(-360, 360), [pose](auto& object) -> auto& { return pose(object).heading_rad; }, pose,
      "Heading, clockwise from north."));
  keys.push_back(angle<T>(
      "pitch_deg",
      between(-90, 90), [pose](auto& object) -> auto& { return pose(object).pitch_rad; }, pose,
      "Pitch, nose up."));
  keys.push_back(angle<T>(
      "roll_deg",
      between(-360, 360), [pose](auto& object) -> auto& { return pose(object).roll_rad; }, pose,
      "Roll, right side down."));
  keys.push_back(vector3<T>(
      "look_at_m", "m", [pose](auto& object) -> auto& { return pose(object).look_at_m; },
      "In place of angles: world point that the x axis points to, with the least roll."));
  keys.push_back(custom<T>(
      {"attitude_wxyz", "array of 4 floats", "", "norm 0.99 .. 1.01",
       "In place of angles: quaternion `world_from_body`.", false},
      [pose](T& out, const Node& node, Diagnostics& diagnostics) {
        std::array<double, 4> q{1.0, 0.0, 0.0, 0.0};
        const std::size_t faults = diagnostics.size();
        read_vector(node, "attitude_wxyz", 4, q.data(), diagnostics);
        if (diagnostics.size() != faults) {
          return;
        }
        const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        if (!(norm >= 0.99 && norm <= 1.01)) {
          diagnostics.add(node.at, "'attitude_wxyz' has norm " + toml_number(norm) + ", must be 1");
          return;
        }
        pose(out).attitude_wxyz = q;
      },
      [pose](const T& in) -> std::optional<std::string> {
        if (!pose(in).attitude_wxyz) {
          return std::nullopt;
        }
        return toml_vector(pose(in).attitude_wxyz->data(), 4);
      }));
}

/// Rotation of a model in its body; the file says degrees, the draft holds radians.
Key<ObjectDraft> model_rotation() {
  return custom<ObjectDraft>(
      {"model_rotation_deg", "array of 3 floats", "deg", "-360 .. 360",
       "Rotation of the model in its body: heading (nose to the right), pitch (nose up), roll "
       "(right side down). [90, 0, 0] turns +x forward.",
       false},
      [](ObjectDraft& out, const Node& node, Diagnostics& diagnostics) {
        double values_deg[3] = {0.0, 0.0, 0.0};
        const std::size_t faults = diagnostics.size();
        read_vector(node, "model_rotation_deg", 3, values_deg, diagnostics);
        if (diagnostics.size() != faults) {
          return;
        }
        for (const double value_deg : values_deg) {
          if (!(std::abs(value_deg) <= 360.0)) {
            diagnostics.add(node.at, "'model_rotation_deg' holds " + toml_number(value_deg) +
                                         ", must be -360 .. 360");
            return;
          }
        }
        out.desc.model_rotation_rad =
            glm::dvec3(values_deg[0], values_deg[1], values_deg[2]) * kDegree;
      },
      [](const ObjectDraft& in) -> std::optional<std::string> {
        const glm::dvec3& angles_rad = in.desc.model_rotation_rad;
        return "[" + unscaled_number(angles_rad.x, kDegree) + ", " +
               unscaled_number(angles_rad.y, kDegree) + ", " +
               unscaled_number(angles_rad.z, kDegree) + "]";
      });
}

/// Reads "#rrggbb"; false: the text is something else.
bool read_colour(std::string_view text, std::array<std::uint8_t, 3>& rgb) {
  if (text.size() != 7 || text[0] != '#') return false;
  for (std::size_t i = 0; i < 3; ++i) {
    const char* first = text.data() + 1 + 2 * i;
    if (std::from_chars(first, first + 2, rgb[i], 16).ptr != first + 2) return false;
  }
  return true;
}

template <class T>
void append_trajectory_keys(KeyTable<T>& keys) {
  keys.push_back(custom<T>(
      {"trajectory", "array of tables", "", "ascending in time",
       "Keyframes: linear in position, shortest arc in attitude. See `trajectory` below.", false},
      [](T& out, const Node& node, Diagnostics& diagnostics) {
        read_array(node, "trajectory", keyframe_keys(), KeyframeDraft{}, out.trajectory,
                   diagnostics);
      },
      [](const T& in) { return write_array(in.trajectory, keyframe_keys()); }));
  keys.push_back(path<T>(
      "trajectory_file", EMIT_FIELD(trajectory_file),
      "CSV `time_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg,on` (`on` optional) in place of "
      "`trajectory`."));
}

}  // namespace

const KeyTable<InstanceDraft>& instance_keys() {
  static const KeyTable<InstanceDraft> keys = [] {
    KeyTable<InstanceDraft> table;
    append_pose_keys<InstanceDraft>(table, EMIT_FIELD(pose), "the instance");
    return table;
  }();
  return keys;
}

const KeyTable<scene::MaterialImage>& material_image_keys() {
  using scene::MaterialImage;
  static const KeyTable<MaterialImage> keys = {
      required(text<MaterialImage>("material", EMIT_FIELD(gltf_material),
                                   "glTF material whose surfaces the image parts.")),
      path<MaterialImage>("image", EMIT_FIELD(image),
                          "PNG or JPEG image, which lies on the surface as the base colour of the "
                          "file does. Absent: that base colour."),
      required(custom<MaterialImage>(
          {"legend", "table", "", "1 to 64 colours",
           "Colour of the image (`\"#rrggbb\"`, sRGB) = material of the library.", false},
          [](MaterialImage& out, const Node& node, Diagnostics& diagnostics) {
            if (!expect_table(node, "legend", diagnostics)) return;
            for (const Member& member : node.members) {
              scene::MaterialColour colour;
              if (!read_colour(member.key, colour.rgb)) {
                diagnostics.add(member.value.at, fmt::format("'legend': '{}' is not a colour, must "
                                                             "be \"#rrggbb\" in hexadecimal digits",
                                                             member.key));
                continue;
              }
              read_text(member.value, member.key, colour.material, diagnostics);
              out.legend.push_back(std::move(colour));
            }
            std::ranges::sort(out.legend);
          },
          [](const MaterialImage& in) -> std::optional<std::string> {
            std::string out = "{";
            for (const scene::MaterialColour& colour : in.legend) {
              out += fmt::format("{} \"#{:02x}{:02x}{:02x}\" = {}", out.size() > 1 ? "," : "",
                                 colour.rgb[0], colour.rgb[1], colour.rgb[2],
                                 toml_string(colour.material));
            }
            return out + " }";
          })),
      integer<MaterialImage>("smallest_patch_px", "px", 1, 1000000, EMIT_FIELD(smallest_patch_px),
                             "Patches of fewer texels take the material around them."),
  };
  return keys;
}

const KeyTable<KeyframeDraft>& keyframe_keys() {
  static const KeyTable<KeyframeDraft> keys = [] {
    KeyTable<KeyframeDraft> table = {
        required(nanoseconds<KeyframeDraft>("time_s", "s", 1e9, between(-1e9, 1e9),
                                            EMIT_FIELD(time_ns), "Sim time; ascending.")),
    };
    append_pose_keys<KeyframeDraft>(table, EMIT_FIELD(pose), "the body");
    table.push_back(
        boolean<KeyframeDraft>("on", EMIT_FIELD(on), "Present from here until the next keyframe."));
    table.push_back(
        boolean<KeyframeDraft>("teleport", EMIT_FIELD(teleport),
                               "A jump: nothing is interpolated from the keyframe before."));
    return table;
  }();
  return keys;
}

const KeyTable<PartCommandDraft>& part_command_keys() {
  static const KeyTable<PartCommandDraft> keys = {
      required(nanoseconds<PartCommandDraft>("time_s", "s", 1e9, between(-1e9, 1e9),
                                             EMIT_FIELD(time_ns), "Sim time; ascending.")),
      number<PartCommandDraft>("temperature_k", "K", between(50, 3000), EMIT_FIELD(temperature_k),
                               "Temperature at which the skin is held."),
      number<PartCommandDraft>("power_w_m2", "W m-2", between(0, 1e6), EMIT_FIELD(power_w_m2),
                               "Power into the skin."),
      number<PartCommandDraft>("throttle", "", between(0, 1), EMIT_FIELD(throttle),
                               "0: idle_k, 1: full_k, reached with up_s and down_s."),
      boolean<PartCommandDraft>("off", EMIT_FIELD(off),
                                "A part with idle_k and full_k cools to cold_k with down_s; the "
                                "skin of another is let go."),
  };
  return keys;
}

const KeyTable<PartDraft>& part_keys() {
  static const KeyTable<PartDraft> keys = {
      integer<PartDraft>("id", "", 1, 65535, EMIT_FIELD(desc.id),
                         "Number by which hosts name the part; absent: its place in the list, "
                         "from 1 on."),
      required(text<PartDraft>("name", EMIT_FIELD(desc.name), "Name, unique in the object.")),
      required(text<PartDraft>("material", EMIT_FIELD(desc.material),
                               "Library material. All surfaces of the object with it are the "
                               "part.")),
      number<PartDraft>("idle_k", "K", between(50, 3000), EMIT_FIELD(idle_k),
                        "Temperature behind the skin at throttle 0; with full_k."),
      number<PartDraft>("full_k", "K", between(50, 3000), EMIT_FIELD(full_k),
                        "Temperature behind the skin at throttle 1; with idle_k."),
      number<PartDraft>("cold_k", "K", between(50, 3000), EMIT_FIELD(desc.curve.cold_k),
                        "Temperature behind the skin before the first command and long after off."),
      number<PartDraft>("up_s", "s", between(0, 1e6), EMIT_FIELD(desc.curve.up_s),
                        "Time constant of warming; 0: at once."),
      number<PartDraft>("down_s", "s", between(0, 1e6), EMIT_FIELD(desc.curve.down_s),
                        "Time constant of cooling; 0: at once."),
      custom<PartDraft>(
          {"commands", "array of tables", "", "ascending in time",
           "What drives the part: see `commands` below. Nothing does before the first.", false},
          [](PartDraft& out, const Node& node, Diagnostics& diagnostics) {
            read_array(node, "commands", part_command_keys(), PartCommandDraft{}, out.commands,
                       diagnostics);
          },
          [](const PartDraft& in) { return write_array(in.commands, part_command_keys()); }),
  };
  return keys;
}

const KeyTable<scene::ContactDesc>& contact_keys() {
  using scene::ContactDesc;
  static const KeyTable<ContactDesc> keys = {
      required(custom<ContactDesc>(
          {"between", "array of 2 strings", "", "",
           "The two bodies, each by the name of its object or of its material.", false},
          [](ContactDesc& out, const Node& node, Diagnostics& diagnostics) {
            const bool pair = node.kind == Node::Kind::array && node.items.size() == 2 &&
                              std::ranges::all_of(node.items, [](const Node& item) {
                                return item.kind == Node::Kind::text;
                              });
            if (!pair) {
              diagnostics.add(node.at, "'between' must be an array of two names");
              return;
            }
            for (std::size_t i = 0; i < 2; ++i) out.between[i] = node.items[i].text;
          },
          [](const ContactDesc& in) -> std::optional<std::string> {
            return "[" + toml_string(in.between[0]) + ", " + toml_string(in.between[1]) + "]";
          })),
      required(number<ContactDesc>("resistance_m2_k_w", "m2 K W-1", above_to(0, 1e6),
                                   EMIT_FIELD(resistance_m2k_w),
                                   "Thermal resistance of the joint: 1e-4 stands for metal pressed "
                                   "on metal, 0.03 for 1 mm of foam, 1e6 for no contact.")),
  };
  return keys;
}

const KeyTable<ObjectDraft>& object_keys() {
  static const KeyTable<ObjectDraft> keys = [] {
    KeyTable<ObjectDraft> table = {
        text<ObjectDraft>("name", EMIT_FIELD(desc.name), "Unique name; the file's name if absent."),
        integer<ObjectDraft>("entity_id", "", 0, 4294967295, EMIT_FIELD(desc.entity_id),
                             "0: static scenery. Otherwise a moving entity that host frames "
                             "address; unique."),
        required(path<ObjectDraft>("gltf", EMIT_FIELD(desc.gltf), "glTF 2.0 file (.glb, .gltf).")),
        text<ObjectDraft>("material", EMIT_FIELD(desc.material),
                          "Material of all glTF materials that material_map does not list. Empty: "
                          "the one of the same name, else default_material."),
        custom<ObjectDraft>(
            {"material_map", "table", "", "", "glTF material name = material of the library.",
             false},
            [](ObjectDraft& out, const Node& node, Diagnostics& diagnostics) {
              if (!expect_table(node, "material_map", diagnostics)) {
                return;
              }
              for (const Member& member : node.members) {
                read_text(member.value, member.key, out.desc.material_map[member.key], diagnostics);
              }
            },
            [](const ObjectDraft& in) -> std::optional<std::string> {
              if (in.desc.material_map.empty()) {
                return std::nullopt;
              }
              std::string out = "{";
              for (const auto& [gltf_name, material] : in.desc.material_map) {
                out += (out.size() > 1 ? ", " : " ") + toml_string(gltf_name) + " = " +
                       toml_string(material);
              }
              return out + " }";
            }),
        custom<ObjectDraft>(
            {"material_images", "array of tables", "", "",
             "Images that give surfaces several materials; see `material_images` below.", false},
            [](ObjectDraft& out, const Node& node, Diagnostics& diagnostics) {
              read_array(node, "material_images", material_image_keys(), scene::MaterialImage{},
                         out.desc.material_images, diagnostics);
            },
            [](const ObjectDraft& in) {
              return write_array(in.desc.material_images, material_image_keys());
            }),
        number<ObjectDraft>("scale", "", above_to(0, 1e6), EMIT_FIELD(desc.scale),
                            "Uniform scale of the geometry."),
        model_rotation(),
        vector3<ObjectDraft>(
            "model_offset_m", "m", EMIT_FIELD(desc.model_offset_m),
            "Offset of the model's origin in its body: forward, right, down, after "
            "scale and rotation."),
        boolean<ObjectDraft>("on", EMIT_FIELD(desc.on),
                             "Entities: present until host or trajectory says otherwise."),
        choice<ObjectDraft>("air_film",
                            std::vector<std::pair<std::string, physics::AirFilmShape>>{
                                {"surface", physics::AirFilmShape::surface},
                                {"plate", physics::AirFilmShape::plate},
                                {"cylinder", physics::AirFilmShape::cylinder}},
                            EMIT_FIELD(desc.air_film.shape),
                            "Entities: flow of the film. surface: in the wind, a plate above Mach "
                            "0.3; plate: along "
                            "the flow; cylinder: across it."),
        number<ObjectDraft>("air_film_m", "m", between(0, 1000), EMIT_FIELD(desc.air_film.length_m),
                            "Entities: length of that flow, the diameter of a cylinder. 0: the "
                            "longest side of the geometry."),
        number<ObjectDraft>("interior_heat_j_m2_k", "J m-2 K-1", between(100, 1e7),
                            EMIT_FIELD(desc.interior.heat_j_m2_k),
                            "Heat capacity of the interior behind faces whose material rests on "
                            "`body`, by area of these faces."),
        number<ObjectDraft>("interior_ventilation_w_m2_k", "W m-2 K-1", between(0, 1000),
                            EMIT_FIELD(desc.interior.ventilation_w_m2_k),
                            "Exchange of air between that interior and the outside, by area of the "
                            "same faces."),
    };
    append_pose_keys<ObjectDraft>(table, EMIT_FIELD(pose), "the object");
    table.push_back(custom<ObjectDraft>(
        {"instances", "array of tables", "", "",
         "Many placements in place of position and angles; see `instances` below. Static scenery "
         "only.",
         false},
        [](ObjectDraft& out, const Node& node, Diagnostics& diagnostics) {
          read_array(node, "instances", instance_keys(), InstanceDraft{}, out.instances,
                     diagnostics);
        },
        [](const ObjectDraft& in) { return write_array(in.instances, instance_keys()); }));
    append_trajectory_keys(table);
    table.push_back(custom<ObjectDraft>(
        {"parts", "array of tables", "", "",
         "Entities: parts that heat themselves, such as an exhaust; see `parts` below.", false},
        [](ObjectDraft& out, const Node& node, Diagnostics& diagnostics) {
          read_array(node, "parts", part_keys(), PartDraft{}, out.parts, diagnostics);
        },
        [](const ObjectDraft& in) { return write_array(in.parts, part_keys()); }));
    return table;
  }();
  return keys;
}

SensorDraft default_sensor() {
  SensorDraft draft;
  draft.desc.name = "seeker";
  draft.desc.fov_h_rad = 20.0 * kDegree;
  return draft;
}

const KeyTable<SensorDraft>& sensor_keys() {
  static const KeyTable<SensorDraft> keys = [] {
    KeyTable<SensorDraft> table = {
        text<SensorDraft>("name", EMIT_FIELD(desc.name), "Name in the frames' attributes."),
        integer<SensorDraft>("width_px", "px", 1, 8192, EMIT_FIELD(desc.width_px), "Columns."),
        integer<SensorDraft>("height_px", "px", 1, 8192, EMIT_FIELD(desc.height_px), "Rows."),
        number<SensorDraft>("fov_h_deg", "deg", between(0.01, 170), EMIT_FIELD(desc.fov_h_rad),
                            "Horizontal field of view; pixels are square. Hosts may set a "
                            "narrower one.",
                            kDegree),
        number<SensorDraft>("fov_h_min_deg", "deg", between(0, 170), EMIT_FIELD(desc.fov_h_min_rad),
                            "Narrowest field of view that hosts may set; the surface is prepared "
                            "for its pixels. 0: they may set none.",
                            kDegree),
        number<SensorDraft>("near_m", "m", between(1e-4, 1e4), EMIT_FIELD(desc.near_m),
                            "Distance of the near plane; nothing closer is drawn."),
        number<SensorDraft>("small_target_px", "px", between(0, scene::kMaxSmallTargetPx),
                            EMIT_FIELD(desc.small_target_px),
                            "Entities whose image is at most this wide and high are averaged over "
                            "the pixels they cover (physics.md section 12). 0: none."),
    };
    append_pose_keys<SensorDraft>(table, EMIT_FIELD(pose), "a sensor that does not move");
    append_trajectory_keys(table);
    return table;
  }();
  return keys;
}

}  // namespace emit::config
