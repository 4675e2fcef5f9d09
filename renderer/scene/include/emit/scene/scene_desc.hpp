// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/frames.hpp"
#include "emit/physics/weather.hpp"

/// Plain description of a scenario. `config` fills it from files, `renderer` and `reference` read
/// it; it holds no loaded geometry and no GPU or parser types. All values SI, angles in radians.
namespace emit::scene {

/// Spectral band. An empty response is a perfect rectangle over [lo_um, hi_um].
struct ResponseSample {
  double wavelength_um = 0.0;
  double response_frac = 0.0;  ///< relative response, 0..1
};
struct SpectralBand {
  std::string name;  ///< e.g. "8-12"
  double lo_um = 0.0;
  double hi_um = 0.0;
  std::vector<ResponseSample> response;  ///< ascending in wavelength, linear in between
};

struct Layer {
  double thickness_m = 0.0;
  double conductivity_w_m_k = 0.0;
  double density_kg_m3 = 0.0;
  double specific_heat_j_kg_k = 0.0;
};

/// One exponential of the surface's step response (PHYSICS: T = sum w_i x_i, tau_i x_i' = u - x_i).
struct RelaxationMode {
  double tau_s = 0.0;
  double weight_frac = 0.0;
};

/// One state of a thermal network between the surface and the base (physics.md eq. 17):
/// T = base_k + sum x_i, tau_i x_i' = r_i q - x_i, q = net flux into the solid.
struct FosterMode {
  double tau_s = 0.0;
  double resistance_m2k_w = 0.0;  ///< r_i; the sum over the modes is that of the layers
};

/// What is known about the fitted modes of a material against the reference solver.
struct FosterFit {
  double horizon_s = 0.0;  ///< length of the histories they were fitted over
  double rms_k = 0.0;      ///< largest of the scenarios' root mean squares
  double max_k = 0.0;      ///< over all scenarios
};

struct BandEmissivity {
  std::string band;  ///< name of a SpectralBand
  double emissivity_frac = 0.0;
};

struct Material {
  std::string name;
  double solar_absorptance_frac = 0.0;          ///< absorbed share of sunlight: 1 - albedo
  double emissivity_frac = 0.0;                 ///< total hemispherical, long-wave
  std::vector<BandEmissivity> band_emissivity;  ///< bands not listed use emissivity_frac
  std::vector<Layer> layers;                    ///< outermost first; emit2014 uses the first only
  double base_k = 0.0;                          ///< core temperature under the last layer
  /// emit2014: conductance between surface and core; absent: that of the first layer.
  std::optional<double> core_conductance_w_m2_k;
  std::optional<double> initial_k;    ///< surface at history start; else thermal.initial_k
  std::vector<RelaxationMode> modes;  ///< emit2014; weights sum to 1
  /// foster: 1 to 4 modes, fastest first, of all layers together; empty: derived from them.
  std::vector<FosterMode> foster_modes;
  std::optional<FosterFit> foster_fit;  ///< absent: modes come from the layers alone
  /// False where heat moves otherwise than through dry layers: evaporation, melting, stirring.
  bool dry_layers_valid = true;
  /// A hot part or another emitter of given temperature: takes no part in the thermal simulation.
  std::optional<double> prescribed_k;
  /// Both faces of a thin body, whose layers are half of it over an insulated middle (sheets.hpp);
  /// base_k counts for emit2014 only.
  bool sheet = false;
  std::string source;       ///< where the numbers come from
  std::string uncertainty;  ///< what is known about their error
};

/// One node of a trajectory: linear in position, slerp in attitude; `on` holds until the next one.
struct Keyframe {
  std::int64_t sim_time_ns = 0;
  physics::Pose pose;
  bool on = true;
  bool teleport = false;  ///< no interpolation from the previous keyframe: a jump
};

/// Keyframes in ascending time; before the first its pose and on state hold, likewise after the
/// last.
using Trajectory = std::vector<Keyframe>;

/// A glTF file placed in the world, once or many times.
struct ObjectDesc {
  std::string name;
  std::uint32_t entity_id = 0;  ///< 0: static scenery; otherwise addressed by host frames, unique
  std::filesystem::path gltf;
  /// Library material for glTF materials not listed in material_map ("" = map by name, then
  /// default).
  std::string material;
  std::map<std::string, std::string> material_map;  ///< glTF material name -> library material
  std::vector<physics::Pose> instances;  ///< static placements; an entity has exactly one
  double scale = 1.0;
  Trajectory trajectory;  ///< entities only; empty: stays at its placement until the host moves it
  bool on = true;         ///< entities only: state without trajectory
};

/// One camera. Square pixels; the vertical field of view follows from the format.
struct SensorDesc {
  std::string name;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  double fov_h_rad = 0.0;
  double near_m = 0.1;
  Trajectory trajectory;  ///< used by offline rendering and by demos; host frames override it
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

enum class ChannelKind : std::uint8_t { injection, projector };
struct ChannelDesc {
  std::string name;
  ChannelKind kind = ChannelKind::injection;
  std::string band;             ///< name of a SpectralBand
  PixelRect window_px = {};     ///< of the sensor's image; empty: all of it
  std::uint32_t every_nth = 1;  ///< shows frames 1, 1 + n, 1 + 2 n, ... of every run
};

using physics::ClearSky;
using physics::WeatherSample;

/// Band transmittance by range: tau(R) = sum a_i exp(-k_i R), sum a_i = 1; path radiance
/// (1 - tau) L_band(air). Sky radiance by elevation from the vertical transmittance.
struct AtmosphereTerm {
  double amplitude_frac = 0.0;
  double extinction_per_km = 0.0;
};
struct BandAtmosphere {
  std::string band;
  std::vector<AtmosphereTerm> terms;
  double vertical_transmittance_frac = 0.7;  ///< ground to space, zenith; sky = (1-tau^m) L(air)
  physics::AtmosphereGrid table = {};        ///< not empty: in place of terms and vertical
};
struct AtmosphereDesc {
  bool enabled = true;
  std::vector<BandAtmosphere> bands;
};

enum class ThermalMethod : std::uint8_t { per_frame, cached };
enum class ThermalModel : std::uint8_t { emit2014, foster };
enum class StepSpacing : std::uint8_t { uniform, geometric };

struct ThermalOptions {
  ThermalMethod method = ThermalMethod::cached;
  ThermalModel model = ThermalModel::emit2014;
  double tolerance_k = 0.1;
  double initial_k = 290.0;           ///< surface temperature at history start
  std::int64_t history_start_ns = 0;  ///< sim time; the thermal simulation runs from here to now
  /// Unshadowed forcing before history start, from a steady profile; emit2014 ignores it. Scenario
  /// files default to two days for foster.
  std::int64_t spin_up_ns = 0;
  /// foster: what the surroundings consist of, where the weather does not state environment_k;
  /// empty: default_material.
  std::string surroundings_material;
  /// foster: number of modes derived from the layers, 2..4; 0: the modes of the material.
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
      1'000'000;         ///< cached: thermal samples, about 1.5 kB each at 27 steps
  bool lateral = true;   ///< cached: conduction along the surface and across convex edges
  bool exchange = true;  ///< cached: what a face sees of others is these, not the surroundings
  std::filesystem::path state_file;  ///< cached: the warmed-up state; empty: kept nowhere
};

struct Place {
  double lat_rad = 0.0;
  double lon_rad = 0.0;
  double height_m = 0.0;
};

/// Limits of the false-colour display.
struct DisplayOptions {
  double min_k = 280.0;
  double max_k = 330.0;
};

struct ScenarioDesc {
  std::string name;
  std::filesystem::path file;  ///< where it came from, for messages
  Place place;
  std::int64_t epoch_utc_ns = 0;       ///< POSIX ns (UTC) of sim time 0
  std::vector<WeatherSample> weather;  ///< empty: clear_sky
  ClearSky clear_sky;
  AtmosphereDesc atmosphere;
  std::vector<SpectralBand> bands;
  std::vector<Material> materials;  ///< library plus the scenario's own
  std::string default_material;     ///< for glTF materials nothing maps
  std::vector<ObjectDesc> objects;
  SensorDesc sensor;
  std::vector<ChannelDesc> channels;
  ThermalOptions thermal;
  DisplayOptions display;
  /// What the loader found doubtful, one sentence each, beginning with the file's name.
  std::vector<std::string> warnings;
};

}  // namespace emit::scene
