// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_patch.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "surface/mesh/tangents.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

/// Number of rays along the surface.
constexpr std::size_t kTangents = CasterRays::kMaxRays;
/// Distance from the origin of rel beyond which an entity sees its own hull only.
constexpr float kMaxWorldM = 20'000.0F;
/// Cosine between the normals of two faces below which one stands upright on the other.
constexpr float kWallCos = 0.3F;
/// Greatest distance of a wall that counts as a foot on the surface, in m (SurfaceSample::foot_m).
constexpr float kMaxFootM = 3.0F;
/// Distance in ray offsets behind a wall at which the surface is sought under it, and its greatest
/// depth there.
constexpr float kUnderOffsets = 8.0F;
/// Distance in ray offsets from a wall within which a covered sample lies on its foot, and that
/// beside the wall to which it goes.
constexpr float kOnFootOffsets = 4.0F;
constexpr float kBesideFootOffsets = 2.0F;
/// Allowed error of a share of the sky: in tolerances of temperature, and at least the share that
/// rays do not resolve.
constexpr float kAlikeFrac = 0.25F;
constexpr float kSkyNoiseFrac = 0.002F;
/// Tangent of the half angle of the cone that rain comes from: 20 degrees, the slant of drops that
/// fall with 5.5 m/s in a wind of 2 m/s.
constexpr float kRainConeTangent = 0.364F;
/// Length of the rays along the surface, in m. Rays that graze the surface are expensive, and a
/// view that is free farther would help only edges longer than half of that.
constexpr float kFeelM = 20.0F;
/// Distance around the parents, in lengths of the halved edge, within which nothing may stand up if
/// a sample is to take the mean of their views.
constexpr float kFreeLengths = 2.0F;

/// Returns the direction of a ray along the surface whose tangents are `u` and `v`.
glm::vec3 tangent(std::size_t ray, const glm::vec3& u, const glm::vec3& v) {
  const auto angle =
      static_cast<float>(2.0 * physics::kPi * (static_cast<double>(ray) + 0.5) / kTangents);
  return std::cos(angle) * u + std::sin(angle) * v;
}

}  // namespace

PatchSampler::PatchSampler(const SurfaceInputs& inputs, const DriveSensitivity& sensitivity,
                           const SurfaceModelOptions& options)
    : in_(inputs),
      options_(options),
      held_(inputs.geometry, inputs.materials, inputs.entity_of_object,
            inputs.places.origin_world_m()),
      view_(kSampleViewRays),
      sky_(inputs.heat.sky_measure() == SkyMeasure::cosine ? kSampleSkyRays : kSampleViewRays),
      sphere_(kSampleViewRays),
      tracer_(inputs, options) {
  // Spread the rays evenly over the disc that the cone cuts out of a level plane.
  for (std::size_t k = 0; k < rain_from_.size(); ++k) {
    constexpr float kGoldenAngleRad = 2.3999632F;
    const float way = (static_cast<float>(k) + 0.5F) / static_cast<float>(rain_from_.size());
    const float tangent = kRainConeTangent * std::sqrt(way);
    const float azimuth_rad = kGoldenAngleRad * static_cast<float>(k);
    rain_from_[k] = glm::normalize(
        glm::vec3(tangent * std::cos(azimuth_rad), tangent * std::sin(azimuth_rad), 1.0F));
  }
  // Find how far heat spreads in the memory of the slowest mode of each material.
  for (std::uint32_t m = 0; m < inputs.materials.size(); ++m) {
    const physics::FosterNetwork* network =
        options.lateral && inputs.heat.foster() != nullptr ? &inputs.history.network(m) : nullptr;
    const double slowest_s =
        network != nullptr && network->count != 0 ? network->modes[network->count - 1].tau_s : 0.0;
    memory_m_.push_back(std::sqrt(diffusivity_m2_s(inputs.materials[m]) * slowest_s));
  }
  // Find by material the difference of shares of the sky that is a quarter of the tolerance.
  for (std::uint32_t m = 0; m < inputs.materials.size(); ++m) {
    const auto alike_k = kAlikeFrac * static_cast<float>(options.tolerance_k);
    sky_limit_frac_.push_back(
        std::max(kSkyNoiseFrac, alike_k / std::max(std::abs(sensitivity.sky_k(m)), 1e-3F)));
  }
}

SampleState PatchSampler::start_state(const SurfaceSample& sample, std::span<const float> sun_frac,
                                      StartMemo& memo) const noexcept {
  const glm::vec3 normal = in_.record.rays.front().normal(sample);
  const auto make = [&] {
    return in_.heat.open_start(sample, normal, in_.history, in_.record.tail);
  };
  if (memo.material != sample.material || memo.normal != normal) {
    memo = {sample.material, normal, make()};
  }
  SampleState state = memo.state;
  if (!in_.history.starts_balanced(sample.material)) return state;
  in_.heat.hide_start(
      sample, normal, in_.history,
      sun_share(in_.record, sample, sun_frac, in_.history.day_sun_j_m2(glm::dvec3(normal))), state);
  return state;
}

bool PatchSampler::inherit_view(SurfacePatch& patch, std::uint32_t index,
                                const SampleStand& stand) const {
  if (!stand.parents) return false;
  const auto [a, b] = *stand.parents;
  SurfaceSample& sample = patch.samples[index];
  const SurfaceSample& low = patch.samples[a];
  const SurfaceSample& high = patch.samples[b];
  // Demand rays where the parents' views were not smooth, where something stands near, or where the
  // normal turns by more than the mean of views stands for.
  const float limit_frac = sky_limit_frac_[sample.material];
  const float surplus_frac = std::max(patch.sky_surplus_frac[a], patch.sky_surplus_frac[b]);
  if (surplus_frac > limit_frac || low.covered || high.covered) return false;
  // The radiation of hot faces bends where the sky does not.
  if (patch.held[a].frac > 0.0F || patch.held[b].frac > 0.0F) return false;
  // So does the edge of a shelter from rain.
  if (low.rain_frac != high.rain_frac) return false;
  const float edge_m = glm::distance(low.position_m, high.position_m);
  if (kFreeLengths * edge_m > std::min(low.flat_m, high.flat_m)) return false;
  const glm::vec3 to_sky = 0.5F * (patch.to_sky[a] + patch.to_sky[b]);
  const glm::vec3 turn = sample.normal - 0.5F * (low.normal + high.normal);
  if (std::abs(glm::dot(to_sky, turn)) > limit_frac) return false;

  // Take the means.
  const auto mean = [](float x, float y) { return 0.5F * (x + y); };
  sample.sky_frac = mean(low.sky_frac, high.sky_frac);
  sample.far_frac = mean(low.far_frac, high.far_frac);
  sample.sphere_sky_frac = mean(low.sphere_sky_frac, high.sphere_sky_frac);
  sample.rain_frac = low.rain_frac;
  sample.hull_open_frac = mean(low.hull_open_frac, high.hull_open_frac);
  sample.hull_tilt_frac = 0.5F * (low.hull_tilt_frac + high.hull_tilt_frac);
  sample.foot_m = mean(low.foot_m, high.foot_m);
  sample.before_frac = mean(low.before_frac, high.before_frac);
  // Take the greater free distance of the parents, less the way from there.
  sample.flat_m = std::max(low.flat_m, high.flat_m) - 0.5F * edge_m;
  patch.to_sky[index] = to_sky;
  patch.sky_surplus_frac[index] = surplus_frac;
  if (options_.exchange) {
    // Share the view of a parent that sees faces.
    const std::uint32_t view = patch.view_of[patch.seen[patch.view_of[a]].empty() ? b : a];
    patch.view_of[index] = view;
    if (patch.seen[view].empty()) sample.far_frac = 1.0F - sample.sky_frac;
  }
  return true;
}

void PatchSampler::look_around(SurfacePatch& patch, std::uint32_t index,
                               const SampleStand& stand) const {
  SurfaceSample& sample = patch.samples[index];
  // Let an entity see the world from where it stands now, and its own hull always. If it is far off
  // it sees its hull alone, because float32 would not resolve the hull there.
  const bool far_off =
      sample.entity >= 0 &&
      glm::length(in_.entities_now[static_cast<std::size_t>(sample.entity)].position_m) >
          kMaxWorldM;
  float offset_m = ray_offsets(sample.position_m, sample.facet_m).around_m;
  if (sample.entity >= 0 && !far_off) {
    const EntityPlacement& stands = in_.entities_now[static_cast<std::size_t>(sample.entity)];
    offset_m = std::max(
        offset_m, ray_rounding_m(stands.rel_from_body * sample.position_m + stands.position_m));
  }
  ViewPoint point{sample.position_m, sample.normal, stand.inward, offset_m};
  ViewPoint drawn{stand.drawn_m, sample.normal, stand.inward, offset_m};
  std::array<EntityPlacement, 1> self;
  CasterSelection selection{true, {}};
  std::vector<EntityPlacement> placed;
  if (sample.entity >= 0) {
    placed.assign(in_.entities_now.begin(), in_.entities_now.end());
    EntityPlacement& own = placed[static_cast<std::size_t>(sample.entity)];
    if (far_off) {
      for (EntityPlacement& place : placed) place.on = false;
      own.position_m = glm::vec3(0.0F);
      selection.fixed = false;
    }
    own.on = true;
    for (ViewPoint* each : {&point, &drawn}) {
      each->position_m = own.rel_from_body * each->position_m + own.position_m;
      each->normal = own.rel_from_body * each->normal;
      each->inward = own.rel_from_body * each->inward;
    }
    selection.entities = placed;
  }
  // Find what the own hull leaves open, for other attitudes (view_of_now()).
  if (sample.entity >= 0) {
    std::vector<EntityPlacement> own_alone = placed;
    for (EntityPlacement& place : own_alone) place.on = false;
    own_alone[static_cast<std::size_t>(sample.entity)].on = true;
    const ViewOpening hull = sky_.opening(in_.rays, point, {false, own_alone});
    sample.hull_open_frac = hull.open_frac;
    sample.hull_tilt_frac =
        glm::transpose(placed[static_cast<std::size_t>(sample.entity)].rel_from_body) *
        hull.tilt_frac;
  }
  // Find the open shares.
  const ViewShares open = sky_.shares(in_.rays, point, selection);
  sample.sky_frac = open.sky_frac;
  sample.far_frac = open.far_frac;
  patch.to_sky[index] = open.to_sky;
  if (!scene::water_store_of(in_.materials[sample.material]).none()) {
    sample.rain_frac = rain_share(point, selection);
  }
  if (in_.heat.sky_measure() == SkyMeasure::sphere) {
    sample.sphere_sky_frac = sphere_.of_face(in_.rays, point, selection).sky_frac;
  }
  // Mark the sample as covered if it sees nothing but backs of faces, sheets aside: it lies inside
  // a body.
  if (open.sky_frac + open.far_frac == 0.0F) {
    const SurfaceView view = view_.view(in_.rays, point, selection);
    const std::span<const SeenFace> faces(view.seen.data(), view.seen_count);
    const bool inside_a_body = std::ranges::none_of(
        faces, [&](const SeenFace& face) { return face.front || of_a_sheet(face); });
    sample.covered = sample.covered || inside_a_body;
  }
  if (options_.exchange) look_at_faces(patch, index, drawn, selection);
  feel_along(patch, index, point, selection);
}

void PatchSampler::leave_foot(SurfacePatch& patch, std::uint32_t index,
                              const SampleStand& stand) const {
  SurfaceSample& sample = patch.samples[index];
  const float offset_m = ray_offsets(sample.position_m, sample.facet_m).around_m;
  if (!sample.covered || sample.entity >= 0 || sample.foot_m > kOnFootOffsets * offset_m) return;
  // Go across the wall in the direction in which it is nearest.
  const auto [u, v] = tangents_of(sample.normal);
  std::array<CasterRay, kTangents> rays;
  std::array<CasterHit, kTangents> hits;
  for (std::size_t k = 0; k < kTangents; ++k) {
    rays[k] = {sample.position_m + offset_m * stand.inward + 2.0F * offset_m * sample.normal,
               tangent(k, u, v)};
  }
  const std::uint32_t met = in_.rays.first_hits(rays, {true, {}}, hits, kFeelM);
  std::size_t nearest = kTangents;
  for (std::size_t k = 0; k < kTangents; ++k) {
    if (((met >> k) & 1U) == 0U || hits[k].front ||
        std::abs(glm::dot(hits[k].normal, sample.normal)) > kWallCos) {
      continue;
    }
    if (nearest == kTangents || hits[k].distance_m < hits[nearest].distance_m) nearest = k;
  }
  if (nearest == kTangents) return;
  const glm::vec3& out = hits[nearest].normal;
  const float away_m = hits[nearest].distance_m * glm::dot(rays[nearest].direction, out);
  const glm::vec3 beside_m = (away_m + kBesideFootOffsets * offset_m) * out;
  SurfaceSample moved = sample;
  moved.covered = false;
  moved.foot_m = std::numeric_limits<float>::infinity();
  moved.position_m += beside_m;
  std::swap(sample, moved);
  SampleStand there = stand;
  there.drawn_m += beside_m;
  look_around(patch, index, there);
  if (!sample.covered) return;
  // Another body stands beside this one.
  sample = moved;
  look_around(patch, index, stand);
}

float PatchSampler::rain_share(const ViewPoint& point,
                               const CasterSelection& selection) const noexcept {
  // Nobody knows what would keep rain off an underside if its entity turned over.
  if (point.normal.z <= 0.0F) return 1.0F;
  std::array<CasterRay, CasterRays::kMaxRays> rays;
  std::size_t count = 0;
  for (const glm::vec3& direction : rain_from_) {
    if (glm::dot(direction, point.normal) <= 0.0F) continue;  // it comes from behind the face
    rays[count++] = {point.position_m + point.offset_m * (point.normal + point.inward), direction};
  }
  if (count == 0) return 1.0F;
  const std::uint32_t blocked = in_.rays.blocked(std::span(rays).first(count), selection);
  return 1.0F - static_cast<float>(std::popcount(blocked)) / static_cast<float>(count);
}

void PatchSampler::look_at_faces(SurfacePatch& patch, std::uint32_t index, const ViewPoint& point,
                                 const CasterSelection& selection) const {
  const SurfaceView view = view_.view(in_.places, point, selection);
  std::vector<SeenPlace>& seen = patch.seen[index];
  seen.clear();
  seen.reserve(view.seen_count);
  for (std::uint32_t i = 0; i < view.seen_count; ++i) {
    const SeenFace& face = view.seen[i];
    seen.push_back({face.instance, face.triangle, face.barycentric, face.weight_frac, !face.front});
  }
  patch.held[index] = {};
  if (!held_.empty()) take_held(patch, index, point, selection);
  SurfaceSample& sample = patch.samples[index];
  // Let surroundings fill the rest if no face was met.
  if (seen.empty()) sample.far_frac = 1.0F - sample.sky_frac;
}

void PatchSampler::feel_along(SurfacePatch& patch, std::uint32_t index, const ViewPoint& point,
                              const CasterSelection& selection) const {
  SurfaceSample& sample = patch.samples[index];
  const glm::vec3& n = point.normal;
  const auto [u, v] = tangents_of(n);
  const float offset_m = point.offset_m;
  const glm::vec3 base_m = point.position_m + offset_m * point.inward;
  // Send rays in all tangent directions, first above the surface and then below it.
  std::array<CasterRay, kTangents> rays;
  std::array<CasterHit, kTangents> above;
  std::array<CasterHit, kTangents> below;
  for (std::size_t k = 0; k < kTangents; ++k) {
    rays[k] = {base_m + 2.0F * offset_m * n, tangent(k, u, v)};
  }
  const std::uint32_t met_above = in_.rays.first_hits(rays, selection, above, kFeelM);
  for (CasterRay& ray : rays) ray.origin_m -= 4.0F * offset_m * n;
  const std::uint32_t met_below = in_.rays.first_hits(rays, selection, below, kFeelM);
  // Take the nearest hit of either set as the end of the plane.
  sample.flat_m = kFeelM;
  for (std::size_t k = 0; k < kTangents; ++k) {
    if (((met_above >> k) & 1U) != 0U) sample.flat_m = std::min(sample.flat_m, above[k].distance_m);
    if (((met_below >> k) & 1U) != 0U) sample.flat_m = std::min(sample.flat_m, below[k].distance_m);
  }
  if (!options_.lateral) return;

  // Find the walls that stand on the surface: if it continues under them, nothing reaches it there.
  // A covered sample lies under a solid and looks at its walls from behind.
  const double memory_m = memory_m_[sample.material];
  double beyond_frac = 0.0;
  for (std::size_t k = 0; k < kTangents; ++k) {
    if (((met_above >> k) & 1U) == 0U || above[k].distance_m > kMaxFootM ||
        above[k].front == sample.covered || std::abs(glm::dot(above[k].normal, n)) > kWallCos) {
      continue;
    }
    const auto count = [&] {
      sample.foot_m = std::min(sample.foot_m, above[k].distance_m);
      beyond_frac +=
          std::exp(-static_cast<double>(above[k].distance_m) / std::max(memory_m, 1e-6)) /
          kTangents;
    };
    if (sample.covered) {
      count();
      continue;
    }
    const CasterRay down{rays[k].origin_m + 4.0F * offset_m * n +
                             (above[k].distance_m + kUnderOffsets * offset_m) * rays[k].direction,
                         -n};
    std::array<CasterHit, 1> under;
    if (in_.rays.first_hits({&down, 1}, selection, under) != 0U &&
        under[0].distance_m < kUnderOffsets * offset_m) {
      count();
    }
  }
  // Heat of the time before the history has come from beside the solid alone (physics.md eq. 23).
  sample.before_frac = static_cast<float>(sample.covered ? beyond_frac : 1.0 - beyond_frac);
}

bool PatchSampler::of_a_sheet(const SeenFace& face) const noexcept {
  const std::uint32_t index = in_.geometry.instances[face.instance].mesh;
  const scene::Mesh& mesh = in_.detail != nullptr && in_.detail->has(index)
                                ? in_.detail->full_mesh(index)
                                : in_.geometry.meshes[index];
  return std::ranges::any_of(mesh.submeshes, [&](const scene::Submesh& submesh) {
    return in_.materials[submesh.material].sheet && 3 * face.triangle >= submesh.first_index &&
           3 * face.triangle < submesh.first_index + submesh.index_count;
  });
}

void PatchSampler::take_held(SurfacePatch& patch, std::uint32_t index, const ViewPoint& point,
                             const CasterSelection& selection) const {
  const auto material_of = [&](std::uint32_t instance, std::uint32_t triangle) -> const auto& {
    const scene::Mesh& mesh = in_.geometry.meshes[in_.geometry.instances[instance].mesh];
    const auto found = std::ranges::find_if(mesh.submeshes, [&](const scene::Submesh& submesh) {
      return 3 * triangle >= submesh.first_index &&
             3 * triangle < submesh.first_index + submesh.index_count;
    });
    return in_.materials[found->material];
  };
  std::vector<HeldFaces::Part> parts;
  held_.seen_from(in_.places, point, selection, parts);
  std::vector<SeenPlace>& seen = patch.seen[index];
  SurfaceSample& sample = patch.samples[index];
  HeldView& held = patch.held[index];
  for (const HeldFaces::Part& part : parts) {
    const scene::Material& material = material_of(part.instance, part.triangle);
    held.frac += part.frac;
    held.longwave_w_m2 += part.frac * static_cast<float>(material.emissivity_frac *
                                                         physics::kStefanBoltzmannWPerM2K4 *
                                                         std::pow(*material.prescribed_k, 4.0));
    for (std::size_t b = 0; in_.lights != nullptr && b < in_.lights->bands(); ++b) {
      const auto of_material = static_cast<std::uint32_t>(&material - in_.materials.data());
      held.sent_w_m2_sr[b] +=
          part.frac * in_.lights->emissivity_frac(of_material, b) *
          in_.lights->black_w_m2_sr(b, static_cast<float>(*material.prescribed_k));
    }
  }
  // Take what rays found of such faces out.
  float others_frac = 0.0F;
  float found_frac = 0.0F;
  std::erase_if(seen, [&](const SeenPlace& place) {
    const bool is_held = material_of(place.instance, place.triangle).prescribed_k.has_value();
    (is_held ? found_frac : others_frac) += place.weight_frac;
    return is_held;
  });
  if (parts.empty() && found_frac == 0.0F) return;
  // Let all else share the rest of the hemisphere as before.
  const float closed_frac = std::max(0.0F, 1.0F - sample.sky_frac - sample.far_frac);
  const float all_frac = others_frac + found_frac;
  const float others_now_frac = all_frac > 0.0F ? closed_frac * others_frac / all_frac : 0.0F;
  const float rest_frac = sample.sky_frac + sample.far_frac + others_now_frac;
  const float scale = rest_frac > 0.0F ? std::max(0.0F, 1.0F - held.frac) / rest_frac : 0.0F;
  sample.sky_frac *= scale;
  sample.far_frac *= scale;
  for (SeenPlace& place : seen) place.weight_frac *= scale * others_now_frac / others_frac;
  const glm::vec2 middle(1.0F / 3.0F);
  for (const HeldFaces::Part& part : parts) {
    seen.push_back({part.instance, part.triangle, middle, part.frac, part.behind});
  }
}

void PatchSampler::integrate(std::span<const NewSample> samples, StartMemo& memo) const {
  const HistoryRecord& record = in_.record;
  const std::size_t count = record.size();
  const bool keeps = keeps_sent();
  // Count everything seen as surroundings, because samples are not numbered yet. Only what faces of
  // a prescribed temperature send is known.
  const auto alone = [](const SurfacePatch& side, std::uint32_t index) {
    SurfaceSample sample = side.samples[index];
    sample.far_frac = std::max(0.0F, 1.0F - sample.sky_frac - side.held[index].frac);
    return sample;
  };
  const auto drive_of = [&record](const SurfacePatch& side, std::uint32_t index, std::size_t i) {
    SampleDrive drive;
    drive.sun_frac = side.sun_frac.row(index)[i];
    if (side.cloud_sun.length() != 0) drive.sun_frac *= side.cloud_sun.row(index)[i];
    drive.longwave_begin_w_m2 = drive.longwave_end_w_m2 = side.held[index].longwave_w_m2;
    drive.take_entity(record.intervals[i].entities, side.samples[index]);
    if (side.hidden_sky.length() != 0) {
      const HiddenSky& hidden = side.hidden_sky.row(index)[i];
      drive.hidden_sky_frac = hidden.frac;
      drive.longwave_begin_w_m2 += hidden.hot_w_m2;
      drive.longwave_end_w_m2 += hidden.hot_w_m2;
    }
    return drive;
  };
  const auto place_of = [](const NewSample& each) { return std::pair(each.patch, each.index); };
  /// One face of a sample, and what it sends out.
  struct Face {
    SurfaceSample sample;
    SentRow sent;
  };
  std::array<Face, kAdvanceTogether> faces;
  std::array<Face, kAdvanceTogether> other_faces;
  std::array<SampleState, kAdvanceTogether> states;
  std::array<SampleAdvance, kAdvanceTogether> fronts;
  // Inputs and outputs of the other faces of sheets.
  std::array<SampleDrive, kAdvanceTogether> back_drives;
  std::array<std::optional<SheetBack>, kAdvanceTogether> backs;
  std::array<SampleOutput, kAdvanceTogether> back_outputs;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const auto [patch, index] = place_of(samples[k]);
    faces[k] = {alone(*patch, index), SentRow(patch->sent.row(index))};
    const SurfaceSample& front = faces[k].sample;
    states[k] = start_state(front, patch->sun_frac.row(index), memo);
    if (keeps) patch->start_k[index] = states[k].modes_k;
    fronts[k].sample = &front;
    fronts[k].state = &states[k];
    if (patch->back == nullptr || !in_.materials[front.material].sheet) continue;
    other_faces[k] = {alone(*patch->back, index), SentRow(patch->back->sent.row(index))};
    backs[k].emplace(SheetBack{other_faces[k].sample, back_drives[k]});
    fronts[k].back = &*backs[k];
  }
  // Advance over the intervals, and store what others will receive.
  for (std::size_t i = 0; i < count; ++i) {
    const HeatInterval& interval = record.intervals[i];
    const SurfaceForcing& begin = interval.forcing.begin;
    const bool first = keeps && i == 0;
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const auto [patch, index] = place_of(samples[k]);
      SampleAdvance& front = fronts[k];
      front.normal = record.rays[i].normal(*front.sample);
      front.drive = drive_of(*patch, index, i);
      if (first) {
        faces[k].sent.keep_begin(
            in_.heat.output(*front.sample, front.normal, begin, front.drive, states[k]));
      }
      if (front.back == nullptr) continue;
      back_drives[k] = drive_of(*patch->back, index, i);
      if (first) {
        other_faces[k].sent.keep_begin(in_.heat.output(other_faces[k].sample, -front.normal, begin,
                                                       back_drives[k], states[k]));
      }
    }
    in_.heat.advance_all(std::span(fronts).first(samples.size()), interval);
    for (std::size_t k = 0; k < samples.size(); ++k) {
      const SampleAdvance& front = fronts[k];
      if (keeps) faces[k].sent.keep_end(i, front.output);
      if (front.back == nullptr || (!keeps && i + 1 < count)) continue;
      back_outputs[k] = in_.heat.output(other_faces[k].sample, -front.normal, interval.forcing.end,
                                        back_drives[k], states[k]);
      if (keeps) other_faces[k].sent.keep_end(i, back_outputs[k]);
    }
  }
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const auto [patch, index] = place_of(samples[k]);
    patch->states[index] = states[k];
    patch->outputs[index] = fronts[k].output;
    if (fronts[k].back != nullptr) patch->back->outputs[index] = back_outputs[k];
  }
}

void PatchSampler::evaluate(std::span<const NewSample> samples, StartMemo& memo) const {
  EMIT_CHECK_OP(samples.size(), <=, kAdvanceTogether);
  for (const NewSample& each : samples) {
    // Find the view and the shade of each face.
    const std::uint32_t index = each.index;
    const auto look = [&](SurfacePatch& side) {
      if (!inherit_view(side, index, each.stand)) {
        look_around(side, index, each.stand);
        leave_foot(side, index, each.stand);
      }
      tracer_.trace(side.samples[index], side.sun_frac.row(index), side.hidden_sky.row(index),
                    side.cloud_sun.row(index));
    };
    SurfacePatch& patch = *each.patch;
    look(patch);
    if (patch.back && in_.materials[patch.samples[index].material].sheet) look(*patch.back);
  }
  integrate(samples, memo);
}

void SurfacePatch::begin(std::size_t intervals, bool entities, bool clouds, bool keeps_sent) {
  EMIT_CHECK(samples.empty());
  begun_ = true;
  sun_frac = RowStore<float>(intervals);
  hidden_sky = RowStore<HiddenSky>(entities ? intervals : 0);
  cloud_sun = RowStore<float>(clouds ? intervals : 0);
  sent = SentHistory(keeps_sent ? SentRow::length(intervals) : 0);
  if (back) back->begin(intervals, entities, clouds, keeps_sent);
}

void SurfacePatch::grow(std::size_t vertices) {
  constexpr float kUnknown = std::numeric_limits<float>::infinity();
  const std::size_t before = samples.size();
  EMIT_CHECK(begun_);
  EMIT_CHECK_OP(vertices, >=, before);
  samples.resize(vertices);
  seen.resize(vertices);
  view_of.resize(vertices);
  std::iota(view_of.begin() + static_cast<std::ptrdiff_t>(before), view_of.end(),
            static_cast<std::uint32_t>(before));
  sent.grow(vertices);
  if (sent.length() != 0) start_k.resize(vertices);
  states.resize(vertices);
  outputs.resize(vertices);
  surplus_k.resize(vertices, -1.0F);
  to_sky.resize(vertices);
  held.resize(vertices);
  sky_surplus_frac.resize(vertices, kUnknown);
  sun_frac.grow(vertices);
  hidden_sky.grow(vertices);
  cloud_sun.grow(vertices);
  if (back) back->grow(vertices);
}

void SurfacePatch::free_all_but_rows() {
  samples = {};
  seen = {};
  view_of = {};
  start_k = {};
  states = {};
  outputs = {};
  surplus_k = {};
  to_sky = {};
  held = {};
  sky_surplus_frac = {};
  if (back) back->free_all_but_rows();
}

}  // namespace emit::renderer
