// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "agents/channel_table.hpp"

namespace emit::v1 {
class ChannelInfo;
}

namespace emit::server {

/// Writes the description of a channel that goes to clients.
void fill(const Channel& channel, v1::ChannelInfo& out);

}  // namespace emit::server
