// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/config/campaign.hpp"
#include "emit/physics/error.hpp"
#include "rt/fd.hpp"
#include "tool/campaign/campaign_elements.hpp"
#include "tool/campaign/result_row.hpp"

namespace emit::tool {

/// Folder of a campaign, on a file system that all nodes share. It has a file for each element that
/// is done (elements/NNNNNN.csv), for each that failed with a reason (elements/NNNNNN.error), and
/// their logs. Processes of elements write it, the process of the campaign reads it.
class ElementStore {
 public:
  /// Makes the folders. Errors: io.
  [[nodiscard]] static physics::Result<ElementStore> open(const std::filesystem::path& folder);

  /// Claims the folder for the process of a campaign, until the result is destroyed or the process
  /// ends. Errors (io): another campaign runs in the folder, or its lock cannot be written.
  [[nodiscard]] physics::Result<server::Fd> claim() const;

  /// Runs an element in this process and keeps its row, or its error. Errors: the element's own.
  [[nodiscard]] physics::Result<void> run(const config::CampaignDesc& campaign,
                                          const CampaignElement& element) const;

  /// Returns the row of an element if it is that of `identity`.
  [[nodiscard]] std::optional<ResultRow> row(std::size_t element,
                                             const std::string& identity) const;
  /// Error that an element ended with.
  struct Failure {
    bool final = false;  ///< another try would fail too: the configuration is wrong
    std::string text;
  };
  /// Returns the error of an element; empty for one that left none, as one that was killed.
  [[nodiscard]] std::optional<Failure> failure(std::size_t element) const;
  /// Returns true if the element left a row, whatever its identity is.
  [[nodiscard]] bool has_row(std::size_t element) const;
  /// Forgets the error and the row of an element, before another try.
  void forget(std::size_t element) const;

  [[nodiscard]] std::filesystem::path log_file(std::size_t element) const;
  [[nodiscard]] const std::filesystem::path& folder() const noexcept { return folder_; }

 private:
  explicit ElementStore(std::filesystem::path folder) : folder_(std::move(folder)) {}
  [[nodiscard]] std::filesystem::path file(std::size_t element, const char* extension) const;
  std::filesystem::path folder_;
};

}  // namespace emit::tool
