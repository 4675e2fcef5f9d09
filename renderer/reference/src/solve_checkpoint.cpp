// SPDX-License-Identifier: Apache-2.0
#include "solve_checkpoint.hpp"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <fstream>
#include <span>
#include <system_error>

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::array<char, 16> kMagic{'e', 'm', 'i', 't', '-',  's', 'o', 'l',
                                      'v', 'e', ' ', '2', '\n', 0,   0,   0};

/// FNV-1a hash over the bytes of values.
class Hash {
 public:
  Hash& add(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < size; ++i) value_ = (value_ ^ bytes[i]) * 0x100000001b3ULL;
    return *this;
  }
  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T> Hash& add(const T& value) {
    return add(&value, sizeof(value));
  }
  Hash& add(const std::string& text) { return add(text.size()).add(text.data(), text.size()); }
  Hash& add(const std::optional<double>& value) {
    return add(value.has_value()).add(value.value_or(0.0));
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

/// Adds the properties of a material that determine the result.
void add_material(Hash& hash, const scene::Material& m) {
  hash.add(m.name).add(m.solar_absorptance_frac).add(m.emissivity_frac).add(m.base_k);
  hash.add(m.initial_k).add(m.prescribed_k).add(m.sheet).add(m.layers.size()).add(m.roughness);
  hash.add(m.leaf_width_m).add(m.leaf_area_index);
  hash.add(m.wetness_frac).add(m.surface_resistance_s_m).add(m.night_resistance_s_m);
  hash.add(m.water_store_mm).add(m.readily_evaporable_mm);
  for (const scene::Layer& l : m.layers) {
    hash.add(l.thickness_m)
        .add(l.conductivity_w_m_k)
        .add(l.density_kg_m3)
        .add(l.specific_heat_j_kg_k);
  }
}

/// Header of a checkpoint file. The temperatures and slopes follow it.
struct Header {
  std::array<char, 16> magic = kMagic;
  SolveFingerprint print;
  double time_s = 0.0;
  double step_s = 0.0;
  double flow_w = 0.0;
  double heat_in_j = 0.0;
  std::uint64_t has_slope = 0;
  SolidStats stats;
  SolidStats spin_up;
  std::uint64_t nodes = 0;
  std::uint64_t free_nodes = 0;
  std::uint64_t data_hash = 0;
};
static_assert(std::is_trivially_copyable_v<Header>);

/// Returns the hash that detects damage of the data.
std::uint64_t data_hash(const SolidState& state) {
  Hash hash;
  hash.add(state.node_k.data(), state.node_k.size() * sizeof(double));
  hash.add(state.slope_w.data(), state.slope_w.size() * sizeof(double));
  return hash.value();
}

/// Returns data as bytes.
template <class T>
const char* bytes_of(const T* data) {
  return static_cast<const char*>(static_cast<const void*>(data));
}
template <class T>
char* bytes_of(T* data) {
  return static_cast<char*>(static_cast<void*>(data));
}

}  // namespace

SolveFingerprint fingerprint(const scene::ScenarioDesc& scenario,
                             const scene::SceneGeometry& geometry, const SolveOptions& options,
                             std::int64_t end_ns) {
  // Hash place and date.
  SolveFingerprint print;
  print.place_and_date = Hash()
                             .add(scenario.place.lat_rad)
                             .add(scenario.place.lon_rad)
                             .add(scenario.place.height_m)
                             .add(scenario.epoch_utc_ns)
                             .value();
  // Hash the weather.
  Hash weather;
  const scene::ClearSky& sky = scenario.clear_sky;
  for (const double v : {sky.linke_turbidity, sky.air_mean_k, sky.air_amplitude_k, sky.dew_point_k,
                         sky.wind_m_s, sky.cloud_frac}) {
    weather.add(v);
  }
  weather.add(sky.wind_from_rad).add(sky.cloud_base.height_m).add(sky.cloud_base.kelvin);
  weather.add(sky.cloud_transmission_frac).add(scenario.clouds.has_value());
  if (scenario.clouds) {
    const physics::Clouds& c = *scenario.clouds;
    weather.add(c.cover_frac).add(c.base_m).add(c.transmission_frac).add(c.shortest_m);
    weather.add(c.longest_m).add(c.slope).add(c.seed).add(c.drift_m_s).add(c.drift_from_rad);
  }
  for (const scene::WeatherSample& w : scenario.weather) {
    weather.add(w.sim_time_ns).add(w.direct_normal_w_m2).add(w.diffuse_horizontal_w_m2);
    weather.add(w.longwave_down_w_m2).add(w.air_k).add(w.wind_m_s).add(w.cloud_frac);
    weather.add(w.environment_k).add(w.film_w_m2_k).add(w.wind_from_rad);
    weather.add(w.relative_humidity_frac).add(w.rain_mm_h);
  }
  print.weather = weather.value();
  // Hash the materials of the scene and of the surroundings.
  Hash materials;
  for (const scene::Material& m : geometry.materials) add_material(materials, m);
  const std::string& around = scenario.thermal.surroundings_material.empty()
                                  ? scenario.default_material
                                  : scenario.thermal.surroundings_material;
  for (const scene::Material& m : scenario.materials) {
    if (m.name == around) add_material(materials, m);
  }
  print.materials = materials.value();
  // Hash the geometry.
  Hash shape;
  for (const scene::Mesh& mesh : geometry.meshes) {
    shape.add(mesh.positions_m.data(), mesh.positions_m.size() * sizeof(glm::vec3));
    shape.add(mesh.indices.data(), mesh.indices.size() * sizeof(std::uint32_t));
    for (const scene::Submesh& s : mesh.submeshes) {
      shape.add(s.first_index).add(s.index_count).add(s.material).add(s.double_sided);
    }
  }
  for (const scene::Instance& instance : geometry.instances) {
    shape.add(instance.mesh).add(&instance.world_from_mesh, sizeof(glm::dmat4));
    shape.add(instance.object < scenario.objects.size() ? scenario.objects[instance.object].name
                                                        : std::string());
  }
  print.geometry = shape.value();
  // Hash the joints between the bodies.
  Hash joints;
  for (const scene::ContactDesc& contact : scenario.contacts) {
    joints.add(contact.between[0]).add(contact.between[1]).add(contact.resistance_m2k_w);
  }
  print.contacts = joints.value();
  // Hash the start of the history, its keys and the options. The end counts too: the grid is fine
  // along all shadows until then.
  print.thermal = Hash()
                      .add(scenario.thermal.initial_k)
                      .add(scenario.thermal.history_start_ns)
                      .add(scenario.thermal.spin_up_ns)
                      .add(scenario.thermal.exchange)
                      .add(scenario.thermal.film_factor)
                      .value();
  print.options =
      Hash().add(options.rays).add(options.refine).add(options.tolerance_k).add(end_ns).value();
  return print;
}

std::filesystem::path checkpoint_file(const scene::ScenarioDesc& scenario,
                                      const SolveOptions& options) {
  return options.checkpoint / (scenario.name + ".solve");
}

Result<void> save_checkpoint(const std::filesystem::path& file, const SolveFingerprint& print,
                             const SolidState& state, const SolidStats& spin_up) {
  const auto fail = [&](const std::string& what) {
    return make_error(ErrorCode::io, fmt::format("{}: {}", file.string(), what));
  };
  std::error_code error;
  std::filesystem::create_directories(file.parent_path(), error);
  if (error) return fail(error.message());
  // Fill the header.
  Header header;
  header.print = print;
  header.time_s = state.time_s;
  header.step_s = state.step_s;
  header.flow_w = state.flow_w;
  header.heat_in_j = state.heat_in_j;
  header.has_slope = state.has_slope ? 1 : 0;
  header.stats = state.stats;
  header.spin_up = spin_up;
  header.nodes = state.node_k.size();
  header.free_nodes = state.slope_w.size();
  header.data_hash = data_hash(state);
  // Write to another file and rename it, so that a failure leaves the old checkpoint.
  const std::filesystem::path part = file.string() + ".part";
  {
    std::ofstream out(part, std::ios::binary | std::ios::trunc);
    out.write(bytes_of(&header), sizeof(header));
    out.write(bytes_of(state.node_k.data()),
              static_cast<std::streamsize>(state.node_k.size() * sizeof(double)));
    out.write(bytes_of(state.slope_w.data()),
              static_cast<std::streamsize>(state.slope_w.size() * sizeof(double)));
    out.close();
    if (!out) return fail("cannot write the checkpoint");
  }
  std::filesystem::rename(part, file, error);
  if (error) return fail(error.message());
  return {};
}

Result<std::optional<Checkpoint>> load_checkpoint(const std::filesystem::path& file,
                                                  const SolveFingerprint& print) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return std::optional<Checkpoint>();
  // Read the header and compare the fingerprints part by part.
  std::ifstream in(file, std::ios::binary);
  Header header;
  in.read(bytes_of(&header), sizeof(header));
  if (!in || header.magic != kMagic) {
    return make_error(ErrorCode::parse,
                      fmt::format("{}: not a checkpoint of emit solve", file.string()));
  }
  const std::array<std::pair<bool, const char*>, 7> parts{{
      {header.print.place_and_date == print.place_and_date, "place or date"},
      {header.print.weather == print.weather, "weather"},
      {header.print.materials == print.materials, "materials"},
      {header.print.geometry == print.geometry, "geometry"},
      {header.print.contacts == print.contacts, "contacts"},
      {header.print.thermal == print.thermal,
       "start of the history, spin-up, thermal.exchange or thermal.film_factor"},
      {header.print.options == print.options, "rays, refinement, tolerance or the last instant"},
  }};
  std::string differs;
  for (const auto& [same, name] : parts) {
    if (!same) differs += fmt::format("{}{}", differs.empty() ? "" : "; ", name);
  }
  if (!differs.empty()) {
    return make_error(ErrorCode::config,
                      fmt::format("{}: the checkpoint belongs to another run; what differs: {}",
                                  file.string(), differs));
  }
  // Compare the size of the file with the header before taking memory.
  const auto size = std::filesystem::file_size(file, error);
  if (error || header.free_nodes > header.nodes || header.nodes > (1ULL << 31U) ||
      size != sizeof(header) + (header.nodes + header.free_nodes) * sizeof(double)) {
    return make_error(ErrorCode::parse,
                      fmt::format("{}: the checkpoint is damaged", file.string()));
  }
  // Read the state and check its hash.
  Checkpoint checkpoint;
  SolidState& state = checkpoint.state;
  state.time_s = header.time_s;
  state.step_s = header.step_s;
  state.flow_w = header.flow_w;
  state.heat_in_j = header.heat_in_j;
  state.has_slope = header.has_slope != 0;
  state.stats = header.stats;
  checkpoint.spin_up = header.spin_up;
  state.node_k.resize(header.nodes);
  state.slope_w.resize(header.free_nodes);
  in.read(bytes_of(state.node_k.data()),
          static_cast<std::streamsize>(header.nodes * sizeof(double)));
  in.read(bytes_of(state.slope_w.data()),
          static_cast<std::streamsize>(header.free_nodes * sizeof(double)));
  if (!in || data_hash(state) != header.data_hash) {
    return make_error(ErrorCode::parse,
                      fmt::format("{}: the checkpoint is damaged", file.string()));
  }
  return std::optional<Checkpoint>(std::move(checkpoint));
}

}  // namespace emit::reference
