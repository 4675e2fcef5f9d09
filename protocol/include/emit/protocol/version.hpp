// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

/// Version of the Protobuf conversation (Hello, Welcome, HostFrame). docs/wire.md section 7 says
/// when it changes. Record, fragment and frame headers carry version bytes of their own.
namespace emit::protocol {

inline constexpr std::uint32_t kProtocolVersion = 1;

}  // namespace emit::protocol
