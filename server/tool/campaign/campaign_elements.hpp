// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "emit/config/campaign.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// One run of a campaign.
struct CampaignElement {
  std::size_t number = 0;  ///< from 0
  double time_s = 0.0;
  /// Varied keys with their values as TOML text, in the order of the file; without the time.
  std::vector<std::pair<std::string, std::string>> conditions;

  /// Overrides of the scenario: those of the campaign, then the conditions.
  [[nodiscard]] std::vector<std::string> overrides(const config::CampaignDesc& campaign) const;
};

/// Largest number of elements of a campaign.
inline constexpr std::size_t kMaxElements = 1'000'000;

/// Returns all runs of a campaign: every point of the Latin hypercube with every combination of
/// the grid; the last axis changes fastest. Times of the day are those of `epoch_utc_ns`. The
/// result depends on nothing but the arguments. Errors: invalid_argument (a time; too many
/// elements).
[[nodiscard]] physics::Result<std::vector<CampaignElement>> campaign_elements(
    const config::CampaignDesc& campaign, std::int64_t epoch_utc_ns);

/// Returns points of a Latin hypercube in [0, 1): each dimension has one value in every one of
/// `samples` strata. The points depend on the seed alone, on every machine.
[[nodiscard]] std::vector<std::vector<double>> latin_hypercube(std::size_t samples,
                                                               std::size_t dimensions,
                                                               std::uint64_t seed);

}  // namespace emit::tool
