// SPDX-License-Identifier: Apache-2.0
// Heat along the surface of bodies near their edges: the cells of columns, and what they do.
#include "surface/columns/surface_columns.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "history/foster_setup.hpp"
#include "renderer/surface/surface_scene.hpp"
#include "support/times.hpp"
#include "surface/model/vertex_areas.hpp"
#include "surface/run/cached_surface.hpp"
#include "surface/warm_up/surface_exchange.hpp"

namespace emit::renderer {
namespace {

using emit::test::kSecondNs;
using physics::kReferenceK;

/// Body of cubes: every face of a cube that no other cube touches is a square of its own.
scene::Mesh cubes(const std::function<bool(int, int, int)>& filled, float size_m) {
  constexpr int kMost = 3;
  scene::Mesh mesh;
  for (int x = 0; x < kMost; ++x) {
    for (int y = 0; y < kMost; ++y) {
      for (int z = 0; z < kMost; ++z) {
        if (!filled(x, y, z)) continue;
        for (int axis = 0; axis < 3; ++axis) {
          for (const int side : {-1, 1}) {
            std::array<int, 3> next{x, y, z};
            next[static_cast<std::size_t>(axis)] += side;
            const bool inside =
                std::ranges::all_of(next, [](int v) { return v >= 0 && v < kMost; });
            if (inside && filled(next[0], next[1], next[2])) continue;
            // Corners go round so that the normal points outwards.
            glm::vec3 u(0.0F);
            glm::vec3 v(0.0F);
            u[(axis + 1) % 3] = size_m;
            v[(axis + 2) % 3] = size_m;
            if (side < 0) std::swap(u, v);
            glm::vec3 low = size_m * glm::vec3(x, y, z);
            if (side > 0) low[axis] += size_m;
            test::add_quad(mesh, {low, low + u, low + u + v, low + v});
          }
        }
      }
    }
  }
  mesh.closed = true;
  return mesh;
}
scene::Mesh box(float size_m) {
  return cubes([](int, int, int) { return true; }, size_m / 3.0F);
}
/// Slab of the given edge and thickness.
scene::Mesh slab(float edge_m, float thickness_m) {
  scene::Mesh mesh = cubes([](int x, int y, int z) { return x + y + z == 0; }, 1.0F);
  const glm::vec3 size_m(edge_m, edge_m, thickness_m);
  for (glm::vec3& position_m : mesh.positions_m) position_m *= size_m;
  mesh.bounds = {glm::dvec3(0.0), glm::dvec3(size_m)};
  return mesh;
}
/// L with arms of one cube.
scene::Mesh ell(float size_m) {
  return cubes([](int x, int y, int) { return x == 0 || y == 0; }, size_m / 3.0F);
}
/// Slab with a rib along its middle.
scene::Mesh rib(float size_m) {
  return cubes([](int x, int, int z) { return z == 0 || (z == 1 && x == 1); }, size_m / 3.0F);
}

/// A body high in the air, in the sun of a June morning.
class Body {
 public:
  Body(scene::Mesh mesh, std::vector<scene::Layer> layers, bool lateral) {
    scenario_.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
    scenario_.epoch_utc_ns = 1'403'330'400 * kSecondNs;  // 2014-06-21 06:00 UTC
    scenario_.thermal.model = scene::ThermalModel::foster;
    scenario_.thermal.method = scene::ThermalMethod::cached;
    scenario_.thermal.steps = 48;
    scenario_.thermal.spacing = scene::StepSpacing::geometric;
    scenario_.thermal.history_start_ns = -24 * 3600 * kSecondNs;
    scenario_.thermal.lateral = lateral;
    scenario_.thermal.exchange = false;
    scene::WeatherSample weather;
    weather.direct_normal_w_m2 = 800.0;
    weather.diffuse_horizontal_w_m2 = 100.0;
    weather.longwave_down_w_m2 = 330.0;
    weather.air_k = 293.15;
    weather.environment_k = 293.15;
    weather.film_w_m2_k = 13.0;
    scenario_.weather = {weather};
    scene::Material material;
    material.name = "stack";
    material.emissivity_frac = 0.9;
    material.solar_absorptance_frac = 0.7;
    material.layers = std::move(layers);
    material.base_k = 293.15;
    scenario_.materials = {material};
    scenario_.default_material = "stack";
    scene_.add_static(std::move(mesh), glm::dvec3(0.0, 0.0, 50.0));
    scene_.geometry.materials = scenario_.materials;
    scenario_.objects.resize(1);
  }

  /// Replaces the weather and the radiation of the body: there is none.
  void hang_in_air(std::vector<scene::WeatherSample> weather, double base_k) {
    scenario_.weather = std::move(weather);
    for (scene::Material& material : scenario_.materials) {
      material.emissivity_frac = 1e-9;
      material.solar_absorptance_frac = 0.0;
      material.base_k = base_k;
      material.initial_k = base_k;
    }
    scene_.geometry.materials = scenario_.materials;
  }
  /// Puts the body on ground of its own stack, 8 m wide. Call it before hang_in_air().
  void put_on_ground(std::vector<scene::Layer> layers) {
    scene::Material ground = scenario_.materials[0];
    ground.name = "ground";
    ground.layers = std::move(layers);
    scenario_.materials.push_back(ground);
    scene::Mesh plane = test::level_mesh(glm::vec3(-4.0F), glm::vec3(4.0F), 0.0F);
    plane.submeshes[0].material = 1;
    scene_.add_static(std::move(plane), glm::dvec3(0.0, 0.0, 50.0));
    scene_.geometry.materials = scenario_.materials;
    scenario_.objects.resize(2);
    scenario_.objects[0].name = "body";
    scenario_.objects[1].name = "plane";
  }
  void join(double resistance_m2k_w) {
    scenario_.contacts = {{{"ground", "body"}, resistance_m2k_w}};
  }
  void step(std::uint32_t steps) { scenario_.thermal.steps = steps; }
  void look_closely(double pixel_rad) { pixel_rad_ = pixel_rad; }

  void warm_up() {
    environment_.emplace(scenario_);
    auto networks = build_foster_materials(scenario_, scene_.geometry.materials);
    ASSERT_TRUE(networks.has_value()) << networks.error().text;
    auto surface = CachedSurface::create(
        scenario_, scene_.geometry, std::vector<std::int32_t>(scenario_.objects.size(), -1),
        std::span(*networks).first(networks->size() - 1), kReferenceK);
    ASSERT_TRUE(surface.has_value()) << surface.error().text;
    surface_ = std::move(*surface);
    history_.emplace(scenario_.thermal.steps,
                     make_foster(scenario_, std::move(*networks), *environment_, kReferenceK));
    StepPlan plan(scenario_.thermal);
    const RefineView view{{{{0.0, -4.0, 52.0}, {}}}, pixel_rad_};
    ASSERT_TRUE(surface_->prepare(3 * 3600 * kSecondNs, view, {*environment_, {}}, plan, *history_,
                                  std::nullopt, {}));
  }
  void advance(std::int64_t now_ns) { surface_->advance(now_ns, {*environment_, {}}, *history_); }
  [[nodiscard]] const SurfaceModel& model() const { return surface_->model(); }
  [[nodiscard]] const scene::Instance& instance(std::size_t index = 0) const {
    return scene_.geometry.instances[index];
  }
  [[nodiscard]] const std::vector<scene::Layer>& layers() const {
    return scenario_.materials[0].layers;
  }
  /// Corner of the body at its origin, in the axes of the samples.
  [[nodiscard]] glm::dvec3 origin_m() const {
    glm::dvec3 low(1e9);
    for (const SurfaceSample& sample : model().samples.samples) {
      low = glm::min(low, glm::dvec3(sample.position_m));
    }
    return low;
  }
  [[nodiscard]] std::size_t samples() const { return model().drawn_samples; }
  [[nodiscard]] double temperature_k(std::size_t sample, std::size_t node = 0) const {
    return kReferenceK + static_cast<double>(surface_->vertices(node)[sample].offset_k);
  }

 private:
  scene::ScenarioDesc scenario_;
  double pixel_rad_ = 2e-2;
  test::SurfaceScene scene_;
  std::optional<Environment> environment_;
  std::optional<SurfaceHistory> history_;
  std::unique_ptr<CachedSurface> surface_;
};

std::vector<scene::Layer> concrete(double thickness_m) {
  return {{thickness_m, 1.28, 2300.0, 878.0}};
}

TEST(SurfaceColumns, ShareTheMaterialBelowTheSurfaceWithoutGapOrOverlap) {
  // Bodies whose stack is thinner than half of every arm: what lies within the stack is known.
  constexpr double kDepthM = 0.2;
  struct Case {
    scene::Mesh mesh;
    double held_m3;
  };
  const std::vector<Case> cases{
      {box(1.5F), std::pow(1.5, 3.0) - std::pow(1.1, 3.0)},
      // Arms of 0.5 m, 1.5 m long and 1.5 m high.
      {ell(1.5F), (1.5 * 1.5 - 1.0) * 1.5 - (1.1 * 1.1 - 1.0) * 1.1},
  };
  for (const Case& each : cases) {
    Body body(each.mesh, concrete(kDepthM), true);
    ASSERT_NO_FATAL_FAILURE(body.warm_up());
    const SurfaceModel& model = body.model();
    const physics::ColumnCells cells =
        physics::column_cells(std::vector<physics::StackLayer>{{kDepthM, 1.28, 2300.0 * 878.0}});
    const auto area_m2 = vertex_areas_m2(model.meshes[0], body.instance());
    double held_m3 = 0.0;
    for (std::uint32_t s = 0; s < model.drawn_samples; ++s) {
      const std::uint32_t column = model.samples.samples[s].column;
      for (std::size_t l = 0; l < cells.count; ++l) {
        // A sample in the middle of a face has the whole stack for itself.
        double own_m2 = area_m2[s];
        if (column != kNoSample) {
          own_m2 =
              model.samples.columns[column].area_m2 * model.samples.columns[column].share_frac[l];
        }
        held_m3 += own_m2 * cells.thickness_m(l);
      }
    }
    EXPECT_NEAR(held_m3, each.held_m3, 0.03 * each.held_m3);
  }
}

TEST(SurfaceColumns, ConductAlikeInBothDirectionsAndNeverBackwards) {
  for (const scene::Mesh& mesh : {box(0.6F), ell(0.6F), rib(0.6F)}) {
    Body body(mesh, {{0.002, 50.0, 7800.0, 470.0}, {0.05, 0.04, 30.0, 900.0}}, true);
    ASSERT_NO_FATAL_FAILURE(body.warm_up());
    const SurfaceModel& model = body.model();
    std::map<std::tuple<std::uint32_t, std::size_t, std::uint32_t, std::uint32_t>, double> found;
    const auto& columns = model.samples.columns;
    for (std::uint32_t c = 0; c < columns.size(); ++c) {
      for (std::size_t l = 0; l < physics::kMaxColumnCells; ++l) {
        for (std::uint32_t k = columns[c].first_link[l]; k < columns[c].first_link[l + 1]; ++k) {
          const CellLink& link = model.samples.links[k];
          EXPECT_GT(link.conductance_w_m2_k, 0.0F);
          found[{c, l, link.column, link.cell}] =
              static_cast<double>(link.conductance_w_m2_k * columns[c].area_m2);
        }
      }
    }
    ASSERT_GT(found.size(), 1000U);
    for (const auto& [key, conductance_w_k] : found) {
      const auto& [c, l, other, m] = key;
      const auto back = found.find({other, m, c, static_cast<std::uint32_t>(l)});
      ASSERT_NE(back, found.end());
      EXPECT_NEAR(back->second, conductance_w_k, 1e-4 * conductance_w_k);
    }
  }
}

/// Heat that flows in the columns of a body from its upper faces, held at 1 K, to its lower ones at
/// 0 K: the steady state of their network. Nothing enters by the sides or from the base.
struct Through {
  double all_w = 0.0;
  double middle_w_m2 = 0.0;  ///< in the columns of the upper face far from its edges, on average
};
Through heat_through(const SurfaceModel& model, const physics::ColumnCells& cells,
                     const glm::dvec3& middle_m, double around_m) {
  const auto& columns = model.samples.columns;
  const std::size_t count = columns.size() * cells.count;
  std::vector<double> kelvin(count, 0.5);
  Through out;
  constexpr int kSweeps = 4000;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    out.all_w = 0.0;
    double middle_w = 0.0;
    double middle_m2 = 0.0;
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const float up = model.samples.samples[columns[c].sample].normal.z;
      for (std::size_t l = 0; l < cells.count; ++l) {
        double sum_w_m2_k = 0.0;
        double into_w_m2 = 0.0;
        const auto link = [&](double w_m2_k, double other_k) {
          sum_w_m2_k += w_m2_k;
          into_w_m2 += w_m2_k * other_k;
        };
        const std::size_t own = c * cells.count + l;
        if (l == 0 && std::abs(up) > 0.9F) link(cells.surface_w_m2_k(), up > 0.0F ? 1.0 : 0.0);
        if (l > 0) link(static_cast<double>(columns[c].below_w_m2_k[l - 1]), kelvin[own - 1]);
        if (l + 1 < cells.count) {
          link(static_cast<double>(columns[c].below_w_m2_k[l]), kelvin[own + 1]);
        }
        for (std::uint32_t k = columns[c].first_link[l]; k < columns[c].first_link[l + 1]; ++k) {
          const CellLink& beside = model.samples.links[k];
          link(static_cast<double>(beside.conductance_w_m2_k),
               kelvin[beside.column * cells.count + beside.cell]);
        }
        kelvin[own] = into_w_m2 / sum_w_m2_k;
        if (l == 0 && up > 0.9F) {
          const auto area_m2 = static_cast<double>(columns[c].area_m2);
          const double heat_w = area_m2 * cells.surface_w_m2_k() * (1.0 - kelvin[own]);
          out.all_w += heat_w;
          const glm::dvec3 at_m(model.samples.samples[columns[c].sample].position_m);
          if (std::max(std::abs(at_m.x - middle_m.x), std::abs(at_m.y - middle_m.y)) < around_m) {
            middle_w += heat_w;
            middle_m2 += area_m2;
          }
        }
      }
    }
    out.middle_w_m2 = middle_w / middle_m2;
  }
  return out;
}

TEST(SurfaceColumns, OppositeFacesOfAThinSolidConductAsASlab) {
  // The stack reaches the middle of the plate with its last cell, within a cell, or far beyond it.
  for (const double stack_m : {0.1, 0.13, 0.3}) {
    SCOPED_TRACE(stack_m);
    Body body(slab(1.5F, 0.2F), concrete(stack_m), true);
    ASSERT_NO_FATAL_FAILURE(body.warm_up());
    const physics::ColumnCells cells =
        physics::column_cells(std::vector<physics::StackLayer>{{stack_m, 1.28, 2300.0 * 878.0}});
    const double slab_w = 1.28 * 1.5 * 1.5 / 0.2;
    const Through through =
        heat_through(body.model(), cells, body.origin_m() + glm::dvec3(0.75, 0.75, 0.0), 0.4);
    RecordProperty("all", std::to_string(through.all_w / slab_w));
    RecordProperty("middle", std::to_string(through.middle_w_m2 / (1.28 / 0.2)));
    EXPECT_NEAR(through.middle_w_m2, 1.28 / 0.2, 0.01 * 1.28 / 0.2);
    // Within half of its thickness from an edge heat goes round through columns of the sides.
    EXPECT_NEAR(through.all_w, slab_w, 0.1 * slab_w);
    // No column of a wide face reaches the base, which is not in the slab.
    for (const SampleColumn& column : body.model().samples.columns) {
      if (std::abs(body.model().samples.samples[column.sample].normal.z) < 0.9F) continue;
      EXPECT_LT(column.below_w_m2_k[cells.count - 1], 0.01F * 1.28F / 0.1F);
    }
  }
  // A stack that ends before the middle stands on its core.
  Body thick(slab(1.5F, 0.2F), concrete(0.08), true);
  ASSERT_NO_FATAL_FAILURE(thick.warm_up());
  EXPECT_LT(heat_through(thick.model(),
                         physics::column_cells(
                             std::vector<physics::StackLayer>{{0.08, 1.28, 2300.0 * 878.0}}),
                         thick.origin_m(), 1.0)
                .all_w,
            3.0);  // by the sides alone
}

/// Conductance between the body and the ground that it stands on, W/K, from either side.
std::array<double, 2> into_ground_w_k(double resistance_m2k_w) {
  Body body(box(0.6F), {{0.1, 1.28, 2300.0, 878.0}}, true);
  body.put_on_ground({{0.15, 0.7, 2120.0, 920.0}, {0.5, 1.5, 2000.0, 950.0}});
  if (resistance_m2k_w > 0.0) body.join(resistance_m2k_w);
  body.warm_up();
  const SurfaceModel& model = body.model();
  std::array<double, 2> out{};
  const auto on_ground = [&](std::uint32_t column) {
    return model.samples.columns[column].sample >= model.first_sample[1] ? 1U : 0U;
  };
  for (std::uint32_t c = 0; c < model.samples.columns.size(); ++c) {
    const SampleColumn& own = model.samples.columns[c];
    for (std::uint32_t k = own.first_link.front(); k < own.first_link.back(); ++k) {
      const CellLink& link = model.samples.links[k];
      if (on_ground(link.column) == on_ground(c)) continue;
      out[on_ground(c)] += static_cast<double>(link.conductance_w_m2_k * own.area_m2);
    }
  }
  return out;
}

TEST(SurfaceColumns, WallsConductIntoTheGroundAtTheirFeetAlikeInBothDirections) {
  const auto [down, up] = into_ground_w_k(0.0);
  // The walls of 10 cm cover 0.2 m2 or more of the ground, from some centimetres away.
  EXPECT_GT(down, 2.0);
  EXPECT_NEAR(up, down, 1e-3 * down);
  // A joint lies in series, over the area that the feet cover.
  const auto [parted, back] = into_ground_w_k(1.0);
  EXPECT_GT(parted, 0.15);
  EXPECT_LT(parted, 0.3);
  EXPECT_NEAR(back, parted, 1e-3 * parted);
}

TEST(SurfaceColumns, GroundAtTheFootOfASolidIsThatOfAHalfSpaceWithHalfOfItsFaceCovered) {
  constexpr double kFilm = 0.1;
  constexpr double kFromK = 280.0;
  constexpr double kToK = 5280.0;
  constexpr double kSizeM = 0.6;
  constexpr double kSeconds = 3.0 * 3600.0;
  constexpr double kConductivity = 1.28;
  constexpr double kDiffusivity = kConductivity / (2300.0 * 878.0);
  // The body keeps its heat to itself. The air gives the open ground nearly the same flux however
  // warm it gets.
  Body body(box(static_cast<float>(kSizeM)), {{0.2, 1e-4, 20.0, 500.0}}, true);
  body.put_on_ground({{1.0, kConductivity, 2300.0, 878.0}});
  std::vector<scene::WeatherSample> weather(4);
  for (scene::WeatherSample& sample : weather) {
    sample.film_w_m2_k = kFilm;
    sample.air_k = kFromK;
  }
  weather[0].sim_time_ns = -1'000'000 * kSecondNs;
  weather[2].sim_time_ns = kSecondNs;
  weather[3].sim_time_ns = 1'000'000 * kSecondNs;
  weather[2].air_k = weather[3].air_k = kToK;
  body.hang_in_air(weather, kFromK);
  body.step(200);
  body.look_closely(3e-3);
  ASSERT_NO_FATAL_FAILURE(body.warm_up());
  // Each instant s ago has left q / (rho c) / sqrt(pi a s) times the open share of a spread of
  // sqrt(2 a s).
  const auto rise_k = [](double beside_m) {
    double sum = 0.0;
    constexpr int kParts = 2000;
    for (int i = 0; i < kParts; ++i) {
      const double root = (i + 0.5) / kParts * std::sqrt(kDiffusivity * kSeconds);
      sum += 2.0 / kParts * std::sqrt(kDiffusivity * kSeconds / physics::kPi) * 0.5 *
             std::erfc(-0.5 * beside_m / root);
    }
    return kFilm * (kToK - kFromK) / kConductivity * sum;
  };
  double squares = 0.0;
  double most_k = 0.0;
  std::size_t seen = 0;
  const SurfaceModel& model = body.model();
  for (std::size_t s = model.first_sample[1]; s < body.samples(); ++s) {
    const SurfaceSample& sample = model.samples.samples[s];
    if (sample.covered) continue;
    const glm::dvec3 at_m = glm::dvec3(sample.position_m) - body.origin_m();
    const glm::dvec3 in_body_m = at_m - glm::dvec3(4.0, 4.0, 0.0);  // the ground reaches farther
    const double beside_m = -in_body_m.y;
    if (in_body_m.x < 0.2 || in_body_m.x > 0.4 || beside_m < 0.0 || beside_m > 0.3) continue;
    const double off_k = body.temperature_k(s) - kFromK - rise_k(beside_m);
    ++seen;
    squares += off_k * off_k;
    most_k = std::max(most_k, std::abs(off_k));
  }
  ASSERT_GT(seen, 50U);
  RecordProperty("rms_k", std::to_string(std::sqrt(squares / static_cast<double>(seen))));
  RecordProperty("most_k", std::to_string(most_k));
  // Far from the foot the ground has warmed by 36 K, at the foot by half of that.
  EXPECT_NEAR(rise_k(0.0), 0.5 * rise_k(1.0), 1e-6);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(seen)), 0.3);
  EXPECT_LT(most_k, 1.0);
}

/// Share of the step of the air's temperature that a half space has not followed at a depth, with a
/// film h (Carslaw and Jaeger, Conduction of Heat in Solids, 2.7): the product of these shares over
/// the directions solves the problem for an edge or a corner.
double still_frac(double depth_m, double t_s, double conductivity_w_m_k, double diffusivity_m2_s,
                  double film_w_m2_k) {
  const double spread_m = std::sqrt(diffusivity_m2_s * t_s);
  const double h = film_w_m2_k / conductivity_w_m_k;
  return std::erf(0.5 * depth_m / spread_m) +
         std::exp(h * depth_m + h * h * spread_m * spread_m) *
             std::erfc(0.5 * depth_m / spread_m + h * spread_m);
}

TEST(SurfaceColumns, EdgesAndCornersFollowTheAirAsTheClosedFormSays) {
  constexpr double kFilm = 20.0;
  constexpr double kFromK = 280.0;
  constexpr double kToK = 320.0;
  constexpr double kSizeM = 0.6;
  constexpr double kSeconds = 3.0 * 3600.0;
  Body body(box(static_cast<float>(kSizeM)), concrete(0.3), true);
  std::vector<scene::WeatherSample> weather(4);
  for (scene::WeatherSample& sample : weather) {
    sample.film_w_m2_k = kFilm;
    sample.air_k = kFromK;
  }
  weather[0].sim_time_ns = -1'000'000 * kSecondNs;
  weather[2].sim_time_ns = kSecondNs;
  weather[3].sim_time_ns = 1'000'000 * kSecondNs;
  weather[2].air_k = weather[3].air_k = kToK;
  body.hang_in_air(weather, kFromK);
  body.step(300);
  body.look_closely(3e-3);
  ASSERT_NO_FATAL_FAILURE(body.warm_up());
  const double diffusivity_m2_s = 1.28 / (2300.0 * 878.0);
  double squares = 0.0;
  double most_k = 0.0;
  std::size_t seen = 0;
  for (std::size_t s = 0; s < body.samples(); ++s) {
    const glm::dvec3 at_m =
        glm::dvec3(body.model().samples.samples[s].position_m) - body.origin_m();
    // Judge the two faces that the camera sees: only they have fine triangles.
    if (at_m.y > 0.01 && at_m.z < kSizeM - 0.01) continue;
    double share = 1.0;
    for (int i = 0; i < 3; ++i) {
      const auto one_sided = [&](double depth_m) {
        return still_frac(std::max(depth_m, 0.0), kSeconds, 1.28, diffusivity_m2_s, kFilm);
      };
      share *= one_sided(at_m[i]) + one_sided(kSizeM - at_m[i]) - 1.0;
    }
    const double off_k = body.temperature_k(s) - (kToK - (kToK - kFromK) * share);
    ++seen;
    squares += off_k * off_k;
    most_k = std::max(most_k, std::abs(off_k));
  }
  ASSERT_GT(seen, 1000U);
  RecordProperty("rms_k", std::to_string(std::sqrt(squares / static_cast<double>(seen))));
  RecordProperty("most_k", std::to_string(most_k));
  // Edges are 9 K warmer than the middle of a face, and corners 12 K.
  EXPECT_LT(std::sqrt(squares / static_cast<double>(seen)), 0.35);
  EXPECT_LT(most_k, 1.0);
}

/// Coldest and warmest temperature that a surface can take in the weather of Body if it stores
/// nothing and conducts nothing.
std::pair<double, double> range_k() {
  const auto balance_k = [](double absorbed_w_m2) {
    double low = 200.0;
    double high = 400.0;
    for (int i = 0; i < 60; ++i) {
      const double t = 0.5 * (low + high);
      const double lost =
          0.9 * physics::kStefanBoltzmannWPerM2K4 * std::pow(t, 4.0) + 13.0 * (t - 293.15);
      (lost < absorbed_w_m2 ? low : high) = t;
    }
    return low;
  };
  const double air = 0.9 * physics::kStefanBoltzmannWPerM2K4 * std::pow(293.15, 4.0);
  // The sun stands on a face at most, with all of the sky and as much light from the ground.
  return {balance_k(std::min(0.9 * 330.0, air)), balance_k(0.7 * (800.0 + 300.0) + air)};
}

/// Raises `worst_k` to the greatest distance of a sample outside of that range.
void expect_within_range(Body& body, double& worst_k) {
  const auto [low_k, high_k] = range_k();
  ASSERT_NO_FATAL_FAILURE(body.warm_up());
  for (int i = 1; i <= 60; ++i) body.advance((3 * 3600 + 10 * i) * kSecondNs);
  double past_k = 0.0;
  for (std::size_t s = 0; s < body.samples(); ++s) {
    const double now_k = body.temperature_k(s);
    ASSERT_FALSE(std::isnan(now_k));
    past_k = std::max({past_k, low_k - now_k, now_k - high_k});
  }
  EXPECT_LT(past_k, 0.05);
  worst_k = std::max(worst_k, past_k);
}
/// Returns how many stacks a test tries: EMIT_TEST_STACKS, or 30.
int stacks() {
  constexpr int kStacks = 30;
  const char* asked = std::getenv("EMIT_TEST_STACKS");
  return asked == nullptr ? kStacks : std::atoi(asked);
}

TEST(SurfaceColumns, KeepBodiesOfTheLibraryAtTheirFeetWithinWhatTheirSurroundingsAllow) {
  const std::vector<scene::Layer> sandwich{{0.0005, 50.0, 7850.0, 470.0},
                                           {0.1, 0.03, 30.0, 1400.0}};
  const std::vector<scene::Layer> road{{0.15, 0.7, 2120.0, 920.0}, {0.3, 1.5, 2000.0, 950.0}};
  const std::vector<scene::Layer> wood{{0.02, 0.15, 550.0, 1700.0}};
  for (const auto& body_layers : {sandwich, concrete(0.1), wood}) {
    for (const auto& ground_layers : {road, sandwich}) {
      SCOPED_TRACE(testing::Message() << body_layers[0].thickness_m << " m on "
                                      << ground_layers[0].thickness_m << " m");
      Body body(box(1.5F), body_layers, true);
      body.put_on_ground(ground_layers);
      double worst_k = 0.0;
      expect_within_range(body, worst_k);
    }
  }
}

TEST(SurfaceColumns, KeepAnyStackWithinWhatItsSurroundingsAllow) {
  std::mt19937_64 random(7);
  const auto between = [&random](double low, double high) {
    return low * std::pow(high / low, std::uniform_real_distribution<>(0.0, 1.0)(random));
  };
  const std::array<scene::Mesh, 3> shapes{box(1.5F), ell(1.5F), rib(1.5F)};
  const auto any_stack = [&] {
    std::vector<scene::Layer> layers(std::uniform_int_distribution<std::size_t>(1, 4)(random));
    for (scene::Layer& layer : layers) {
      layer = {between(2e-4, 0.5), between(0.02, 400.0), between(20.0, 8000.0), 900.0};
    }
    return layers;
  };
  double worst_k = 0.0;
  const int count = stacks();
  ASSERT_GT(count, 0) << "EMIT_TEST_STACKS";
  for (int n = 0; n < count; ++n) {
    Body body(shapes[static_cast<std::size_t>(n) % shapes.size()], any_stack(), true);
    // Every second one stands on ground.
    if (n % 2 == 1) body.put_on_ground(any_stack());
    SCOPED_TRACE(n);
    expect_within_range(body, worst_k);
  }
  RecordProperty("stacks", count);
  RecordProperty("worst_k", std::to_string(worst_k));
}

}  // namespace
}  // namespace emit::renderer
