// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// Chooses which poses of a log the demo plays: the first, the last and some evenly in between.
class PosePlan {
 public:
  /// @param poses  number of poses in the log, > 0.
  /// @param count  poses to play; absent: kFirstGuess until limit_to() says how many.
  PosePlan(std::uint64_t poses, std::optional<std::uint64_t> count);

  static constexpr std::uint64_t kMinimum = 4;
  static constexpr std::uint64_t kFirstGuess = 200;

  /// Returns the index of the pose to play next; empty when the plan is done. Indices ascend.
  [[nodiscard]] std::optional<std::uint64_t> next();
  /// Plans `left` more poses, at least as many as make kMinimum. It has no effect on a plan of
  /// fixed count. The first call sets the number; later ones only lower it, so that the spacing
  /// stays even.
  void limit_to(std::uint64_t left);

  [[nodiscard]] std::uint64_t played() const noexcept { return played_; }
  [[nodiscard]] std::uint64_t left() const noexcept { return left_; }

 private:
  std::uint64_t poses_;
  bool fixed_;
  bool limited_ = false;  ///< limit_to() was called
  std::uint64_t played_ = 0;
  std::uint64_t left_ = 0;
  std::uint64_t current_ = 0;
};

/// An entity that stood at one place for a while and then drove away.
struct Departure {
  std::string object;
  std::int64_t arrived_ns = 0;
  std::int64_t left_ns = 0;
};
/// Returns the last stay of at least `min_stay_s` of every entity that leaves again.
[[nodiscard]] std::vector<Departure> find_departures(const scene::ScenarioDesc& scenario,
                                                     double min_stay_s);

}  // namespace emit::tool
