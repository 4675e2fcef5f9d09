// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "emit/config/campaign.hpp"
#include "keys/campaign_keys.hpp"
#include "keys/data_files.hpp"
#include "resolve/resolve.hpp"

namespace emit::config {
namespace {

using physics::Result;

/// Names of the sections, which are keys of the root too.
std::vector<std::string_view> section_names() {
  std::vector<std::string_view> names;
  for (const SectionDoc& doc : campaign_sections()) {
    if (!doc.path.empty()) names.push_back(doc.path);
  }
  return names;
}

CampaignAxis resolve_axis(const Node& table, Diagnostics& diagnostics) {
  CampaignAxisDraft draft;
  read_table(table, campaign_axis_keys(), draft, diagnostics);
  CampaignAxis axis;
  axis.keys = draft.keys;
  if (!draft.key.empty() && axis.keys.empty()) axis.keys = {draft.key};
  if (axis.keys.empty() || (!draft.key.empty() && !draft.keys.empty())) {
    diagnostics.add(table.at, "an axis needs one of 'key' and 'keys'");
  }
  const bool spaced = table.has("from") || table.has("to") || table.has("count");
  if (table.has("values") == spaced) {
    diagnostics.add(table.at, "an axis needs either 'values' or 'from', 'to' and 'count'");
  } else if (spaced && (!table.has("from") || !table.has("to") || draft.count < 2)) {
    diagnostics.add(table.at, "'from', 'to' and a 'count' of at least 2 belong together");
  } else if (spaced && !draft.keys.empty()) {
    diagnostics.add(table.at, "'keys' needs 'values', a row of values for each step");
  } else if (!spaced && draft.values.empty()) {
    diagnostics.add(key_location(table, "values"), "'values' is empty");
  } else {
    axis.rows = campaign_rows(draft, diagnostics);
  }
  return axis;
}

void resolve_samples(const Node& root, CampaignDesc& campaign, Diagnostics& diagnostics) {
  for (const Node& table : section_array(root, "sample", diagnostics)) {
    CampaignSample sample;
    const std::size_t faults = diagnostics.size();
    read_table(table, campaign_sample_keys(), sample, diagnostics);
    if (diagnostics.size() == faults && !(sample.low < sample.high)) {
      diagnostics.add(key_location(table, "high"), "'high' must be above 'low'");
    } else if (sample.logarithmic && !(sample.low > 0.0)) {
      diagnostics.add(key_location(table, "low"), "'low' must be above 0 with 'logarithmic'");
    }
    campaign.sampled.push_back(std::move(sample));
  }
  if (campaign.sampled.empty() != (campaign.samples == 0)) {
    diagnostics.add(key_location(root, "samples"),
                    "'samples' and the tables [[sample]] belong together");
  }
}

void check_keys_once(const Node& root, const CampaignDesc& campaign, Diagnostics& diagnostics) {
  std::set<std::string> seen;
  std::size_t times = campaign.times.empty() ? 0 : 1;
  const auto add = [&](const std::string& key) {
    if (!seen.insert(key).second) {
      diagnostics.add(root.at, fmt::format("key '{}' is varied twice", key));
    }
    if (key == "time" || key == "time_s") ++times;
  };
  for (const CampaignAxis& axis : campaign.axes) std::ranges::for_each(axis.keys, add);
  for (const CampaignSample& sample : campaign.sampled) add(sample.key);
  if (times != 1) {
    diagnostics.add(root.at, fmt::format("the time is given {} times; give 'times', or vary 'time' "
                                         "or 'time_s', once",
                                         times));
  }
}

void resolve_campaign_scenario(const Node& root, CampaignDesc& campaign, Diagnostics& diagnostics) {
  if (campaign.scenario.empty()) return;
  std::error_code code;
  const Location& at = key_location(root, "scenario");
  auto path = resolve_path(campaign.scenario, campaign.file.parent_path());
  if (!path || !std::filesystem::is_regular_file(*path, code)) {
    path = resolve_scenario(campaign.scenario);
  }
  if (!path) {
    diagnostics.add(at, path.error().text);
    return;
  }
  campaign.scenario = std::filesystem::absolute(*path, code).lexically_normal().string();
}

}  // namespace

Result<CampaignDesc> load_campaign(const std::filesystem::path& file) {
  const Result<Node> root = parse_toml_file(file);
  if (!root) return tl::unexpected(root.error());
  Diagnostics diagnostics;
  CampaignDesc campaign;
  std::error_code code;
  campaign.file = std::filesystem::absolute(file, code).lexically_normal();
  campaign.name = file.stem().string();
  read_table(*root, campaign_head_keys(), campaign, diagnostics, section_names());
  resolve_campaign_scenario(*root, campaign, diagnostics);
  for (const Node& table : section_array(*root, "vary", diagnostics)) {
    campaign.axes.push_back(resolve_axis(table, diagnostics));
  }
  resolve_samples(*root, campaign, diagnostics);
  read_table(section(*root, "truth", diagnostics), campaign_truth_keys(), campaign.truth,
             diagnostics);
  read_table(section(*root, "stream", diagnostics), campaign_stream_keys(), campaign.stream,
             diagnostics);
  read_table(section(*root, "run", diagnostics), campaign_run_keys(), campaign.run, diagnostics);
  read_table(section(*root, "slurm", diagnostics), campaign_slurm_keys(), campaign.slurm,
             diagnostics);
  if (diagnostics.empty()) check_keys_once(*root, campaign, diagnostics);
  if (!diagnostics.empty()) return tl::unexpected(diagnostics.error());
  return campaign;
}

}  // namespace emit::config
