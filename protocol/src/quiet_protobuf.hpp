// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <google/protobuf/stubs/logging.h>

namespace emit::protocol {

/// Switches off Protobuf's messages on standard error, for the whole process, from the first call
/// on. A peer could fill the disk with them, and every caller receives the failure as a value.
inline void quiet_protobuf() {
  static const auto previous = google::protobuf::SetLogHandler(nullptr);
  static_cast<void>(previous);
}

}  // namespace emit::protocol
