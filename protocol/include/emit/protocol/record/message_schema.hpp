// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

namespace google::protobuf {
class Descriptor;
}

namespace emit::protocol {

/// Returns the schema of a Protobuf message as MCAP files hold it: a serialized FileDescriptorSet
/// with the message's file and all its imports, those first, each file once.
/// Thread: any.  Real time: not RT-safe.
[[nodiscard]] std::string file_descriptor_set(const google::protobuf::Descriptor& message);

}  // namespace emit::protocol
