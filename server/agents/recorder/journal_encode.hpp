// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>

#include "agents/recorder/recorder.hpp"

namespace emit::v1 {
class JournalEntry;
}

namespace emit::server {

/// Makes the message of a line from the journal ring. It returns false when the bytes are no line,
/// which is a defect.
[[nodiscard]] bool to_journal_entry(std::span<const std::byte> line,
                                    const Recorder::Identity& identity, v1::JournalEntry& out);

}  // namespace emit::server
