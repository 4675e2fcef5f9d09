// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

/// Points of `emit probe --at`: what their texts mean, and where they are at an instant.
namespace emit::tool {

/// Point whose history is asked for.
struct ProbePoint {
  enum class Kind : std::uint8_t {
    place,  ///< the surface nearest to a place of the world, whatever is there
    part,   ///< the middle of the largest triangle of a part; moves with its object
    pixel,  ///< what a pixel of the sensor shows
  };
  std::string name;  ///< as it was asked for
  Kind kind = Kind::place;
  glm::dvec3 position_m{0.0};          ///< of a part: axes of its entity, or world axes
  std::optional<glm::dvec3> normal{};  ///< of a place: chooses the side
  std::string object{};                ///< of a place: the only object that counts; empty: any
  std::uint32_t mesh = 0;              ///< of a part
  std::uint32_t x_px = 0;
  std::uint32_t y_px = 0;
};

/// Surface that a point stands for at an instant. World axes.
struct ProbePlace {
  glm::dvec3 position_m{0.0};
  glm::dvec3 normal{0.0};  ///< to the side that is looked at
  std::uint32_t object = 0;
  double open_m = 0.0;  ///< free way along the normal; infinite: to the sky
};

/// Finder of the surfaces of points, by rays on the full meshes. Setup only. Thread: one.
class ProbeFinder {
 public:
  /// Errors: those of scene::load_scene() and reference::RayScene::create().
  [[nodiscard]] static physics::Result<ProbeFinder> create(const scene::ScenarioDesc& scenario);

  /// Reads x,y,z (m), OBJECT or OBJECT:PART, px:X,Y or the name of a CSV table of points as `emit
  /// solve --at` reads it. PART is the name of a part, a glTF material or a material of the object.
  /// Errors: invalid_argument, quoting the text and naming what there is; those of read_probes().
  [[nodiscard]] physics::Result<std::vector<ProbePoint>> read(const std::string& text) const;

  /// Finds the surface of a point. Empty: there is none within reach, the pixel shows sky, or the
  /// object is switched off. `sensor` is the pose of the sensor, which pixels need.
  [[nodiscard]] std::optional<ProbePlace> place(const ProbePoint& point, std::int64_t sim_time_ns,
                                                const physics::Pose& sensor) const;

  /// Returns a point that stays where a place is on its body, which may move. `sim_time_ns` is the
  /// instant of the place.
  [[nodiscard]] ProbePoint follow(const ProbePlace& place, std::int64_t sim_time_ns,
                                  std::string name) const;
  /// Returns the name of a material of the loaded scene.
  /// @pre index is that of a pixel's material
  [[nodiscard]] const std::string& material_name(std::size_t index) const {
    return geometry_.materials[index].name;
  }
  [[nodiscard]] const std::vector<scene::Material>& materials() const noexcept {
    return geometry_.materials;
  }

 private:
  ProbeFinder(const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
              reference::RayScene rays)
      : scenario_(&scenario), geometry_(std::move(geometry)), rays_(std::move(rays)) {}
  [[nodiscard]] physics::Result<ProbePoint> read_part(const std::string& text) const;
  [[nodiscard]] physics::Result<ProbePoint> read_pixel(const std::string& text) const;

  const scene::ScenarioDesc* scenario_;
  scene::SceneGeometry geometry_;
  reference::RayScene rays_;
};

/// Direction through the middle of a pixel of the sensor, body axes, unit length.
[[nodiscard]] glm::dvec3 pixel_direction_body(const scene::SensorDesc& sensor, std::uint32_t x_px,
                                              std::uint32_t y_px) noexcept;

}  // namespace emit::tool
