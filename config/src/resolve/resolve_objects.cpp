// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <set>
#include <string>

#include "resolve.hpp"

namespace emit::config {

using physics::Pose;
using scene::Keyframe;
using scene::Material;
using scene::ObjectDesc;
using scene::Trajectory;

namespace {

constexpr std::string_view kPoseKeys[] = {"position_m", "heading_deg", "pitch_deg",
                                          "roll_deg",   "look_at_m",   "attitude_wxyz"};

const Member* first_pose_key(const Node& node) {
  for (const std::string_view key : kPoseKeys) {
    if (const Member* member = node.find_member(key)) {
      return member;
    }
  }
  return nullptr;
}

Pose resolve_pose(const PoseDraft& draft, const Node& node, Diagnostics& diagnostics) {
  Pose pose;
  pose.position_world_m = draft.position_m;
  const bool angles = node.has("heading_deg") || node.has("pitch_deg") || node.has("roll_deg");
  if (static_cast<int>(angles) + static_cast<int>(draft.look_at_m.has_value()) +
          static_cast<int>(draft.attitude_wxyz.has_value()) >
      1) {
    diagnostics.add(
        key_location(node, draft.look_at_m ? "look_at_m" : "attitude_wxyz"),
        "use only one of 'look_at_m', 'attitude_wxyz' and heading_deg, pitch_deg, roll_deg");
    return pose;
  }
  if (draft.attitude_wxyz) {
    const std::array<double, 4>& q = *draft.attitude_wxyz;
    const double norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    // One that is already unit within rounding stays as it is, so that printing and loading
    // again gives the same bits.
    const double scale = std::abs(norm2 - 1.0) < 1e-12 ? 1.0 : 1.0 / std::sqrt(norm2);
    pose.world_from_body = glm::dquat(q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale);
  } else if (draft.look_at_m) {
    if (glm::distance(*draft.look_at_m, draft.position_m) < 1e-6) {
      diagnostics.add(key_location(node, "look_at_m"), "'look_at_m' is the position itself");
      return pose;
    }
    pose.world_from_body = physics::world_from_body_look_at(draft.position_m, *draft.look_at_m);
  } else {
    pose.world_from_body = physics::world_from_body_heading_pitch_roll(
        draft.heading_rad, draft.pitch_rad, draft.roll_rad);
  }
  return pose;
}

/// `drafts` as read from node["trajectory"], or the file named by trajectory_file.
Trajectory resolve_trajectory(const std::vector<KeyframeDraft>& drafts,
                              const std::filesystem::path& file, const Node& node,
                              Diagnostics& diagnostics) {
  if (node.has("trajectory") && node.has("trajectory_file")) {
    diagnostics.add(key_location(node, "trajectory_file"),
                    "use only one of 'trajectory' and 'trajectory_file'");
    return {};
  }
  if (!file.empty()) {
    auto loaded = load_trajectory_csv(file);
    if (!loaded) {
      report_file_error(loaded.error(), node, "trajectory_file", diagnostics);
      return {};
    }
    return std::move(*loaded);
  }
  Trajectory out;
  const Node* list = node.find("trajectory");
  if (list != nullptr && list->items.size() != drafts.size()) {
    return {};  // reported while reading
  }
  for (std::size_t i = 0; i < drafts.size(); ++i) {
    const Node& item = list->items[i];
    Keyframe keyframe;
    keyframe.sim_time_ns = drafts[i].time_ns;
    keyframe.pose = resolve_pose(drafts[i].pose, item, diagnostics);
    keyframe.on = drafts[i].on;
    keyframe.teleport = drafts[i].teleport;
    if (!out.empty() && item.has("time_s") && keyframe.sim_time_ns <= out.back().sim_time_ns) {
      diagnostics.add(key_location(item, "time_s"),
                      "'time_s' is not later than in the keyframe before");
    }
    out.push_back(keyframe);
  }
  return out;
}

void resolve_placement(const ObjectDraft& draft, const Node& node, ObjectDesc& desc,
                       Diagnostics& diagnostics) {
  const Member* pose_key = first_pose_key(node);
  const bool entity = desc.entity_id != 0;
  if (const Node* list = node.find("instances")) {
    if (pose_key != nullptr) {
      diagnostics.add(pose_key->key_at,
                      fmt::format("use only one of '{}' and 'instances'", pose_key->key));
    } else if (entity) {
      diagnostics.add(list->at,
                      "an entity has exactly one placement: 'instances' is for static "
                      "scenery");
    } else if (list->items.empty()) {
      diagnostics.add(list->at, "'instances' needs at least one placement");
    }
    for (std::size_t i = 0; i < draft.instances.size() && i < list->items.size(); ++i) {
      desc.instances.push_back(resolve_pose(draft.instances[i].pose, list->items[i], diagnostics));
    }
    return;
  }
  // A trajectory alone places the entity; its first pose holds from the beginning anyway.
  const bool from_trajectory = pose_key == nullptr && !desc.trajectory.empty();
  desc.instances = {from_trajectory ? desc.trajectory.front().pose
                                    : resolve_pose(draft.pose, node, diagnostics)};
}

/// ASCII letters only: an ending in another script is none that is read.
std::string in_lower_case(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

std::string unique_name(const std::string& stem, const std::vector<ObjectDesc>& objects) {
  std::string name = stem;
  for (int i = 2; std::any_of(objects.begin(), objects.end(),
                              [&name](const ObjectDesc& other) { return other.name == name; });
       ++i) {
    name = fmt::format("{}_{}", stem, i);
  }
  return name;
}

/// Commands of a part, from the items of its list `commands`.
std::vector<scene::TimedPartCommand> resolve_commands(const PartDraft& draft, const Node& node,
                                                      Diagnostics& diagnostics) {
  using Kind = scene::PartCommand::Kind;
  std::vector<scene::TimedPartCommand> out;
  const Node* list = node.find("commands");
  if (list == nullptr || list->items.size() != draft.commands.size()) {
    return out;  // absent, or reported while reading
  }
  for (std::size_t i = 0; i < draft.commands.size(); ++i) {
    const PartCommandDraft& in = draft.commands[i];
    const Node& item = list->items[i];
    std::vector<scene::PartCommand> given;
    if (in.temperature_k) given.push_back({Kind::temperature, *in.temperature_k});
    if (in.power_w_m2) given.push_back({Kind::power, *in.power_w_m2});
    if (in.throttle) given.push_back({Kind::throttle, *in.throttle});
    if (in.off) given.push_back({Kind::off, 0.0});
    if (given.size() != 1) {
      diagnostics.add(item.at,
                      "a command needs exactly one of 'temperature_k', 'power_w_m2', 'throttle' "
                      "and 'off = true'");
      continue;
    }
    if (in.throttle && !(draft.idle_k && draft.full_k)) {
      diagnostics.add(
          key_location(item, "throttle"),
          fmt::format("'throttle' needs idle_k and full_k of part '{}'", draft.desc.name));
    }
    if (!out.empty() && in.time_ns <= out.back().sim_time_ns) {
      diagnostics.add(key_location(item, "time_s"),
                      "'time_s' is not later than in the command before");
    }
    out.push_back({in.time_ns, given.front()});
  }
  return out;
}

/// Parts of an object, from the items of its list `parts`.
std::vector<scene::PartDesc> resolve_parts(const ObjectDraft& draft, const Node& node,
                                           const std::vector<Material>& materials,
                                           Diagnostics& diagnostics) {
  std::vector<scene::PartDesc> out;
  const Node* list = node.find("parts");
  if (list == nullptr || list->items.size() != draft.parts.size()) {
    return out;  // absent, or reported while reading
  }
  if (draft.desc.entity_id == 0) {
    diagnostics.add(key_location(node, "parts"),
                    "'parts' needs an entity_id: static scenery does not heat itself");
  }
  for (std::size_t i = 0; i < draft.parts.size(); ++i) {
    const PartDraft& in = draft.parts[i];
    const Node& item = list->items[i];
    scene::PartDesc part = in.desc;
    if (item.find("id") == nullptr) part.id = static_cast<std::uint32_t>(i + 1);
    check_material_name(part.material, materials, key_location(item, "material"), diagnostics);
    for (const Material& material : materials) {
      if (material.name == part.material && material.prescribed_k) {
        diagnostics.add(key_location(item, "material"),
                        fmt::format("material '{}' has prescribed_k, so that no command has an "
                                    "effect on it",
                                    part.material));
      }
    }
    for (const scene::PartDesc& other : out) {
      if (other.id == part.id || other.name == part.name || other.material == part.material) {
        diagnostics.add(item.at, fmt::format("part '{}' has the id, name or material of part '{}'",
                                             part.name, other.name));
      }
    }
    if (in.idle_k.has_value() != in.full_k.has_value()) {
      diagnostics.add(item.at, "'idle_k' and 'full_k' go together");
    }
    part.curve.given = in.idle_k && in.full_k;
    part.curve.idle_k = in.idle_k.value_or(0.0);
    part.curve.full_k = in.full_k.value_or(0.0);
    part.commands = resolve_commands(in, item, diagnostics);
    out.push_back(std::move(part));
  }
  return out;
}

/// Reports images of materials that no scene can have.
void check_material_images(const ObjectDesc& desc, const Node& node,
                           const std::vector<Material>& materials, bool require_files,
                           Diagnostics& diagnostics) {
  const Node* images = node.find("material_images");
  if (images == nullptr || images->kind != Node::Kind::array) return;
  std::set<std::string> names;
  for (std::size_t i = 0; i < std::min(images->items.size(), desc.material_images.size()); ++i) {
    const Node& item = images->items[i];
    const scene::MaterialImage& image = desc.material_images[i];
    if (image.gltf_material.empty() && item.has("material")) {
      diagnostics.add(key_location(item, "material"),
                      "'material' must name a material of the glTF file");
    } else if (!names.insert(image.gltf_material).second) {
      diagnostics.add(key_location(item, "material"),
                      fmt::format("material '{}' has two images", image.gltf_material));
    }
    std::error_code code;
    if (require_files && !image.image.empty() &&
        !std::filesystem::is_regular_file(image.image, code)) {
      diagnostics.add(key_location(item, "image"),
                      fmt::format("'image': {}: no such file", image.image.string()));
    }
    const Node* legend = item.find("legend");
    if (legend == nullptr || legend->kind != Node::Kind::table) continue;
    constexpr std::size_t kMostColours = 64;
    if (legend->members.empty() || legend->members.size() > kMostColours) {
      diagnostics.add(key_location(item, "legend"),
                      fmt::format("'legend' has {} colours, must have 1 to {}",
                                  legend->members.size(), kMostColours));
    }
    for (std::size_t k = 0; k + 1 < image.legend.size(); ++k) {
      if (image.legend[k].rgb == image.legend[k + 1].rgb) {
        diagnostics.add(key_location(item, "legend"), "'legend' has a colour twice");
      }
    }
    for (const Member& member : legend->members) {
      if (member.value.kind == Node::Kind::text) {
        check_material_name(member.value.text, materials, member.value.at, diagnostics);
      }
    }
  }
}

ObjectDesc resolve_object(const Node& node, const std::vector<ObjectDesc>& before,
                          const std::vector<Material>& materials, bool require_files,
                          Diagnostics& diagnostics) {
  ObjectDraft draft;
  read_table(node, object_keys(), draft, diagnostics);
  ObjectDesc desc = draft.desc;
  if (desc.name.empty()) {
    desc.name = unique_name(desc.gltf.stem().string(), before);
  }
  for (const ObjectDesc& other : before) {
    if (other.name == desc.name) {
      diagnostics.add(key_location(node, "name"),
                      fmt::format("object '{}' is defined twice", desc.name));
    }
    if (desc.entity_id != 0 && other.entity_id == desc.entity_id) {
      diagnostics.add(
          key_location(node, "entity_id"),
          fmt::format("entity_id {} is already that of object '{}'", desc.entity_id, other.name));
    }
  }
  if (node.has("gltf")) {
    std::error_code code;
    const std::string extension = in_lower_case(desc.gltf.extension().string());
    if (desc.gltf.empty() || (extension != ".glb" && extension != ".gltf")) {
      diagnostics.add(key_location(node, "gltf"), "'gltf' must name a .glb or .gltf file");
    } else if (require_files && !std::filesystem::is_regular_file(desc.gltf, code)) {
      diagnostics.add(key_location(node, "gltf"),
                      fmt::format("'gltf': {}: no such file", desc.gltf.string()));
    }
  }
  if (!desc.material.empty()) {
    check_material_name(desc.material, materials, key_location(node, "material"), diagnostics);
  }
  if (const Node* map = node.find("material_map");
      map != nullptr && map->kind == Node::Kind::table) {
    for (const Member& member : map->members) {
      check_material_name(desc.material_map[member.key], materials, member.value.at, diagnostics);
    }
  }
  check_material_images(desc, node, materials, require_files, diagnostics);
  desc.trajectory = resolve_trajectory(draft.trajectory, draft.trajectory_file, node, diagnostics);
  if (desc.entity_id == 0) {
    for (const std::string_view key : {"trajectory", "trajectory_file"}) {
      if (node.has(key)) {
        diagnostics.add(key_location(node, key),
                        fmt::format("'{}' needs an entity_id: static scenery does not move", key));
      }
    }
    if (!desc.on) {
      diagnostics.add(key_location(node, "on"),
                      "'on' needs an entity_id: static scenery is always on");
    }
  }
  resolve_placement(draft, node, desc, diagnostics);
  desc.parts = resolve_parts(draft, node, materials, diagnostics);
  return desc;
}

}  // namespace

void check_material_name(const std::string& name, const std::vector<Material>& materials,
                         const Location& at, Diagnostics& diagnostics) {
  std::vector<std::string_view> names;
  for (const Material& material : materials) {
    if (material.name == name) {
      return;
    }
    names.push_back(material.name);
  }
  diagnostics.add(at, fmt::format("there is no material '{}'{}", name, did_you_mean(name, names)));
}

std::vector<ObjectDesc> resolve_objects(const Node& root, const std::vector<Material>& materials,
                                        bool require_files, Diagnostics& diagnostics) {
  std::vector<ObjectDesc> objects;
  for (const Node& node : section_array(root, "object", diagnostics)) {
    objects.push_back(resolve_object(node, objects, materials, require_files, diagnostics));
  }
  return objects;
}

scene::SensorDesc resolve_sensor(const Node& root, Diagnostics& diagnostics) {
  const Node& node = section(root, "sensor", diagnostics);
  SensorDraft draft = default_sensor();
  read_table(node, sensor_keys(), draft, diagnostics);
  scene::SensorDesc desc = draft.desc;
  if (desc.name.empty()) {
    diagnostics.add(key_location(node, "name"), "'name' is empty");
  }
  desc.trajectory = resolve_trajectory(draft.trajectory, draft.trajectory_file, node, diagnostics);
  for (std::size_t i = 0; i < desc.trajectory.size(); ++i) {
    if (!desc.trajectory[i].on) {
      diagnostics.add(key_location(node, node.has("trajectory") ? "trajectory" : "trajectory_file"),
                      "a sensor is always on: its keyframes take no on = false");
      break;
    }
  }
  if (const Member* pose_key = first_pose_key(node)) {
    if (node.has("trajectory") || node.has("trajectory_file")) {
      diagnostics.add(pose_key->key_at,
                      fmt::format("'{}' has no effect beside a trajectory", pose_key->key));
    } else {
      desc.trajectory.push_back({0, resolve_pose(draft.pose, node, diagnostics), true, false});
    }
  }
  return desc;
}

std::vector<scene::ContactDesc> resolve_contacts(const Node& root,
                                                 const std::vector<scene::ObjectDesc>& objects,
                                                 const std::vector<scene::Material>& materials,
                                                 Diagnostics& diagnostics) {
  std::vector<scene::ContactDesc> contacts;
  if (!root.has("contact")) return contacts;
  std::vector<std::string> known;
  for (const scene::ObjectDesc& object : objects) known.push_back(object.name);
  for (const scene::Material& material : materials) known.push_back(material.name);
  for (const Node& node : section_array(root, "contact", diagnostics)) {
    scene::ContactDesc contact;
    const std::size_t faults = diagnostics.size();
    read_table(node, contact_keys(), contact, diagnostics);
    if (diagnostics.size() != faults) continue;
    for (const std::string& name : contact.between) {
      if (std::ranges::find(known, name) != known.end()) continue;
      diagnostics.add(key_location(node, "between"),
                      fmt::format("no object and no material is named '{}'{}", name,
                                  did_you_mean(name, known)));
    }
    contacts.push_back(std::move(contact));
  }
  return contacts;
}

}  // namespace emit::config
