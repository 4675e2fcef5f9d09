// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/config/load.hpp"
#include "keys/keys.hpp"

namespace emit::config {

/// Puts the EMIT_* variables that name a key of `sections` into the tree. EMIT_* variables that
/// name no key of any file are reported.
void apply_environment(Node& root, const std::vector<SectionDoc>& sections,
                       const LoadOptions& options, Diagnostics& diagnostics);

/// Puts "key=value" into the tree. Whether the key exists is checked when the tree is read.
void apply_override(Node& root, std::string_view text, Diagnostics& diagnostics);

/// True for a key inside the array of tables `name`, such as material[asphalt].base_k.
[[nodiscard]] bool addresses_element_of(std::string_view text, std::string_view name) noexcept;

}  // namespace emit::config
