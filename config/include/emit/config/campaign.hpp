// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"

/// Plain description of a campaign: many runs of one scenario with other weather, times, materials
/// or sensor keys. `emit campaign` runs it.
namespace emit::config {

/// One axis of the grid: rows of values that its keys take together.
struct CampaignAxis {
  std::vector<std::string> keys;
  std::vector<std::vector<std::string>> rows;  ///< TOML text of a value for each key
};

/// One dimension of the Latin hypercube.
struct CampaignSample {
  std::string key;
  double low = 0.0;
  double high = 1.0;
  bool logarithmic = false;
};

/// Source of the error of an element.
enum class CampaignTruthKind : std::uint8_t {
  none,    ///< no error is computed
  solve,   ///< the reference solution of `emit solve`
  render,  ///< the same picture with other keys, such as a finer thermal.tolerance_k
};
struct CampaignTruth {
  CampaignTruthKind kind = CampaignTruthKind::none;
  std::vector<std::string> set;  ///< overrides of the truth alone, KEY=VALUE
  std::string dimension = "auto";
  std::uint32_t rays = 64;
  std::uint32_t pixels = 200;  ///< solve: pixels that are solved; 0: all
  double refine = 0.5;
  double tolerance_k = 0.02;
  double spin_up_h = 72.0;
};

/// Frames of a daemon, which measure lateness.
struct CampaignStream {
  std::uint32_t frames = 0;  ///< 0: no daemon is started
  double rate_hz = 100.0;
  double budget_ms = 0.0;  ///< a frame is late after this time from its pose; 0: one period
};

/// Rules of the runs of elements, on local cores and by Slurm alike.
struct CampaignRun {
  std::uint32_t jobs = 1;      ///< local: elements at a time
  std::uint32_t retries = 1;   ///< of an element that failed or was killed
  double timeout_min = 120.0;  ///< an element that takes longer is killed
};

/// Resources of one element on a cluster. They limit how many elements a node runs at a time.
struct CampaignSlurm {
  std::string partition;             ///< empty: the default of the cluster
  std::uint32_t cpus = 1;            ///< cores of an element
  std::uint32_t memory_mib = 0;      ///< 0: the default of the cluster
  std::uint32_t at_once = 0;         ///< elements of the array at a time; 0: no limit
  std::vector<std::string> options;  ///< further options of sbatch
};

/// Content of a campaign file.
struct CampaignDesc {
  std::filesystem::path file;
  std::string name;
  std::string scenario;            ///< path, or name of a shipped scenario
  std::vector<std::string> set;    ///< overrides of all elements, KEY=VALUE
  std::string times;               ///< instants, as `emit render --times` has them
  double utc_offset_h = 0.0;       ///< clock of `times` minus UTC
  std::vector<CampaignAxis> axes;  ///< the grid has every combination of their rows
  std::uint32_t samples = 0;       ///< points of the Latin hypercube; 0: none
  std::vector<CampaignSample> sampled;
  std::uint64_t seed = 1;  ///< of the Latin hypercube
  CampaignTruth truth;
  CampaignStream stream;
  CampaignRun run;
  CampaignSlurm slurm;
};

/// Reads and checks a campaign. The scenario is found, but not read. Setup only. Errors: `config`
/// with one line per fault, "file:line:column: text"; `not_found` when the file does not exist.
[[nodiscard]] physics::Result<CampaignDesc> load_campaign(const std::filesystem::path& file);

}  // namespace emit::config
