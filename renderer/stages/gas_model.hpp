// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/air_view.hpp"
#include "emit/physics/gas/jet.hpp"
#include "emit/physics/gas/spectrum.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"
#include "shared/frame_params.glsl.h"
#include "shared/gas_params.glsl.h"
#include "stages/band_model.hpp"
#include "stages/thermal_stage.hpp"

namespace emit::renderer {

/// Hot gas, flares and smoke of a scenario as puffs for the picture of one instant (physics.md
/// section 13).
/// Owner: Renderer. Thread: the renderer's. Real time: build() is setup only, the rest is RT-safe.
class GasModel {
 public:
  /// Prepares spectra and air of all gas. Errors: config (more puffs than EMIT_MAX_GAS_PUFFS, a
  /// band or an atmosphere that is not valid).
  /// @pre Objects and parts that gas names exist.
  [[nodiscard]] static physics::Result<GasModel> build(const scene::ScenarioDesc& scenario);

  /// Camera and instant of a frame.
  struct View {
    std::int64_t sim_time_ns = 0;
    glm::dvec3 camera_world_m{0.0};
    glm::dmat3 world_from_sensor{1.0};
    double sensor_height_m = 0.0;  ///< above sea level
  };
  /// Makes the puffs of a frame, the nearest first. `frame` has the output image, and `bands` are
  /// at the instant.
  void update(const View& view, const physics::Forcing& forcing, const SceneHistory& history,
              const BandModel& bands, const gpu::FrameParams& frame) noexcept;
  [[nodiscard]] std::span<const gpu::GasPuff> puffs() const noexcept {
    return std::span(puffs_).first(count_);
  }
  /// Shares of the spectral terms, by band.
  [[nodiscard]] std::span<const glm::vec4, EMIT_MAX_BANDS> term_frac() const noexcept {
    return term_frac_;
  }

  /// Gas along a line of sight, by band.
  struct Seen {
    std::array<double, EMIT_MAX_BANDS> through_frac{};
    std::array<double, EMIT_MAX_BANDS> added_w_m2_sr{};
  };
  /// Returns the gas that a pixel of the output image shows in front of a surface at a boresight
  /// distance. Twin of passes/gas.comp in float32, for one pixel. `samples` is the number along the
  /// pixel's side; 0: no gas reaches the pixel. Not for frames.
  [[nodiscard]] Seen seen(const gpu::GasImage& image, const glm::uvec2& px, float boresight_m,
                          std::uint32_t samples) const noexcept;
  /// Largest error of the spectral terms of a band in the absorptance, as a share of it.
  [[nodiscard]] double spectrum_error_frac(std::size_t band) const noexcept {
    return spectra_[band].fit_error_frac();
  }

 private:
  /// A source with what its object is in the history.
  template <class Desc>
  struct Source {
    Desc desc;
    std::optional<std::size_t> entity;  ///< index of SceneHistory::entities
    physics::Pose placement;            ///< of an object that stands
  };
  using Light = std::array<double, EMIT_MAX_BANDS>;
  /// A puff before it is placed in the view.
  struct Puff {
    glm::dvec3 world_m{0.0};
    glm::dvec3 axis{0.0, 0.0, 1.0};
    double across_m = 0.0;
    double along_m = 0.0;
    /// Optical depth of the row of puffs that it belongs to, seen from the side, by its own.
    double in_row = 1.0;
    double kelvin = 300.0;  ///< for the air's transmittance
    bool flare = false;
    Light source_w_m2_sr{};  ///< before the air
    Light gas_per_m{};       ///< mean absorption of its gas at the middle
    Light grey_per_m{};      ///< extinction of its particles at the middle
  };
  /// Air in a spectrum that a gas shapes, by band with built-in air.
  struct GasAir {
    std::size_t band = 0;
    physics::AirView view;
    std::vector<physics::AirView::Node> nodes;
  };
  struct Plume {
    Source<scene::PlumeDesc> source;
    std::uint32_t part_id = 0;
    std::vector<GasAir> air;
  };
  /// A source at an instant.
  struct Stand {
    physics::Pose pose;
    glm::dvec3 velocity_m_s{0.0};
  };
  template <class Desc>
  [[nodiscard]] static std::optional<Stand> stand_of(const Source<Desc>& source,
                                                     const SceneHistory& history,
                                                     std::int64_t sim_time_ns) noexcept;

  physics::Result<void> build_spectra(const scene::ScenarioDesc& scenario);
  physics::Result<void> build_air(const scene::ScenarioDesc& scenario);
  void add_plume(Plume& plume, const View& view, const SceneHistory& history,
                 const BandModel& bands) noexcept;
  void add_flare(const Source<scene::FlareDesc>& flare, const View& view,
                 const SceneHistory& history, const BandModel& bands) noexcept;
  void add_smoke(const Source<scene::SmokeDesc>& smoke, const View& view,
                 const SceneHistory& history, const BandModel& bands) noexcept;
  void add_fire(const Source<scene::FireDesc>& fire, const View& view, const SceneHistory& history,
                const BandModel& bands) noexcept;
  /// Places a puff in the view, unless it lies out of it.
  void add(const Puff& puff, const View& view, const BandModel& bands,
           std::span<const GasAir> air) noexcept;

  std::vector<Plume> plumes_;
  std::vector<Source<scene::FlareDesc>> flares_;
  std::vector<Source<scene::SmokeDesc>> smokes_;
  std::vector<Source<scene::FireDesc>> fires_;
  std::vector<std::string> band_names_;
  std::vector<physics::GasBand> spectra_;  ///< by band
  std::array<glm::vec4, EMIT_MAX_BANDS> term_frac_{};
  double place_m_ = 0.0;
  std::int64_t start_ns_ = 0;  ///< of the history: what was on before it has been on since then
  physics::Forcing forcing_;
  glm::vec3 to_sun_{0.0F, 0.0F, 1.0F};  ///< relworld, at the instant of the frame
  glm::dvec2 px_per_tan_{1.0};
  glm::dvec2 px_at_axis_{0.0};
  std::array<gpu::GasPuff, EMIT_MAX_GAS_PUFFS> puffs_{};
  std::size_t count_ = 0;
};

}  // namespace emit::renderer
