// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <string>

#include "emit/config/campaign.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/campaign/campaign_elements.hpp"
#include "tool/campaign/result_row.hpp"

namespace emit::tool {

/// Loads the scenario of an element. glTF files need not exist on this machine. Errors: config.
[[nodiscard]] physics::Result<scene::ScenarioDesc> element_scenario(
    const config::CampaignDesc& campaign, const CampaignElement& element);

/// Returns what distinguishes the result of an element from those of all others: SHA-256 over
/// software, scenario with its files, time, truth and stream. Errors: those of element_scenario()
/// and server::identify_scenario().
[[nodiscard]] physics::Result<std::string> element_identity(const config::CampaignDesc& campaign,
                                                            const CampaignElement& element);

/// Runs an element in this process: its picture, the truth that the campaign asks for, and the
/// stream. Columns: element, the varied keys and time_s; weather and sun; surface temperatures;
/// errors; then what depends on the machine: lateness and times. `work` is an existing folder for
/// the daemon's files. Errors: those of the renderer, the reference and the daemon.
[[nodiscard]] physics::Result<ResultRow> run_element(const config::CampaignDesc& campaign,
                                                     const CampaignElement& element,
                                                     const std::filesystem::path& work);

}  // namespace emit::tool
