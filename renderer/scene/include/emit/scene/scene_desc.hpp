// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <compare>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/air_film.hpp"
#include "emit/physics/air_model.hpp"
#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/climate/surface_water.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/frames.hpp"
#include "emit/physics/sky/cloud_field.hpp"
#include "emit/physics/sky/fog.hpp"
#include "emit/physics/weather.hpp"
#include "emit/scene/channel_output.hpp"
#include "emit/scene/clutter_desc.hpp"
#include "emit/scene/emissivity_spectrum.hpp"
#include "emit/scene/gas_desc.hpp"
#include "emit/scene/gloss.hpp"

/// Plain description of a scenario. `config` fills it from files, `renderer` and `reference` read
/// it; it holds no loaded geometry and no GPU or parser types. All values SI, angles in radians.
namespace emit::scene {

/// One point of a spectral response.
struct ResponseSample {
  double wavelength_um = 0.0;
  double response_frac = 0.0;  ///< relative response, 0..1
};
/// Spectral band of a detector. An empty response is a perfect rectangle over [lo_um, hi_um].
struct SpectralBand {
  std::string name;  ///< e.g. "8-12"
  double lo_um = 0.0;
  double hi_um = 0.0;
  std::vector<ResponseSample> response;  ///< ascending in wavelength, linear in between
  /// The response is that per photon, as a photon detector has it: radiance is weighted with
  /// response times wavelength / hi_um.
  bool photons = false;
};
/// Returns a band as the radiometric models take it. The response of a band that counts photons is
/// given per power there: its radiance times photons_per_joule() is its photon radiance.
[[nodiscard]] physics::Band spectral_band(const SpectralBand& desc);
/// Returns the photons of a joule at the longest wavelength of a band.
[[nodiscard]] double photons_per_joule(const SpectralBand& desc) noexcept;

/// One layer of a body under its surface.
struct Layer {
  double thickness_m = 0.0;
  double conductivity_w_m_k = 0.0;
  double density_kg_m3 = 0.0;
  double specific_heat_j_kg_k = 0.0;
};

/// One exponential of the surface's step response: T = sum w_i x_i, tau_i x_i' = u - x_i
/// (renderer/docs/physics.md).
struct RelaxationMode {
  double tau_s = 0.0;
  double weight_frac = 0.0;
};

/// One state of a thermal network between the surface and the base (physics.md eq. 17). The surface
/// has T = base_k + sum x_i with tau_i x_i' = r_i q - x_i, where q is the net flux into the solid.
struct FosterMode {
  double tau_s = 0.0;
  double resistance_m2k_w = 0.0;  ///< r_i; all modes together have the resistance of the layers
};

/// Error of the fitted modes of a material against the reference solver.
struct FosterFit {
  double horizon_s = 0.0;  ///< length of the histories over which the modes were fitted
  double rms_k = 0.0;      ///< largest of the scenarios' root mean squares
  double max_k = 0.0;      ///< over all scenarios
};

/// Emissivity of a material in one band.
struct BandEmissivity {
  std::string band;  ///< name of a SpectralBand
  double emissivity_frac = 0.0;
};

/// Kind of base: what the last layer of a material rests on. Material::base_k follows from it.
enum class BaseKind : std::uint8_t {
  ground,  ///< ground at the depth of the layers: annual wave of the air at place and date
  air,     ///< outdoor air, its mean over a day
  room,    ///< a heated room, a cooled tank or a core: a stated temperature
  body,    ///< interior of a vehicle, which its faces heat and cool
};

/// Interior of a body, for the faces whose material rests on it (BaseKind::body). Both numbers
/// count per area of those faces.
struct BodyInterior {
  double heat_j_m2_k = 10'000.0;    ///< heat capacity
  double ventilation_w_m2_k = 0.5;  ///< exchange of air with the outside

  [[nodiscard]] bool operator==(const BodyInterior&) const = default;
};

/// Roughness of a surface by classes of DOE-2 and TARP, and open water.
enum class Roughness : std::uint8_t {
  very_rough,     ///< gravel, crops, tree crowns
  rough,          ///< brick, rough plaster, grass
  medium_rough,   ///< concrete, asphalt
  medium_smooth,  ///< sawn wood, fabric
  smooth,         ///< smooth plaster, painted metal
  very_smooth,    ///< glass, polished metal
  open_water,     ///< pond, lake, sea
};
inline constexpr std::size_t kRoughnesses = 7;
/// Returns the factor R of physics.md eq. 34 of a class.
[[nodiscard]] constexpr double roughness_factor(Roughness roughness) noexcept {
  constexpr std::array<double, kRoughnesses> kFactors{2.17, 1.67, 1.52, 1.13, 1.11, 1.0, 0.55};
  return kFactors[static_cast<std::size_t>(roughness)];
}

/// Half-widths of the ranges in which the numbers of a material lie. 0: not stated.
struct MaterialSpread {
  double solar_absorptance_frac = 0.0;
  double emissivity_frac = 0.0;  ///< of the total, and of the bands that are not listed
  std::vector<BandEmissivity> band_emissivity;
  double conductivity_frac = 0.0;   ///< share of the conductivity of every layer
  double heat_capacity_frac = 0.0;  ///< share of the heat capacity of every layer
};

/// Thermal and optical properties of a surface and of the body under it.
struct Material {
  std::string name;
  double solar_absorptance_frac = 0.0;            ///< absorbed share of sunlight: 1 - albedo
  double emissivity_frac = 0.0;                   ///< total hemispherical, long-wave
  Roughness roughness = Roughness::medium_rough;  ///< as the wind feels it; emit2014 ignores it
  /// Width of the leaves, needles or strips of which the surface consists; absent: it is closed.
  std::optional<double> leaf_width_m;
  /// Area of leaves, one side, by that of the surface; absent: that of leaves at all angles.
  std::optional<double> leaf_area_index;
  std::vector<BandEmissivity> band_emissivity;  ///< bands not listed use emissivity_frac
  EmissivitySpectrum emissivity_spectrum;       ///< source of both; may be empty
  std::vector<Layer> layers;                    ///< outermost first; emit2014 uses the first only
  BaseKind base = BaseKind::room;               ///< what the last layer rests on
  /// Temperature under the last layer. resolve_bases() fills it unless the user states it.
  double base_k = 0.0;
  bool base_stated = false;  ///< base_k is the user's own number
  /// emit2014: conductance between surface and core. When absent, the first layer's counts.
  std::optional<double> core_conductance_w_m2_k;
  std::optional<double> initial_k;    ///< surface at history start; else thermal.initial_k
  std::vector<RelaxationMode> modes;  ///< emit2014; weights sum to 1
  /// foster: 1 to 6 modes of all layers together, fastest first. When empty, they are derived from
  /// the layers.
  std::vector<FosterMode> foster_modes;
  std::optional<FosterFit> foster_fit;  ///< absent: the modes come from the layers alone
  /// False for materials in which heat does not move through dry layers alone, but by evaporation,
  /// melting or stirring.
  bool dry_layers_valid = true;
  // foster: evaporation (physics.md eq. 47). A material with the first or the second one is moist.
  std::optional<double> wetness_frac;            ///< 0..1; absent: 1
  std::optional<double> surface_resistance_s_m;  ///< in sunlight; absent: 0
  std::optional<double> night_resistance_s_m;    ///< absent: the same as in sunlight
  std::optional<Gloss> gloss;  ///< absent: the surface emits and reflects evenly to all sides
  // foster: rain water (physics.md eq. 61 to 64).
  std::optional<double> water_store_mm;         ///< what it holds; absent: rain leaves it as it is
  std::optional<double> readily_evaporable_mm;  ///< of the top layer of a soil; absent: no soil
  /// Temperature of a hot part or another emitter that takes no part in the thermal simulation.
  std::optional<double> prescribed_k;
  /// True for both faces of a thin body, whose layers are half of it over an insulated middle (see
  /// sheets.hpp). Then base_k counts for emit2014 only.
  bool sheet = false;
  std::optional<Clutter> clutter;        ///< variation from place to place; absent: none
  std::string family;                    ///< kind of material, for lists; empty: none
  std::string source;                    ///< origin of the numbers
  std::optional<MaterialSpread> spread;  ///< known error of the numbers
  std::string uncertainty;               ///< what else limits the numbers

  /// True if the temperature under the last layer is that of the interior of the body that the
  /// surface belongs to. base_k is then where it starts.
  [[nodiscard]] bool rests_on_body() const noexcept {
    return base == BaseKind::body && !base_stated && !prescribed_k && !sheet;
  }
};

/// Returns whether the clutter of a material changes its temperature from place to place.
[[nodiscard]] inline bool varies_in_heat(const Material& material) noexcept {
  return material.clutter && material.clutter->changes_heat() && !material.prescribed_k;
}

/// Returns how a material gives water to the air; dry if it states nothing or has a prescribed
/// temperature.
[[nodiscard]] inline physics::MoistSurface moisture_of(const Material& material) noexcept {
  const bool stated = material.wetness_frac || material.surface_resistance_s_m;
  if (!stated || material.prescribed_k) return {};
  // The store decides about the wetness of soil.
  if (material.water_store_mm && material.readily_evaporable_mm) return {};
  const double resistance_s_m = material.surface_resistance_s_m.value_or(0.0);
  return {.wetness_frac = material.wetness_frac.value_or(1.0),
          .resistance_s_m = resistance_s_m,
          .night_resistance_s_m = material.night_resistance_s_m.value_or(resistance_s_m)};
}

/// Returns what the film of the air takes from a material.
[[nodiscard]] inline physics::FilmSkin film_skin(const Material& material) noexcept {
  constexpr double kAllAngles = 2.0;
  if (material.leaf_width_m) {
    return physics::leaf_skin(*material.leaf_width_m,
                              material.leaf_area_index.value_or(kAllAngles));
  }
  return roughness_factor(material.roughness);
}

/// Returns the room for rain water of a material; none if it states none or has a prescribed
/// temperature. Soil starts as wet as `wetness_frac`, everything else dry.
[[nodiscard]] inline physics::WaterStore water_store_of(const Material& material) noexcept {
  if (!material.water_store_mm || material.prescribed_k) return {};
  physics::WaterStore out{.capacity_mm = *material.water_store_mm};
  if (material.readily_evaporable_mm) {
    out.kind = physics::WaterStore::Kind::soil;
    out.ready_mm = *material.readily_evaporable_mm;
    out.initial_mm = physics::soil_water_mm(out, material.wetness_frac.value_or(0.0));
  }
  return out;
}

/// One node of a trajectory: linear in position, slerp in attitude; `on` holds until the next one.
struct Keyframe {
  std::int64_t sim_time_ns = 0;
  physics::Pose pose;
  bool on = true;
  bool teleport = false;  ///< no interpolation from the previous keyframe: a jump
};

/// Keyframes in ascending time. The first one's pose and on state hold before it, the last one's
/// after it.
using Trajectory = std::vector<Keyframe>;

/// Drive of a part of a body from an instant on.
struct PartCommand {
  enum class Kind : std::uint8_t {
    off,          ///< nothing; a part with a curve cools towards its cold temperature
    temperature,  ///< value: temperature of the skin, K
    power,        ///< value: power into the skin, W/m2
    throttle,     ///< value: 0 (idle) to 1 (full), with the curve of the part
  };
  Kind kind = Kind::off;
  double value = 0.0;
  bool operator==(const PartCommand&) const = default;
};
struct TimedPartCommand {
  std::int64_t sim_time_ns = 0;
  PartCommand command;
};
/// Temperatures behind the skin of a part, and the time constants with which it goes between them.
struct PartCurve {
  bool given = false;  ///< false: the part takes no throttle
  double idle_k = 0.0;
  double full_k = 0.0;
  double cold_k = 288.15;  ///< switched off
  double up_s = 0.0;       ///< time constant towards a higher temperature; 0: at once
  double down_s = 0.0;
};
/// A part of an entity that heats itself: all surfaces of the object with one material.
struct PartDesc {
  std::uint32_t id = 1;  ///< unique in the object; hosts name the part by it
  std::string name;
  std::string material;  ///< library material
  PartCurve curve;
  std::vector<TimedPartCommand> commands;  ///< ascending in time; off before the first
};

/// Colour of an image that stands for a material.
struct MaterialColour {
  std::array<std::uint8_t, 3> rgb{};  ///< red, green and blue of sRGB
  std::string material;               ///< library material
  auto operator<=>(const MaterialColour&) const = default;
};
/// Image that gives the surfaces of one glTF material several materials of the library, each texel
/// the one whose colour in the legend is the nearest.
struct MaterialImage {
  std::string gltf_material;
  std::filesystem::path image;         ///< PNG or JPEG; empty: the base colour of the file
  std::vector<MaterialColour> legend;  ///< 1 to 64 different colours, ascending
  /// Patches of fewer texels take the material around them.
  std::uint32_t smallest_patch_px = 1;
  auto operator<=>(const MaterialImage&) const = default;
};

/// A glTF file placed in the world, once or many times.
struct ObjectDesc {
  std::string name;
  std::uint32_t entity_id = 0;  ///< 0: static scenery; otherwise addressed by host frames, unique
  std::filesystem::path gltf;
  /// Library material for glTF materials that material_map does not list. When empty, they are
  /// looked up by their name, then the default material is used.
  std::string material;
  std::map<std::string, std::string> material_map;  ///< glTF material name -> library material
  std::vector<MaterialImage> material_images;       ///< at most one for a glTF material
  std::vector<physics::Pose> instances;  ///< static placements; an entity has exactly one
  double scale = 1.0;
  /// Rotation of the model in its body: heading (nose to the right), pitch (nose up) and roll
  /// (right side down), applied in the order roll, pitch, heading. It turns a model whose nose does
  /// not point along glTF +z.
  glm::dvec3 model_rotation_rad{0.0};
  glm::dvec3 model_offset_m{0.0};  ///< of the model's origin in the body: forward, right, down
  Trajectory trajectory;  ///< entities only; empty: stays at its placement until the host moves it
  bool on = true;         ///< entities only: on state without a trajectory
  std::vector<PartDesc> parts;  ///< entities only: what heats itself
  /// Shape and length that set the film of an entity; a length of 0 is that of its geometry.
  physics::AirFilmBody air_film{.length_m = 0.0};
  BodyInterior interior;  ///< interior that faces of a material with base `body` share
};

/// Joint between two bodies that touch. Bodies that no contact names conduct to each other as if
/// they were grown together.
struct ContactDesc {
  std::array<std::string, 2> between;  ///< each the name of an object or of a material
  double resistance_m2k_w = 0.0;       ///< > 0
};

/// Largest possible SensorDesc::small_target_px.
inline constexpr double kMaxSmallTargetPx = 32.0;

/// One camera. Its pixels are square; the vertical field of view follows from the format.
struct SensorDesc {
  std::string name;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  double fov_h_rad = 0.0;  ///< horizontal field of view, and the widest that frames may ask for
  /// Narrowest field of view that frames may ask for; 0: that of `fov_h_rad`.
  double fov_h_min_rad = 0.0;
  double near_m = 0.1;
  /// Largest image of an entity, in pixels across, that is averaged over the pixels it covers. 0:
  /// none. Larger ones have one sample per pixel.
  double small_target_px = kMaxSmallTargetPx;
  Trajectory trajectory;  ///< used by offline rendering and by demos; host frames override it

  [[nodiscard]] double narrowest_fov_rad() const noexcept {
    return fov_h_min_rad > 0.0 ? fov_h_min_rad : fov_h_rad;
  }
};

/// A rectangle of an image, from the top left.
struct PixelRect {
  std::uint32_t x_px = 0;
  std::uint32_t y_px = 0;
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  [[nodiscard]] bool empty() const noexcept { return width_px == 0 || height_px == 0; }
  [[nodiscard]] bool operator==(const PixelRect&) const = default;
};

/// Use of a channel's frames: injected into a processing unit, or shown by a projector.
enum class ChannelKind : std::uint8_t { injection, projector };
/// The camera of a channel where it differs from the sensor: the sensor's image format, from
/// another place, in another direction or with another field of view.
struct ChannelCamera {
  double fov_h_rad = 0.0;                       ///< 0: that of the sensor, as the host sets it
  glm::dvec3 offset_body_m{0.0};                ///< from the seeker, or the entity, in its axes
  glm::dvec3 yaw_pitch_roll_rad{0.0};           ///< against the seeker's axes, or the entity's
  std::optional<std::uint32_t> entity_id = {};  ///< what carries it; none: the seeker
  std::uint32_t look_ahead_frames = 0;          ///< its images show a later frame's instant

  [[nodiscard]] bool operator==(const ChannelCamera&) const = default;
};

/// One output stream: a band and a window of the sensor's image.
struct ChannelDesc {
  std::string name;
  ChannelKind kind = ChannelKind::injection;
  std::string band;             ///< name of a SpectralBand
  PixelRect window_px = {};     ///< part of the sensor's image; empty: all of it
  std::uint32_t every_nth = 1;  ///< shows frames 1, 1 + n, 1 + 2 n, ... of every run
  ChannelOutput output = {};    ///< what is done to its picture
  ChannelCamera camera = {};
};

using physics::ClearSky;
using physics::WeatherSample;

/// One term of a band's transmittance by range: tau(R) = sum a_i exp(-k_i R) with sum a_i = 1. The
/// path radiance is (1 - tau) L_band(air).
struct AtmosphereTerm {
  double amplitude_frac = 0.0;
  double extinction_per_km = 0.0;
};
/// Air in one band. The sky's radiance by elevation comes from the vertical transmittance.
struct BandAtmosphere {
  std::string band;
  std::vector<AtmosphereTerm> terms;
  double vertical_transmittance_frac = 0.7;    ///< ground to space; sky = (1 - tau^m) L(air)
  physics::AtmosphereGrid table = {};          ///< not empty: replaces terms and vertical value
  std::optional<physics::AirSpec> model = {};  ///< built-in air of the band: replaces all of these
};
/// Air between surface and sensor, by band.
struct AtmosphereDesc {
  bool enabled = true;
  std::vector<BandAtmosphere> bands;
  std::optional<physics::Fog> fog = {};  ///< of the picture; what it does to heat: ClearSky::fog
};

enum class ThermalMethod : std::uint8_t { per_frame, cached };
enum class ThermalModel : std::uint8_t { emit2014, foster };
enum class StepSpacing : std::uint8_t { uniform, geometric };

/// Choice and parameters of the thermal simulation.
struct ThermalOptions {
  ThermalMethod method = ThermalMethod::cached;
  ThermalModel model = ThermalModel::emit2014;  ///< scenario files default to foster
  double tolerance_k = 0.1;
  double initial_k = 290.0;  ///< surface temperature at history start
  /// False: nobody has stated initial_k. Surfaces of foster then begin in the balance of their own
  /// first day, if history and spin-up have one.
  bool initial_stated = true;
  std::int64_t history_start_ns = 0;  ///< sim time at which the thermal simulation starts
  /// Length of the time before the history start in which forcing without shadows acts on a steady
  /// profile. emit2014 ignores it. Scenario files default to two days for foster.
  std::int64_t spin_up_ns = 0;
  /// foster: material of the surroundings when the weather does not state environment_k. When
  /// empty, default_material is used.
  std::string surroundings_material;
  /// foster: number of modes derived from the layers, 1 to 6; 0 takes the modes of the material.
  std::uint32_t foster_modes = 0;
  std::uint32_t steps = 27;
  StepSpacing spacing = StepSpacing::uniform;
  double first_step_s = 20.0;  ///< newest interval of geometric spacing
  std::uint32_t shadow_map_px = 1024;
  std::uint32_t max_cascades = 1;  ///< 1..4
  std::uint32_t blocker_taps = 8;
  std::uint32_t filter_taps = 32;
  double obscurance_radius_m = 0.5;
  std::uint32_t max_samples =
      1'000'000;             ///< cached: thermal samples, about 1.5 kB each at 27 steps
  double film_factor = 1.0;  ///< foster: multiplies the film of the air on every face
  bool lateral = true;       ///< cached: conduction along the surface and across convex edges
  bool exchange = true;      ///< cached: faces exchange radiation with the faces that they see
  std::filesystem::path state_file;  ///< cached: file of the warmed-up state; empty: none
};

/// Place of the world's origin on the Earth.
struct Place {
  double lat_rad = 0.0;
  double lon_rad = 0.0;
  double height_m = 0.0;
};

/// Temperatures at both ends of the false-colour scale.
struct DisplayOptions {
  double min_k = 280.0;
  double max_k = 330.0;
};

/// Content of a scenario file.
struct ScenarioDesc {
  std::string name;
  std::filesystem::path file;  ///< the file itself, for messages
  Place place;
  std::int64_t epoch_utc_ns = 0;       ///< POSIX ns (UTC) of sim time 0
  std::vector<WeatherSample> weather;  ///< empty: clear_sky
  ClearSky clear_sky;
  std::optional<physics::Clouds> clouds;  ///< absent: clouds have no structure
  AtmosphereDesc atmosphere;
  std::vector<SpectralBand> bands;
  std::vector<Material> materials;  ///< library plus the scenario's own
  std::string default_material;     ///< for glTF materials that nothing maps
  std::vector<ObjectDesc> objects;
  std::vector<ContactDesc> contacts;  ///< only the reference solution in three dimensions has them
  GasDesc gas;                        ///< part of the picture alone
  SensorDesc sensor;
  std::vector<ChannelDesc> channels;
  ThermalOptions thermal;
  DisplayOptions display;
  /// Doubtful points that the loader found, one sentence each. A sentence begins with the file's
  /// name.
  std::vector<std::string> warnings;
};

}  // namespace emit::scene
