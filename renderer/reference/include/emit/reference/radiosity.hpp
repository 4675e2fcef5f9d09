// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "emit/reference/solid_solver.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/reference/voxel_model.hpp"
#include "emit/scene/scene_desc.hpp"

/// Radiation between the faces of a voxel model, the sky and the surroundings. Faces are gathered
/// into patches of about 20 cm that radiate evenly; every face sees the patches by rays of its own.
/// Short-wave and long-wave radiation are diffuse, and reflections between patches are followed
/// until what is left is below kRadiosityToleranceWM2.
namespace emit::reference {

/// Place and optics of a face for the exchange.
struct ExchangeFace {
  glm::dvec3 centre_m{0.0};
  glm::dvec3 normal{0.0};
  double area_m2 = 0.0;
  double solar_absorptance_frac = 0.0;
  double emissivity_frac = 0.0;
  physics::FilmSkin skin;  ///< what the film of the air takes from the material
  bool enclosed = false;   ///< the face looks into a closed cavity: it gets no rays and no sky
};

/// Irradiance of a face apart from direct sun, W/m2.
struct Incoming {
  double shortwave_w_m2 = 0.0;
  double longwave_w_m2 = 0.0;
};

/// Sky and surroundings as the exchange needs them.
struct ExchangeSky {
  double diffuse_w_m2 = 0.0;   ///< short-wave irradiance of the open sky on level ground
  double longwave_w_m2 = 0.0;  ///< long-wave irradiance of the open sky on level ground
  /// short-wave radiosity of what lies beyond the scene below the horizon.
  double ground_short_w_m2 = 0.0;
  double ground_long_w_m2 = 0.0;  ///< long-wave radiosity of the same
};

/// Share of a face's hemisphere that shows a patch.
struct PatchLink {
  std::uint32_t patch = 0;
  float share_frac = 0.0F;
};
/// Links of all patches, one patch after the other: those of patch p are links[start[p]] to
/// links[start[p + 1] - 1].
struct PatchLinks {
  std::span<const std::size_t> start;
  std::span<const PatchLink> links;
};

/// Reflections that solve_radiosity() leaves out, W/m2.
inline constexpr double kRadiosityToleranceWM2 = 1e-3;

/// Solves J_p = source_p + reflect_p sum_q F_pq J_q by adding up reflections. Returns a bound of
/// the radiosity that is left out of any patch, W/m2. It is at most kRadiosityToleranceWM2 unless
/// next to nothing absorbs.
/// @pre one entry per patch; shares and reflectances are at most 1, sources at least 0
[[nodiscard]] double solve_radiosity(const PatchLinks& links, std::span<const double> reflect,
                                     std::span<const double> source_w_m2,
                                     std::span<double> radiosity_w_m2);

/// Exchange of radiation in a scene. It is immutable after creation; any number of threads may ask.
class SceneExchange {
 public:
  /// Gathers the patches and traces `rays` rays per face.
  /// @pre faces and surfaces are of equal size.
  SceneExchange(std::span<const SolidFace> faces, std::span<const ExchangeFace> surfaces,
                const FaceFinder& finder, const SceneInstant& scene, std::uint32_t rays);

  /// Computes the irradiance of every face. `direct_w_m2` is the direct sun on each face, `face_k`
  /// its temperature. Returns the reflections that are left out, W/m2, as solve_radiosity() does.
  /// @pre direct_w_m2, face_k and out have one entry per face.
  [[nodiscard]] double incoming(std::span<const double> direct_w_m2, std::span<const double> face_k,
                                const ExchangeSky& sky, std::span<Incoming> out) const;

  /// Cosine-weighted share of a face's hemisphere that is sky.
  [[nodiscard]] double sky_frac(std::size_t face) const noexcept { return sky_frac_[face]; }
  /// Share of a face's hemisphere that leaves the scene below the horizon.
  [[nodiscard]] double ground_frac(std::size_t face) const noexcept { return ground_frac_[face]; }
  [[nodiscard]] std::size_t patches() const noexcept { return patch_area_m2_.size(); }

  using Link = PatchLink;
  [[nodiscard]] std::span<const Link> links(std::size_t face) const noexcept {
    return {links_.data() + link_start_[face], link_start_[face + 1] - link_start_[face]};
  }
  /// Returns the area-weighted means over the patches of values per face.
  /// @pre per_face has one value per face.
  [[nodiscard]] std::vector<double> patch_means(std::span<const double> per_face) const;

 private:
  void gather_patches(std::span<const SolidFace> faces);
  void trace(std::span<const ExchangeFace> surfaces, const FaceFinder& finder,
             const SceneInstant& scene, std::uint32_t rays);
  void link_patches();

  std::vector<double> absorptance_, emissivity_, area_m2_, sky_frac_, ground_frac_;
  std::vector<std::uint32_t> patch_;
  std::vector<std::size_t> link_start_;
  std::vector<Link> links_;
  std::vector<double> patch_area_m2_, patch_reflect_, patch_emissivity_, patch_sky_, patch_ground_;
  std::vector<std::size_t> patch_link_start_;
  std::vector<Link> patch_links_;
};

/// Visible share of the sun's disc for every face. The share is averaged over the face if the edge
/// of a shadow crosses it.
class SunOnFaces {
 public:
  SunOnFaces(std::span<const SolidFace> faces, std::span<const ExchangeFace> surfaces);
  /// Computes the visible share of every face.
  /// @pre out has one entry per face.
  void visible_frac(const SceneInstant& scene, const glm::dvec3& to_sun,
                    std::span<double> out) const;

 private:
  [[nodiscard]] double mean_frac(const SceneInstant& scene, const glm::dvec3& to_sun,
                                 std::size_t face) const;

  std::span<const SolidFace> faces_;
  std::vector<ExchangeFace> surfaces_;
  std::vector<std::uint32_t> node_start_;  ///< first entry of node_faces_ of every node
  std::vector<std::uint32_t> node_faces_;  ///< faces around every node
};

}  // namespace emit::reference
