// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/protocol/ip_address.hpp"
#include "net/socket_address.hpp"

namespace emit::server {

/// Returns the address without the port. Thread: any. RT-safe.
[[nodiscard]] protocol::IpAddress ip_of(const SocketAddress& address) noexcept;
/// Returns the address that the kernel filled in.
[[nodiscard]] protocol::IpAddress ip_of(const sockaddr_storage& address) noexcept;

}  // namespace emit::server
