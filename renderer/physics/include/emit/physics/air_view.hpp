// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "emit/physics/air_model.hpp"
#include "emit/physics/sky/sun_scatter.hpp"
#include "emit/physics/sky_state.hpp"

/// The air model as the shader reads it: a small table around the sensor (physics.md eq. 39). The
/// shader evaluates the same equations in float32 (shaders/lib/air_view.glsl).
namespace emit::physics {

/// Air of one band for sensors at any height. at() makes the table of one sensor height out of
/// slices that build() prepared.
/// Axes: the heights of sensor and target have nodes every 250 m up to 2 km, 500 m up to 3 km, 1 km
/// up to 12 km and 5 km up to 22 km; the range is uniform in its logarithm, the elevation in
/// asinh(sin e / kElevationScale). All are clamped at their ends.
class AirView {
 public:
  static constexpr std::size_t kHeights = 22;
  static constexpr std::size_t kRanges = 29;
  static constexpr std::size_t kElevations = 48;
  static constexpr std::size_t kNodes = kHeights * kRanges + kElevations;
  static constexpr double kNearestM = 1.0;
  static constexpr double kFarthestM = 100000.0;
  static constexpr double kElevationScale = 0.03;
  static constexpr double kLowestSine = -0.17;

  /// Node of a table. Along a line of sight the first three members hold the logarithm of the mean
  /// extinction, m-1, for the three sources, and the last one the path radiance by 1 - tau of the
  /// first source, W m-2 sr-1. Towards the sky the first three hold the optical depth to space, and
  /// the last one the radiance of the sky.
  using Node = std::array<float, 4>;
  using Sources = std::array<AirSource, 3>;
  /// Sources of a picture: surfaces near 300 K, hot surfaces, and what reflects the sun.
  static constexpr Sources kPicture{AirSource::black_300k, AirSource::black_800k,
                                    AirSource::sun_lowtran};

  /// Band, sources and scattered sunlight of a view. What is pointed to must outlive the call of
  /// build().
  struct Subject {
    const BandAir* band = nullptr;
    Sources sources = kPicture;
    const SunScatter* scatter = nullptr;  ///< null: the view knows no scattered sunlight
  };
  /// Makes the views of several subjects in one atmosphere, in their order. Setup only: some tens
  /// of milliseconds, and some hundreds with scattered sunlight.
  [[nodiscard]] static std::vector<AirView> build(const AirColumn& column,
                                                  std::span<const Subject> subjects);

  /// Air of an instant.
  struct Weather {
    double warmer_k = 0.0;      ///< air at sea level against that of the climate
    double sky_warmer_k = 0.0;  ///< the same for the sky alone
  };
  /// Writes the table of a sensor at a height above sea level: the lines of sight
  /// [target height][range], then the clear sky by elevation. Both differences of the air are
  /// clamped to +-kMostWarmerK. RT-safe.
  /// @pre out.size() == kNodes
  void at(double sensor_m, const Weather& weather, std::span<Node> out) const noexcept;
  static constexpr double kMostWarmerK = 40.0;

  /// Elevations of the sun for which scattered sunlight is tabulated: uniform on the same axis as
  /// those of the sky, from 0 to the zenith.
  static constexpr std::size_t kSuns = 12;
  /// Nodes of a table of scattered sunlight: those of the view, then the phase functions.
  static constexpr std::size_t kSunNodes = kNodes + SunScatter::kPhaseNodes;
  /// Sunlight of an instant.
  struct Sunlight {
    double sin_elevation = 0.0;  ///< apparent
    double share_frac = 0.0;     ///< sunlight below clouds and haze, by a clear sky's at 1 au
  };
  /// True if the view knows scattered sunlight.
  [[nodiscard]] bool scatters() const noexcept { return !scattered_.empty(); }
  /// Writes the table of the sunlight that reaches a sensor at a height above sea level, in the
  /// places of at(). A node holds the light by kind of scatterer (SunScatter::scattered_w_m2), on
  /// lines of sight by 1 - tau of the first source. The phase functions follow. RT-safe.
  /// @pre scatters() and out.size() == kSunNodes
  void sun_at(double sensor_m, const Sunlight& sun, std::span<Node> out) const noexcept;
  /// Returns the radiance of the clear sky's scattered sunlight at a height for a sine of the
  /// elevation, W m-2 sr-1 at 1 au: the mean over all azimuths. RT-safe. @pre scatters()
  [[nodiscard]] double scattered_sky_w_m2_sr(double height_m, double sin_sun,
                                             double sin_elevation) const noexcept;
  /// Returns the same by the tilt of a face. RT-safe after the first call. @pre scatters()
  [[nodiscard]] SkyByTilt scattered_sky_by_tilt_w_m2_sr(double height_m,
                                                        double sin_sun) const noexcept;

  /// Radiance or shares of the sky by elevation, at the nodes of the sky's axis.
  using ByElevation = std::array<float, kElevations>;
  /// Returns the sine of the elevation at a node of the sky. RT-safe after the first call.
  [[nodiscard]] static double node_sine(std::size_t node) noexcept;
  /// Black level layer, such as the base of clouds.
  struct BlackLayer {
    double height_m = 0.0;        ///< above sea level
    double kelvin = 0.0;          ///< by which the air takes its light
    double radiance_w_m2_sr = 0;  ///< of the layer itself, in band
  };
  /// Returns the radiance of a layer above a sensor by elevation, with the air before it, over a
  /// round Earth (physics.md eq. 84). Rays below the horizon are those that just pass the ground.
  /// `warmer_k` is that of Weather. RT-safe after the first call.
  [[nodiscard]] ByElevation layer_w_m2_sr(double sensor_m, double warmer_k,
                                          const BlackLayer& layer) const noexcept;

  /// Returns the clear sky's radiance by the tilt of a face at a height, W m-2 sr-1. RT-safe after
  /// the first call.
  [[nodiscard]] SkyByTilt clear_sky_by_tilt_w_m2_sr(double height_m,
                                                    double warmer_k) const noexcept;
  /// Returns the clear sky's radiance in a direction from a height, W m-2 sr-1. RT-safe.
  [[nodiscard]] double clear_sky_w_m2_sr(double height_m, double warmer_k,
                                         double sin_elevation) const noexcept;
  /// Returns the transmittance to space for the third source at a height, by the sine of the
  /// apparent elevation. RT-safe.
  [[nodiscard]] double sun_transmittance_frac(double height_m, double sin_elevation) const noexcept;

 private:
  /// Node with the logarithm of its radiance for air that is colder, as the climate, and warmer.
  struct Slice {
    std::array<float, 3> air;
    std::array<float, 3> log_radiance;
  };
  /// Place of a sensor height on the slices, and the shares of the three temperatures.
  struct Place;
  [[nodiscard]] Place place_of(double sensor_m, double warmer_k) const noexcept;
  [[nodiscard]] static float radiance_at(const Place& place, std::size_t node) noexcept;
  [[nodiscard]] static Node node_at(const Place& place, const Place& radiance,
                                    std::size_t node) noexcept;
  /// Place of a sensor height and of a sun on the slices of scattered sunlight.
  struct SunPlace;
  [[nodiscard]] SunPlace sun_place_of(double sensor_m, double sin_sun) const noexcept;
  [[nodiscard]] static Node scattered_at(const SunPlace& place, std::size_t node) noexcept;
  /// Mean over all azimuths of the radiance of a node of the sky.
  [[nodiscard]] double scattered_around(const SunPlace& place, double sin_sun, double sin_elevation,
                                        std::size_t node) const noexcept;
  std::vector<Slice> slices_;    ///< [sensor][node]
  std::vector<Node> scattered_;  ///< at 1 au, [sun][sensor][node]
  std::vector<Node> phases_;     ///< phase functions, or empty
};

/// Returns the sky by the tilt of a face from its nodes. RT-safe after the first call.
[[nodiscard]] SkyByTilt sky_by_tilt_of(const AirView::ByElevation& sky) noexcept;
/// Returns the sky in a direction from its nodes, in float32 as the shader does. RT-safe.
[[nodiscard]] float sky_at_elevation(const AirView::ByElevation& sky, float sin_elevation) noexcept;
/// Returns the logarithm of the mean extinction, m-1, for what a source of a temperature emits,
/// from the node of a line of sight: linear in 1/T between 300 K, 800 K and the sun. RT-safe.
[[nodiscard]] float air_log_extinction(const AirView::Node& node, float temperature_k) noexcept;

/// Air between a sensor and a point, from a table.
struct AirSight {
  std::array<float, 3> transmittance_frac;  ///< by source
  float path_radiance_w_m2_sr = 0.0F;
};
/// Looks up the node of a line of sight of `range_m` to a target at a height above sea level, of
/// either table, in float32 as the shader does. RT-safe.
/// @pre table.size() >= AirView::kNodes
[[nodiscard]] AirView::Node air_sight_node(std::span<const AirView::Node> table, float target_m,
                                           float range_m) noexcept;
/// Returns the path radiance of a line of sight from its node, W m-2 sr-1. RT-safe.
[[nodiscard]] float air_path_w_m2_sr(const AirView::Node& node, float range_m) noexcept;
/// Looks up a line of sight of `range_m` to a target at a height above sea level, in float32 as the
/// shader does. RT-safe.
/// @pre table.size() == AirView::kNodes
[[nodiscard]] AirSight air_sight(std::span<const AirView::Node> table, float target_m,
                                 float range_m) noexcept;
/// Returns the phase functions at the end of a table of scattered sunlight, for the cosine of the
/// angle between the line of sight and the sun, sr-1, in float32 as the shader does. RT-safe.
/// @pre sun_table.size() == AirView::kSunNodes
[[nodiscard]] AirView::Node air_sun_phase(std::span<const AirView::Node> sun_table,
                                          float cosine) noexcept;
/// Returns the node of the sky in a direction, of either table. RT-safe.
[[nodiscard]] AirView::Node air_sky_node(std::span<const AirView::Node> table,
                                         float sin_elevation) noexcept;
/// Returns the sum over the kinds of scatterers of a node's light times its phase function.
[[nodiscard]] inline float air_sun_w_m2_sr(const AirView::Node& light,
                                           const AirView::Node& phase) noexcept {
  return light[0] * phase[0] + light[1] * phase[1] + light[2] * phase[2] + light[3] * phase[3];
}
/// Looks up the sky in a direction. The path radiance is that of the sky. RT-safe.
[[nodiscard]] AirSight air_sky(std::span<const AirView::Node> table, float sin_elevation) noexcept;

}  // namespace emit::physics
