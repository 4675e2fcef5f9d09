// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/protocol/cigi/message.hpp"

namespace emit::protocol::cigi {

/// Checks the numbers of a packet against the limits that its struct documents. Returns a fault of
/// kind `field` or `text` for the first one that is wrong, without its place in a message. RT-safe.
[[nodiscard]] Fault check_limits(const Packet& packet) noexcept;

/// Checks that a version has the packet and all values in it that differ from their defaults.
/// Returns a fault of kind `not_in_version` otherwise, without its place in a message. RT-safe.
[[nodiscard]] Fault check_version(const Packet& packet, Version version) noexcept;

}  // namespace emit::protocol::cigi
