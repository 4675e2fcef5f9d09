// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float4.hpp>
#include <glm/ext/vector_int2.hpp>
#include <glm/ext/vector_uint2.hpp>
#include <optional>
#include <span>
#include <vector>

#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "shared/shade_params.glsl.h"
#include "surface/heat/surface_node.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/shade/shade_response.hpp"
#include "surface/shade/silhouettes.hpp"

namespace emit::renderer {

/// Where entities have shaded static surfaces lately, in texels of centimetres: triangles there are
/// as large as the warm-up left them, because nobody knew. Level squares of ground, pages, are
/// taken where shade falls and given back when nothing is left of it. A texel holds for each mode
/// of ShadeResponse the mean of shade times direct sun with the weight exp(-age / tau), so that
/// -sum w_k A_k, times the cosine and the share of the sun that what stands still leaves, is what
/// entities have changed of the temperature there.
///
/// Frames add that by pixel, and take the same off by vertex, where samples hold it already in
/// full: the sum is what samples have, with edges where they are. What the response gets wrong, it
/// gets wrong between a pixel and its vertices only.
///
/// Owner: CachedSurface. Thread: the renderer's; computes on all cores. Real time: everything but
/// the constructor is RT-safe.
class ShadePages {
 public:
  static constexpr std::size_t kPages = 128;
  static constexpr std::uint32_t kSide = EMIT_PAGE_SIDE;
  /// Texels of a page's own; the rim is its neighbours'.
  static constexpr std::uint32_t kOwnSide = kSide - 2;
  /// A page is carried on by so much at a time, as a rule; pages take turns.
  static constexpr std::int64_t kStepNs = 200'000'000;
  static constexpr std::int64_t kTurns = 8;
  static constexpr std::int64_t kTurnNs = kStepNs / kTurns;
  static constexpr std::int64_t kShortTurns = 10'000'000'000 / kTurnNs;
  /// Where sim time goes faster than that, all pages are carried on at a time, by so much at most,
  /// so often at most; after a jump shade is made up for over the last of that.
  static constexpr std::int64_t kTurnsPerFrame = 3 * kTurns;
  static constexpr std::int64_t kMostWindowTurns = 15'000'000'000 / kTurnNs;
  static constexpr std::int64_t kMostWindows = 4;
  /// A page of so many vertices is fine enough as it is.
  static constexpr std::size_t kMostMembers = 4096;

  struct Member {
    std::uint32_t sample = 0;
    glm::vec4 shade{0.0F};  ///< as the texels around it have it
    float shown_k = 0.0F;   ///< of vertices_k(), by this page
  };
  struct Page {
    bool used = false;
    bool changed = false;      ///< texels, since forget_changes()
    bool top_changed = false;  ///< top_m, since forget_changes()
    bool fine = false;         ///< has more vertices than kMostMembers: not shown
    int level = 0;             ///< texels of 2^level m
    glm::ivec2 cell{0};        ///< own squares of that level, from the origin of rel
    float texel_m = 1.0F;
    glm::vec2 first_m{0.0F};       ///< middle of the first texel, rel
    float plane_m = 0.0F;          ///< height of the plane, rel
    float reach_m = 0.0F;          ///< nothing higher above the plane is shaded
    float lowest_m = 0.0F;         ///< nor is it sought lower, negative
    glm::vec4 left_frac{1.0F};     ///< of what texels and members hold, by mode
    std::vector<glm::vec4> shade;  ///< kSide rows of kSide texels
    std::vector<float> target;     ///< likewise: scratch of a step
    /// Likewise: nothing higher above the plane was shaded along these rays, m.
    std::vector<float> top_m;
    std::array<std::uint8_t, kSide> marked{};  ///< by row: something of it is not zero
    std::vector<Member> members;
    glm::vec4 most{0.0F};  ///< of the texels
    std::int64_t members_ns = 0;
    std::int64_t at_turn = 0;    ///< texels are those of then
    std::int64_t cast_turn = 0;  ///< latest in which an entity cast on it
    std::int64_t come_turn = 0;  ///< likewise, one that has come since the start
  };
  struct Inputs {
    const Environment& environment;
    std::span<const PoseHistory> entities;
    const CasterRays& rays;
    threads::WorkerPool& workers;
    Silhouettes& silhouettes;
  };

  /// `drawn`: samples that are vertices. `start_ns`: a node of the grid that steps begin at.
  ShadePages(const SurfaceSamples& all, std::uint32_t drawn, ShadeResponse response,
             std::size_t entities, std::int64_t start_ns, float tolerance_k);

  /// Nothing has been shaded before `now_ns`; what the entities shade where they stand then, the
  /// samples know.
  void restart(std::int64_t now_ns, std::span<const PoseHistory> entities) noexcept;
  /// Does the steps up to `until_ns`. Where that lies before the latest, it forgets all shade.
  void run(std::int64_t until_ns, const SurfaceSamples& all, const Inputs& inputs) noexcept;

  [[nodiscard]] std::span<const Page> pages() const noexcept { return pages_; }
  [[nodiscard]] const ShadeResponse& response() const noexcept { return response_; }
  /// By vertex: sum w_k A_k, K.
  [[nodiscard]] std::span<const float> vertices_k() const noexcept { return vertices_k_; }
  [[nodiscard]] std::span<const ChangedRanges::Range> changes() const noexcept {
    return changes_.ranges();
  }
  void forget_changes() noexcept;
  /// Way of a shadow per metre of height in the latest step, towards the sun.
  [[nodiscard]] const glm::vec2& slope() const noexcept { return slope_; }
  /// In the latest ten seconds, or the latest run(), shade found no page, or took one that was
  /// worth more than the tolerance, or something was too fast.
  [[nodiscard]] bool short_of_pages() const noexcept {
    return short_turn_ > next_turn_ - kShortTurns || short_turn_ >= first_turn_;
  }

 private:
  /// An entity casts on a page.
  struct Cast {
    std::uint32_t page = 0;
    std::uint32_t mover = 0;
    [[nodiscard]] bool operator==(const Cast&) const noexcept = default;
  };
  /// One of some places of an entity within a step.
  struct Place {
    PlacedSilhouette silhouette;
    std::uint32_t number = 0;
    std::uint32_t of = 1;
  };
  /// Of an entity within a step: shares of EMIT_SHADE_TAPS that are equal.
  static constexpr std::size_t kMostPlaces = 8;
  static constexpr std::size_t kMostCells = 24;  ///< that an entity at one place may shade
  static constexpr std::size_t kMostCasts = 96;  ///< pages of an entity within a step

  /// The pages whose turn it is, by what entities shaded in the latest kTurns; or all of them, by
  /// what they shaded in the latest `turns`.
  void take_turn(std::int64_t turn, std::int64_t turns, const SurfaceSamples& all,
                 const Inputs& inputs) noexcept;
  void cast(std::size_t mover, std::int64_t turn, std::int64_t turns, bool come,
            const glm::dvec3& to_sun, const Inputs& inputs) noexcept;
  /// Pages on which an entity casts from one place.
  void find_pages(std::size_t mover, std::int64_t turn, std::int64_t turns, bool come,
                  const PlacedSilhouette& placed, float ground_m, float top_m,
                  const Inputs& inputs) noexcept;
  /// A cell holds some of what a silhouette may shade.
  [[nodiscard]] static bool meets(const PlacedSilhouette& placed, float texel_m,
                                  const glm::ivec2& cell, float plane_m) noexcept;
  [[nodiscard]] Page* page_at(int level, const glm::ivec2& cell) noexcept;
  /// Height of the ground of a page that begins: of its neighbours, where theirs will do.
  [[nodiscard]] std::optional<float> plane_of(int level, const glm::ivec2& cell, float top_m,
                                              const CasterRays& rays) const noexcept;
  /// One that is not used; for an entity that has `come` since the start, else the one that
  /// matters least; null: there is none.
  [[nodiscard]] Page* take_page(std::int64_t turn, bool come) noexcept;
  [[nodiscard]] bool has_come(std::size_t mover, const PoseHistory& entity,
                              std::int64_t at_ns) const noexcept;
  void give_back(Page& page) noexcept;
  [[nodiscard]] bool begin(Page& page, int level, const glm::ivec2& cell, float top_m,
                           const CasterRays& rays) const noexcept;
  /// Finds the vertices of a page.
  void gather(Page& page, const SurfaceSamples& all, std::int64_t at_ns) const noexcept;
  void shade(Page& page, std::uint32_t index, float flux_frac, const glm::vec4& gain,
             const Silhouettes& silhouettes) noexcept;
  /// A texel and its neighbours were shaded up to that height.
  static void raise(Page& page, int x, int y, float top_m) noexcept;
  void show_vertices(Page& page, const SurfaceSamples& all, std::int64_t now_ns) noexcept;
  void hide_vertices(Page& page) noexcept;
  [[nodiscard]] glm::vec4 at(const Page& page, const glm::vec3& position_m) const noexcept;
  /// What passes a place in that time is worth there, K.
  [[nodiscard]] float passing_k(float seconds) const noexcept;
  [[nodiscard]] float worth_k(const Page& page) const noexcept;

  ShadeResponse response_;
  glm::vec4 most_weight_k_{0.0F};
  float tolerance_k_ = 0.0F;
  std::int64_t start_ns_ = 0;
  std::int64_t next_turn_ = 0;   ///< at start_ns_ + next_turn_ * kTurnNs
  std::int64_t first_turn_ = 0;  ///< of the latest run()
  std::vector<Page> pages_;
  /// Of pages_, together: to be looked through often.
  struct Key {
    int level = kNoLevel;
    glm::ivec2 cell{0};
  };
  static constexpr int kNoLevel = 1000;
  std::array<Key, kPages> keys_;
  std::vector<Cast> casts_;
  std::bitset<kPages> cast_on_;             ///< by the entity that is being cast
  std::vector<Place> places_;               ///< by entity, then place
  std::vector<std::uint32_t> place_count_;  ///< by entity
  std::vector<TrajectoryState> at_start_;   ///< by entity
  glm::vec2 slope_{0.0F};
  std::vector<float> vertices_k_;
  ChangedRanges changes_;
  std::int64_t short_turn_ = 0;  ///< latest in which there were too few pages

  // Static vertices by square of the ground, and their heights.
  float highest_m_ = 0.0F;
  float lowest_m_ = 0.0F;
  glm::vec2 squares_m_{0.0F};
  float square_m_ = 1.0F;
  glm::ivec2 squares_{0};
  std::vector<std::uint32_t> first_of_square_;
  std::vector<std::uint32_t> of_square_;
};

}  // namespace emit::renderer
