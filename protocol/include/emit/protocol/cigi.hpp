// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/protocol/cigi/host_packets.hpp"
#include "emit/protocol/cigi/host_packets4.hpp"
#include "emit/protocol/cigi/host_requests.hpp"
#include "emit/protocol/cigi/ig_packets.hpp"
#include "emit/protocol/cigi/message.hpp"
#include "emit/protocol/cigi/reader.hpp"
#include "emit/protocol/cigi/writer.hpp"

/// Codec of the Common Image Generator Interface (CIGI) 3.3 and 4.0, for both directions and
/// both byte orders. docs/cigi.md lists the packets, the rules of faults and the sources.
