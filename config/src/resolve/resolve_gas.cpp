// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "resolve.hpp"

namespace emit::config {
namespace {

/// Objects and bands that gas may name.
struct Known {
  const std::vector<scene::ObjectDesc>& objects;
  const std::vector<std::string>& bands;

  [[nodiscard]] const scene::ObjectDesc* object(const std::string& name) const {
    const auto found = std::ranges::find(objects, name, &scene::ObjectDesc::name);
    return found == objects.end() ? nullptr : &*found;
  }
};

/// Reports a source that no object or more than one placement carries.
void check_object(const Node& node, const std::string& name, const Known& known,
                  Diagnostics& diagnostics) {
  if (name.empty()) return;
  const scene::ObjectDesc* object = known.object(name);
  if (object == nullptr) {
    std::vector<std::string> names;
    for (const scene::ObjectDesc& entry : known.objects) names.push_back(entry.name);
    diagnostics.add(key_location(node, "object"),
                    fmt::format("no object is named '{}'{}", name, did_you_mean(name, names)));
  } else if (object->instances.size() != 1) {
    diagnostics.add(key_location(node, "object"),
                    fmt::format("object '{}' stands in {} places: gas needs an object with one",
                                name, object->instances.size()));
  }
}

void check_bands(const Node& node, std::string_view key,
                 const std::vector<scene::BandValue>& values, const Known& known,
                 Diagnostics& diagnostics) {
  for (const scene::BandValue& entry : values) {
    if (std::ranges::find(known.bands, entry.band) != known.bands.end()) continue;
    diagnostics.add(key_location(node, key),
                    fmt::format("'{}': there is no band '{}'{}", key, entry.band,
                                did_you_mean(entry.band, known.bands)));
  }
}

void check(const Node& node, scene::PlumeDesc& plume, const Known& known,
           Diagnostics& diagnostics) {
  // Idle is full power where the file says nothing else.
  if (!node.has("idle_exit_k")) plume.idle.exit_k = plume.full.exit_k;
  if (!node.has("idle_exit_m_s")) plume.idle.exit_m_s = plume.full.exit_m_s;
  if (!(glm::length(plume.direction_body) > 0.0)) {
    diagnostics.add(key_location(node, "direction"), "'direction' has no length");
  }
  if (plume.exhaust.co2_frac + plume.exhaust.h2o_frac > 1.0) {
    diagnostics.add(key_location(node, "h2o_frac"), "'co2_frac' and 'h2o_frac' add up to above 1");
  }
  const scene::ObjectDesc* object = known.object(plume.object);
  if (object == nullptr || plume.part.empty()) return;
  const auto part = std::ranges::find(object->parts, plume.part, &scene::PartDesc::name);
  if (part == object->parts.end()) {
    std::vector<std::string> names;
    for (const scene::PartDesc& entry : object->parts) names.push_back(entry.name);
    diagnostics.add(key_location(node, "part"),
                    fmt::format("object '{}' has no part '{}'{}", object->name, plume.part,
                                did_you_mean(plume.part, names)));
  } else if (!part->curve.given) {
    diagnostics.add(
        key_location(node, "part"),
        fmt::format("part '{}' takes no throttle: it has no 'idle_k' and 'full_k'", plume.part));
  }
}

/// True if an entity is off at some time of the scenario.
bool appears(const scene::ObjectDesc& object) {
  if (object.trajectory.empty()) return !object.on;
  return std::ranges::any_of(object.trajectory, [](const auto& key) { return !key.on; });
}

void check(const Node& node, scene::FlareDesc& flare, const Known& known,
           Diagnostics& diagnostics) {
  check_bands(node, "intensity_w_sr", flare.intensity_w_sr, known, diagnostics);
  const scene::ObjectDesc* object = known.object(flare.object);
  if (object != nullptr && object->entity_id == 0) {
    diagnostics.add(key_location(node, "object"),
                    fmt::format("object '{}' is no entity: a flare burns from the instant at "
                                "which its entity appears",
                                flare.object));
  } else if (object != nullptr && !appears(*object)) {
    diagnostics.add(key_location(node, "object"),
                    fmt::format("entity '{}' is there from the beginning, so that its flare has "
                                "burnt out before the first frame: give it on = false, or a "
                                "trajectory that begins with on = false",
                                flare.object));
  }
}

/// Reports a source that stops before it starts.
template <class Desc>
void check_times(const Node& node, const Desc& desc, Diagnostics& diagnostics) {
  if (desc.stop_ns > desc.start_ns) return;
  diagnostics.add(key_location(node, node.has("stop_s") ? "stop_s" : "start_s"),
                  "'stop_s' must be after 'start_s'");
}

void check(const Node& node, scene::SmokeDesc& smoke, const Known& known,
           Diagnostics& diagnostics) {
  check_bands(node, "band_extinction_m2_g", smoke.band_extinction_m2_g, known, diagnostics);
  check_bands(node, "band_albedo_frac", smoke.band_albedo_frac, known, diagnostics);
  check_times(node, smoke, diagnostics);
}

void check(const Node& node, scene::FireDesc& fire, const Known& /*known*/,
           Diagnostics& diagnostics) {
  check_times(node, fire, diagnostics);
}

template <class Desc>
std::vector<Desc> read_gas(const Node& root, const std::string& key, const KeyTable<Desc>& keys,
                           const Known& known, Diagnostics& diagnostics) {
  std::vector<Desc> out;
  if (!root.has(key)) return out;
  for (const Node& node : section_array(root, key, diagnostics)) {
    Desc desc;
    const std::size_t faults = diagnostics.size();
    read_table(node, keys, desc, diagnostics);
    if (diagnostics.size() == faults) {
      check_object(node, desc.object, known, diagnostics);
      check(node, desc, known, diagnostics);
    }
    if (desc.name.empty()) desc.name = fmt::format("{}_{}", key, out.size() + 1);
    out.push_back(std::move(desc));
  }
  return out;
}

}  // namespace

scene::GasDesc resolve_gas(const Node& root, const std::vector<scene::ObjectDesc>& objects,
                           const std::vector<std::string>& known_bands, Diagnostics& diagnostics) {
  const Known known{objects, known_bands};
  scene::GasDesc gas;
  gas.plumes = read_gas(root, "plume", plume_keys(), known, diagnostics);
  gas.flares = read_gas(root, "flare", flare_keys(), known, diagnostics);
  gas.smokes = read_gas(root, "smoke", smoke_keys(), known, diagnostics);
  gas.fires = read_gas(root, "fire", fire_keys(), known, diagnostics);
  if (gas.puffs() > scene::kMaxGasPuffs) {
    diagnostics.add(
        root.at,
        fmt::format("plumes, flares, smoke and fires take {} puffs of gas: {} are possible ({} a "
                    "plume, {} a flare, {} a smoke, {} a fire)",
                    gas.puffs(), scene::kMaxGasPuffs, scene::PlumeDesc::kPuffs,
                    scene::FlareDesc::kPuffs, scene::SmokeDesc::kPuffs, scene::FireDesc::kPuffs));
  }
  return gas;
}

}  // namespace emit::config
