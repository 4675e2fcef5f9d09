// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

namespace emit::server {

/// Names of this process that its log, its journal, its metrics and its Welcome state.
struct ProcessNames {
  std::string software;  ///< with version and commit
  std::string scenario;  ///< empty: there is none
  std::string pacing;    ///< name of the pacing mode
  std::string device;    ///< GL renderer, or the origin of stored frames
};

}  // namespace emit::server
