// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "emit/scene/scene_desc.hpp"

namespace emit::renderer {

/// Heat that a part of a body puts into its skin at an instant, in addition to what arrives from
/// outside.
struct PartHeat {
  double power_w_m2 = 0.0;
  double contact_w_m2_k = 0.0;  ///< conductance between the skin and what is behind it; 0: none
  double behind_k = 0.0;        ///< temperature there
};

/// Heat of a part at both ends of an interval. Between them it changes linearly.
struct PartHeatSpan {
  PartHeat begin;
  PartHeat end;
};

/// Conductance that holds a skin at a commanded temperature: 10 W/m2 of film and radiation per K
/// leave it a ten-thousandth of the difference off.
inline constexpr double kHeldContactW_m2K = 1e5;

/// Drive of one part of an entity at any instant: that of the scenario, and from the first command
/// of a host on that of the host. A command holds until the next one. Owner: Renderer. Thread: the
/// renderer's. Real time: everything but the constructor is RT-safe.
class PartHistory {
 public:
  /// Largest number of commands of a host that are kept. Later ones replace the latest.
  static constexpr std::size_t kMaxCommands = 4096;

  /// Starts with the commands of the scenario. `entity` is the index of its entity, `material` that
  /// of its material.
  PartHistory(const scene::PartDesc& part, std::size_t entity, std::uint32_t material);

  /// Adds a command. Returns false, and ignores it, if its time is before the newest one of the
  /// host. One that repeats the command in force changes nothing.
  bool append(std::int64_t sim_time_ns, const scene::PartCommand& command) noexcept;
  /// Forgets the commands of the host.
  void reset() noexcept;

  /// Returns the heat at an instant. A throttle moves the temperature behind the skin towards that
  /// of the throttle with the part's time constants (physics.md eq. 29); switched off, towards
  /// cold_k.
  [[nodiscard]] PartHeat at(std::int64_t sim_time_ns) const noexcept;

  /// Returns how far the part is driven at an instant, 0 (idle) to 1 (full), as the temperature
  /// behind the skin follows the throttle. Empty if no throttle drives it.
  [[nodiscard]] std::optional<double> throttle_frac(std::int64_t sim_time_ns) const noexcept;
  /// Returns the heat over an interval: the mean power, and the contact as it is just before either
  /// end. A contact that begins in the interval therefore grows over it.
  /// @pre begin_ns < end_ns
  [[nodiscard]] PartHeatSpan over(std::int64_t begin_ns, std::int64_t end_ns) const noexcept;
  /// Returns true if a command begins to act in the interval, or the temperature behind the skin is
  /// still more than kSettledK away from where it goes.
  [[nodiscard]] bool changes(std::int64_t begin_ns, std::int64_t end_ns) const noexcept;
  static constexpr double kSettledK = 0.05;
  /// Returns the instants of the commands that are kept, ascending.
  [[nodiscard]] std::span<const std::int64_t> events_ns() const noexcept { return events_ns_; }

  [[nodiscard]] std::uint32_t id() const noexcept { return id_; }
  [[nodiscard]] std::size_t entity() const noexcept { return entity_; }
  [[nodiscard]] std::uint32_t material() const noexcept { return material_; }
  /// Number of changes by the host.
  [[nodiscard]] std::uint64_t revision() const noexcept { return revision_; }

  /// Command and the temperature behind the skin when it begins.
  struct Step {
    std::int64_t from_ns = 0;
    scene::PartCommand command;
    double begin_k = 0.0;
  };
  /// Returns the commands that are kept, ascending, if the host has sent any; otherwise none.
  [[nodiscard]] std::span<const Step> live() const noexcept {
    return live_ ? std::span<const Step>(steps_) : std::span<const Step>();
  }

 private:
  /// Temperature towards which the one behind the skin goes in a step.
  [[nodiscard]] double target_k(const Step& step) const noexcept;
  /// Temperature behind the skin at an instant after the begin of a step.
  [[nodiscard]] double behind_k(const Step& step, std::int64_t at_ns) const noexcept;
  void push(std::int64_t from_ns, const scene::PartCommand& command) noexcept;
  /// Index of the first step that begins after an instant.
  [[nodiscard]] std::size_t first_after(std::int64_t at_ns) const noexcept;

  std::uint32_t id_ = 0;
  scene::PartCurve curve_;
  std::size_t entity_ = 0;
  std::uint32_t material_ = 0;
  std::vector<Step> scripted_;
  std::vector<Step> steps_;  ///< scripted ones up to the first command of the host, then the host's
  std::vector<std::int64_t> events_ns_;  ///< by step: its begin
  std::int64_t newest_live_ns_ = 0;
  bool live_ = false;
  std::uint64_t revision_ = 0;
};

}  // namespace emit::renderer
