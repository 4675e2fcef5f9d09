// SPDX-License-Identifier: Apache-2.0
#include "keys.hpp"

/// Keys of hosts that do not speak emitd's own messages.
namespace emit::config {
namespace {

constexpr std::int64_t kMaxId = 65535;

const KeyTable<CigiEntityConfig>& cigi_entity_keys() {
  static const KeyTable<CigiEntityConfig> keys = {
      required(integer<CigiEntityConfig>("id", "", 0, kMaxId, EMIT_FIELD(id),
                                         "Number that the host has for the entity.")),
      required(integer<CigiEntityConfig>("entity", "", 1, 4294967295, EMIT_FIELD(entity),
                                         "Number of the entity in the scenario.")),
  };
  return keys;
}

const KeyTable<CigiPartConfig>& cigi_part_keys() {
  constexpr std::int64_t kMaxPart = 255;
  static const KeyTable<CigiPartConfig> keys = {
      required(integer<CigiPartConfig>("id", "", 0, kMaxId, EMIT_FIELD(id),
                                       "Number that the host has for the entity of the part.")),
      required(integer<CigiPartConfig>("part", "", 0, kMaxPart, EMIT_FIELD(part),
                                       "Number that the host has for the part.")),
      required(integer<CigiPartConfig>("entity", "", 1, 4294967295, EMIT_FIELD(entity),
                                       "Number in the scenario, where the part is an entity.")),
      integer<CigiPartConfig>("on_part", "", -1, kMaxPart, EMIT_FIELD(on_part),
                              "Part that carries this one. -1: the entity does."),
      vector3<CigiPartConfig>("joint_m", "m", EMIT_FIELD(joint_m),
                              "Origin of the part in the axes of what carries it."),
      vector3<CigiPartConfig>("joint_yaw_pitch_roll_deg", "deg",
                              EMIT_FIELD(joint_yaw_pitch_roll_deg),
                              "Axes of the part at rest against those of what carries it."),
  };
  return keys;
}

const KeyTable<DisEntityConfig>& dis_entity_keys() {
  static const KeyTable<DisEntityConfig> keys = {
      required(text<DisEntityConfig>("id", EMIT_FIELD(id),
                                     "`site:application:entity` of the exercise.")),
      required(integer<DisEntityConfig>("entity", "", 1, 4294967295, EMIT_FIELD(entity),
                                        "Number of the entity in the scenario.")),
  };
  return keys;
}

}  // namespace

const KeyTable<DisConfig>& dis_keys() {
  static const KeyTable<DisConfig> keys = {
      text<DisConfig>("listen", EMIT_FIELD(listen),
                      "`address:port` for datagrams, by custom port 3000. When it is empty, there "
                      "is no exercise."),
      text<DisConfig>("group", EMIT_FIELD(group), "Multicast group to join."),
      integer<DisConfig>("exercise", "", 0, 255, EMIT_FIELD(exercise),
                         "Number of the exercise. 0: any."),
      text<DisConfig>("seeker", EMIT_FIELD(seeker),
                      "`site:application:entity` of the entity that carries the sensor."),
      number<DisConfig>("rate_hz", "Hz", between(1, 2000), EMIT_FIELD(rate_hz),
                        "Rate at which poses are predicted between PDUs. It should be that of the "
                        "frames or more."),
      number<DisConfig>("timeout_s", "s", between(0.1, 3600), EMIT_FIELD(timeout_s),
                        "An entity without a PDU for so long is hidden."),
      custom<DisConfig>(
          {"entities", "array of tables", "", "",
           "Entities of the exercise that the scenario has: `id`, `entity`.", false},
          [](DisConfig& out, const Node& node, Diagnostics& diagnostics) {
            read_array(node, "entities", dis_entity_keys(), DisEntityConfig{}, out.entities,
                       diagnostics);
          },
          [](const DisConfig& in) { return write_array(in.entities, dis_entity_keys()); }),
  };
  return keys;
}

const KeyTable<NetFdmConfig>& net_fdm_keys() {
  static const KeyTable<NetFdmConfig> keys = {
      text<NetFdmConfig>("listen", EMIT_FIELD(listen),
                         "`address:port` for datagrams. When it is empty, there is no model."),
  };
  return keys;
}

const KeyTable<CigiConfig>& cigi_keys() {
  static const KeyTable<CigiConfig> keys = {
      text<CigiConfig>("listen", EMIT_FIELD(listen),
                       "`address:port` for the messages of the host. When it is empty, there is no "
                       "such host."),
      text<CigiConfig>("host", EMIT_FIELD(host),
                       "`address:port` where the host listens. Messages of other addresses are "
                       "dropped."),
      number<CigiConfig>("rate_hz", "Hz", between(0.1, 2000), EMIT_FIELD(rate_hz),
                         "Start Of Frame a second with pacing mode host-step, which is CIGI's "
                         "synchronous operation. Other modes take `pacing.rate_hz`."),
      integer<CigiConfig>("seeker", "", 0, kMaxId, EMIT_FIELD(seeker),
                          "Entity of the host that carries the sensor."),
      integer<CigiConfig>("view", "", 0, kMaxId, EMIT_FIELD(view),
                          "View of the host that is the sensor. View Control mounts it on an "
                          "entity."),
      integer<CigiConfig>("database", "", 0, 127, EMIT_FIELD(database),
                          "Number of the scenario among the databases of the host. 0: emitd says "
                          "that databases are its own business."),
      custom<CigiConfig>(
          {"entities", "array of tables", "", "",
           "Entities whose number differs: `id` of the host, `entity` of the scenario. Others have "
           "one number in both.",
           false},
          [](CigiConfig& out, const Node& node, Diagnostics& diagnostics) {
            read_array(node, "entities", cigi_entity_keys(), CigiEntityConfig{}, out.entities,
                       diagnostics);
          },
          [](const CigiConfig& in) { return write_array(in.entities, cigi_entity_keys()); }),
      custom<CigiConfig>(
          {"parts", "array of tables", "", "at most 128",
           "Articulated parts: `id`, `part`, `entity`, `on_part`, `joint_m`, "
           "`joint_yaw_pitch_roll_deg`.",
           false},
          [](CigiConfig& out, const Node& node, Diagnostics& diagnostics) {
            read_array(node, "parts", cigi_part_keys(), CigiPartConfig{}, out.parts, diagnostics);
          },
          [](const CigiConfig& in) { return write_array(in.parts, cigi_part_keys()); }),
  };
  return keys;
}

}  // namespace emit::config
