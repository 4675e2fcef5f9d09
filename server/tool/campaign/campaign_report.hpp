// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "emit/config/campaign.hpp"
#include "emit/physics/error.hpp"
#include "tool/campaign/result_row.hpp"

namespace emit::tool {

/// An element that has no result, and why.
struct MissingElement {
  std::size_t element = 0;
  std::string reason;
};

/// Results of a campaign.
struct CampaignResults {
  std::vector<std::string> keys;  ///< columns of the varied keys
  std::vector<ResultRow> rows;
  std::vector<MissingElement> missing;
};

/// Writes results.csv, missing elements last with their reason in the column `status`. Errors: io.
[[nodiscard]] physics::Result<void> write_campaign_table(const std::filesystem::path& file,
                                                         const CampaignResults& results);
/// Writes the report as an HTML page: key figures, error and lateness over the varied keys and the
/// conditions, means by the values of each key, all elements. Errors: io.
[[nodiscard]] physics::Result<void> write_campaign_html(const std::filesystem::path& file,
                                                        const config::CampaignDesc& campaign,
                                                        const CampaignResults& results);

}  // namespace emit::tool
