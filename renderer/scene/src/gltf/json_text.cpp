// SPDX-License-Identifier: Apache-2.0
#include "json_text.hpp"

#include <charconv>

namespace emit::scene {
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

void skip_blanks(std::string_view text, std::size_t& at) {
  while (at < text.size() && kBlanks.find(text[at]) != std::string_view::npos) ++at;
}

/// Moves `at` from an opening quote to behind the closing one.
bool skip_string(std::string_view text, std::size_t& at) {
  for (++at; at < text.size(); ++at) {
    if (text[at] == '\\') {
      ++at;
    } else if (text[at] == '"') {
      ++at;
      return true;
    }
  }
  return false;
}

/// Moves `at` behind the value that begins there. Brackets are only counted, not matched by kind.
bool skip_value(std::string_view text, std::size_t& at) {
  std::size_t depth = 0;
  const std::size_t first = at;
  while (at < text.size()) {
    const char c = text[at];
    if (c == '"') {
      if (!skip_string(text, at)) return false;
    } else if (c == '{' || c == '[') {
      ++depth;
      ++at;
    } else if (c == '}' || c == ']') {
      if (depth == 0) return at > first;
      --depth;
      ++at;
    } else if (depth == 0 && (c == ',' || c == ':' || kBlanks.find(c) != std::string_view::npos)) {
      return at > first;
    } else {
      ++at;
      continue;
    }
    if (depth == 0) return true;
  }
  return depth == 0 && at > first;
}

/// Takes one value and the blanks around it.
std::optional<std::string_view> take_value(std::string_view text, std::size_t& at) {
  skip_blanks(text, at);
  const std::size_t first = at;
  if (!skip_value(text, at)) return std::nullopt;
  const std::string_view value = text.substr(first, at - first);
  skip_blanks(text, at);
  return value;
}

/// Appends a code point below 2^16. Halves of surrogate pairs become '?': no name that is compared
/// or path that is opened here needs them.
void append_utf8(std::string& out, std::uint32_t code) {
  if (code < 0x80) {
    out += static_cast<char>(code);
  } else if (code < 0x800) {
    out += static_cast<char>(0xc0U | code >> 6U);
    out += static_cast<char>(0x80U | (code & 0x3fU));
  } else if (code >= 0xd800 && code < 0xe000) {
    out += '?';
  } else {
    out += static_cast<char>(0xe0U | code >> 12U);
    out += static_cast<char>(0x80U | (code >> 6U & 0x3fU));
    out += static_cast<char>(0x80U | (code & 0x3fU));
  }
}

/// Calls `item(at)` at each item between the brackets; `item` moves `at` behind it.
template <class Item>
bool for_each_item(std::string_view text, char open, char close, Item item) {
  std::size_t at = 0;
  skip_blanks(text, at);
  if (at >= text.size() || text[at] != open) return false;
  ++at;
  skip_blanks(text, at);
  if (at < text.size() && text[at] == close) return true;
  while (item(at)) {
    if (at >= text.size()) return false;
    const char c = text[at++];
    if (c == close) return true;
    if (c != ',') return false;
  }
  return false;
}

}  // namespace

std::optional<std::vector<JsonMember>> json_members(std::string_view text) {
  std::vector<JsonMember> members;
  const bool whole = for_each_item(text, '{', '}', [&](std::size_t& at) {
    const auto name = take_value(text, at);
    std::optional<std::string> plain = name ? json_string(*name) : std::nullopt;
    if (!plain || at >= text.size() || text[at] != ':') return false;
    ++at;
    const auto value = take_value(text, at);
    if (!value) return false;
    members.push_back({std::move(*plain), *value});
    return true;
  });
  if (!whole) return std::nullopt;
  return members;
}

std::optional<std::vector<std::string_view>> json_items(std::string_view text) {
  std::vector<std::string_view> items;
  const bool whole = for_each_item(text, '[', ']', [&](std::size_t& at) {
    const auto value = take_value(text, at);
    if (value) items.push_back(*value);
    return value.has_value();
  });
  if (!whole) return std::nullopt;
  return items;
}

std::string_view json_member(const std::vector<JsonMember>& members, std::string_view name) {
  for (auto member = members.rbegin(); member != members.rend(); ++member) {
    if (member->name == name) return member->value;
  }
  return {};
}

std::optional<std::string> json_string(std::string_view value) {
  if (value.size() < 2 || value.front() != '"' || value.back() != '"') return std::nullopt;
  value = value.substr(1, value.size() - 2);
  std::string out;
  out.reserve(value.size());
  for (std::size_t i = 0; i < value.size(); ++i) {
    if (value[i] != '\\') {
      out += value[i];
      continue;
    }
    if (++i == value.size()) return std::nullopt;
    constexpr std::string_view kEscapes = "bfnrt";
    constexpr std::string_view kMeanings = "\b\f\n\r\t";
    if (const std::size_t escape = kEscapes.find(value[i]); escape != std::string_view::npos) {
      out += kMeanings[escape];
    } else if (value[i] == 'u') {
      std::uint32_t code = 0;
      if (value.size() - i < 5) return std::nullopt;
      const char* digits = value.data() + i + 1;
      const auto [end, error] = std::from_chars(digits, digits + 4, code, 16);
      if (error != std::errc() || end != digits + 4) return std::nullopt;
      append_utf8(out, code);
      i += 4;
    } else {
      out += value[i];
    }
  }
  return out;
}

std::optional<std::uint64_t> json_unsigned(std::string_view value) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  if (value.empty() || error != std::errc() || end != value.data() + value.size()) {
    return std::nullopt;
  }
  return number;
}

}  // namespace emit::scene
