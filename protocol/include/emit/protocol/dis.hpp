// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/protocol/dis/clock.hpp"
#include "emit/protocol/dis/dead_reckoning.hpp"
#include "emit/protocol/dis/pdu.hpp"
#include "emit/protocol/dis/reader.hpp"
#include "emit/protocol/dis/writer.hpp"

/// Codec of Distributed Interactive Simulation (DIS), versions 6 and 7, as far as a receiver of
/// entities needs it. docs/dis.md lists the PDUs, the rules of faults and the sources.
