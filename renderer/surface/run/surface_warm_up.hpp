// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "history/step_plan.hpp"
#include "history/surface_history.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/interval_rays.hpp"
#include "surface/run/surface_geometry.hpp"
#include "surface/run/world_inputs.hpp"
#include "surface/state/state_file.hpp"

namespace emit::renderer {

/// The state file (thermal.state_file), and the requirements on the state in it.
struct SavedSurface {
  std::filesystem::path file;
  StateKey key{};  ///< hashes of the scenario, from scenario_key()
  /// The flag is true at the start of a run: a file that does not fit is an error, and a missing
  /// file is written. It is false after a jump of sim time: the file is used only if it holds the
  /// very instant, and is left as it is.
  bool start = true;
  /// Returns true if a surface that was refined for `eyes` will do for the first frame.
  std::function<bool(std::span<const RefineView::Eye> eyes)> fits_camera = {};
};

/// Makes the model of a cached surface for one instant, or takes it from the state file. Setup
/// only: seconds, on all cores. Everything it refers to must outlive it.
class SurfaceWarmUp {
 public:
  /// Input of the work.
  struct Inputs {
    const SurfaceGeometry& geometry;
    const SampleHeat& heat;
    const IntervalRays& rays;   ///< prototype for the rays of each interval
    std::int64_t start_ns = 0;  ///< instant of the model
    /// Earliest instant of a saved model that will do in place of `start_ns`.
    std::int64_t earliest_ns = 0;
    const RefineView& view;
    WorldInputs world;
    SurfaceModelOptions options;
    const SurfaceProgress& progress;
    StepPlan& plan;           ///< is brought to the instant of the model
    SurfaceHistory& history;  ///< is brought to the instant of the model
  };
  /// A model, and whether the state file is to be written from it.
  struct Made {
    SurfaceModel model;  ///< without levels of detail unless it comes from the file
    bool to_save = false;
  };

  explicit SurfaceWarmUp(const Inputs& inputs);

  /// Takes the model from the file if there is one and it fits, or else makes it. Errors: those of
  /// build_surface_model(), read_state() and check_state_writable(); config (the saved surface was
  /// refined for another camera).
  [[nodiscard]] physics::Result<Made> make(const std::optional<SavedSurface>& saved) const;
  /// Writes the file. Errors: those of write_state().
  [[nodiscard]] physics::Result<void> save(const SavedSurface& saved,
                                           const SurfaceModel& model) const;

 private:
  /// Samples the surface and integrates its history.
  [[nodiscard]] physics::Result<SurfaceModel> build() const;
  /// Returns the key of a state at an instant: the scenario's hashes and that of the host's input.
  [[nodiscard]] StateKey key_of(const SavedSurface& saved, std::int64_t at_ns) const;
  /// Returns the saved model. It is empty if it does not fit and this is no error.
  [[nodiscard]] physics::Result<std::optional<SurfaceModel>> take(const SavedSurface& saved) const;
  /// Places of each entity from the start on, by its script, rel.
  [[nodiscard]] std::vector<std::vector<glm::vec3>> ways_m() const;

  Inputs in_;
  std::vector<EntityPlacement> placements_;  ///< of the entities at the start
};

}  // namespace emit::renderer
