// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <google/protobuf/stubs/logging.h>

namespace emit::protocol {

/// Protobuf prints what it dislikes to standard error; a peer could fill the disk with that, and
/// every caller gets the failure as a value. Process-wide, from the first call on.
inline void quiet_protobuf() {
  static const auto previous = google::protobuf::SetLogHandler(nullptr);
  static_cast<void>(previous);
}

}  // namespace emit::protocol
