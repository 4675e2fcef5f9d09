// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

/// Version of the Protobuf conversation (Hello, Welcome, HostFrame); docs/wire.md says what bumps
/// it. Record, fragment and frame headers carry version bytes of their own beside it.
namespace emit::protocol {

inline constexpr std::uint32_t kProtocolVersion = 1;

}  // namespace emit::protocol
