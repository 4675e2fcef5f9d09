// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Cuts JSON text into its values without building a tree. The glTF parser keeps its own JSON
/// library hidden; these functions find the few values that must be known before it runs. They
/// read any bytes safely and leave the complaint about wrong syntax to that parser.
namespace emit::scene {

struct JsonMember {
  std::string name;
  std::string_view value;  ///< part of the text, without blanks around it
};

/// Members of an object in the order of the text; nothing when the text is no object.
[[nodiscard]] std::optional<std::vector<JsonMember>> json_members(std::string_view text);

/// Items of an array; nothing when the text is no array.
[[nodiscard]] std::optional<std::vector<std::string_view>> json_items(std::string_view text);

/// Value of the last member of that name, as JSON readers take it; empty when there is none.
[[nodiscard]] std::string_view json_member(const std::vector<JsonMember>& members,
                                           std::string_view name);

/// Text of a string with its escapes resolved; nothing when the value is no string.
[[nodiscard]] std::optional<std::string> json_string(std::string_view value);

/// Returns the value; empty when it is no whole number of 0 to 2^64 - 1.
[[nodiscard]] std::optional<std::uint64_t> json_unsigned(std::string_view value);

}  // namespace emit::scene
