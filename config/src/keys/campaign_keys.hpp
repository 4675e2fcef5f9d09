// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

#include "emit/config/campaign.hpp"
#include "keys.hpp"

/// The key table of campaign files.
namespace emit::config {

/// An axis as the file has it.
struct CampaignAxisDraft {
  std::string key;
  std::vector<std::string> keys;
  std::vector<Node> values;
  Location values_at;
  double from = 0.0;
  double to = 0.0;
  std::int64_t count = 0;
};

[[nodiscard]] const KeyTable<CampaignDesc>& campaign_head_keys();
[[nodiscard]] const KeyTable<CampaignAxisDraft>& campaign_axis_keys();
[[nodiscard]] const KeyTable<CampaignSample>& campaign_sample_keys();
[[nodiscard]] const KeyTable<CampaignTruth>& campaign_truth_keys();
[[nodiscard]] const KeyTable<CampaignStream>& campaign_stream_keys();
[[nodiscard]] const KeyTable<CampaignRun>& campaign_run_keys();
[[nodiscard]] const KeyTable<CampaignSlurm>& campaign_slurm_keys();
[[nodiscard]] const std::vector<SectionDoc>& campaign_sections();

/// Values of an axis as TOML text, a row for each step of the axis.
[[nodiscard]] std::vector<std::vector<std::string>> campaign_rows(const CampaignAxisDraft& axis,
                                                                  Diagnostics& diagnostics);

}  // namespace emit::config
