// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "emit/config/campaign.hpp"
#include "emit/physics/error.hpp"
#include "tool/campaign/element_store.hpp"

namespace emit::tool {

/// Runs elements of a campaign in processes of their own, which write into the store.
class Executor {
 public:
  virtual ~Executor() = default;
  /// Runs elements and waits until all have ended, well or not. `ended` gets the number of those
  /// that have. Errors: io (a process cannot be started), internal (interrupted; what still runs
  /// is ended).
  [[nodiscard]] virtual physics::Result<void> run(
      std::span<const std::size_t> elements,
      const std::function<void(std::size_t ended)>& ended) = 0;
};

/// Returns the command line that runs one element of a campaign.
[[nodiscard]] physics::Result<std::vector<std::string>> element_command(
    const config::CampaignDesc& campaign, const ElementStore& store);

/// Makes an executor for local cores, with `jobs` elements at a time.
[[nodiscard]] std::unique_ptr<Executor> local_executor(const config::CampaignDesc& campaign,
                                                       const ElementStore& store,
                                                       std::uint32_t jobs);

/// Makes an executor for job arrays of Slurm. Errors: not_found (sbatch, squeue or scancel).
[[nodiscard]] physics::Result<std::unique_ptr<Executor>> slurm_executor(
    const config::CampaignDesc& campaign, const ElementStore& store);

}  // namespace emit::tool
