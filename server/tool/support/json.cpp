// SPDX-License-Identifier: Apache-2.0
#include "tool/support/json.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <fstream>

namespace emit::tool {
namespace {

void append_string(std::string& out, std::string_view text) {
  out += '"';
  for (const char c : text) {
    switch (c) {
      case '"':
        out += "\\\"";
        break;
      case '\\':
        out += "\\\\";
        break;
      case '\n':
        out += "\\n";
        break;
      case '\r':
        out += "\\r";
        break;
      case '\t':
        out += "\\t";
        break;
      default:
        if (static_cast<unsigned char>(c) < 0x20) {
          fmt::format_to(std::back_inserter(out), "\\u{:04x}",
                         static_cast<unsigned>(static_cast<unsigned char>(c)));
        } else {
          out += c;
        }
    }
  }
  out += '"';
}

void append_double(std::string& out, double value) {
  if (!std::isfinite(value)) {
    out += "null";
    return;
  }
  fmt::format_to(std::back_inserter(out), "{}", value);
}

}  // namespace

Json Json::object() {
  Json json;
  json.value_ = Members{};
  return json;
}

Json Json::array() {
  Json json;
  json.value_ = Items{};
  return json;
}

Json& Json::set(std::string_view key, Json value) {
  auto& members = std::get<Members>(value_);
  for (auto& [name, existing] : members) {
    if (name == key) {
      existing = std::move(value);
      return *this;
    }
  }
  members.emplace_back(std::string(key), std::move(value));
  return *this;
}

Json& Json::merge(const Json& other) {
  for (const auto& [key, value] : std::get<Members>(other.value_)) set(key, value);
  return *this;
}

Json& Json::push(Json value) {
  std::get<Items>(value_).push_back(std::move(value));
  return *this;
}

std::string Json::dump() const {
  std::string out;
  dump(out, 0);
  out += '\n';
  return out;
}

void Json::dump(std::string& out, int depth) const {
  const std::string indent(static_cast<std::size_t>(2 * (depth + 1)), ' ');
  const std::string close(static_cast<std::size_t>(2 * depth), ' ');
  if (std::holds_alternative<std::monostate>(value_)) {
    out += "null";
  } else if (const auto* boolean = std::get_if<bool>(&value_)) {
    out += *boolean ? "true" : "false";
  } else if (const auto* integer = std::get_if<std::int64_t>(&value_)) {
    out += fmt::format("{}", *integer);
  } else if (const auto* natural = std::get_if<std::uint64_t>(&value_)) {
    out += fmt::format("{}", *natural);
  } else if (const auto* real = std::get_if<double>(&value_)) {
    append_double(out, *real);
  } else if (const auto* text = std::get_if<std::string>(&value_)) {
    append_string(out, *text);
  } else if (const auto* members = std::get_if<Members>(&value_)) {
    out += members->empty() ? "{" : "{\n";
    for (std::size_t i = 0; i < members->size(); ++i) {
      out += indent;
      append_string(out, (*members)[i].first);
      out += ": ";
      (*members)[i].second.dump(out, depth + 1);
      out += i + 1 < members->size() ? ",\n" : "\n";
    }
    out += members->empty() ? "}" : close + "}";
  } else if (const auto* items = std::get_if<Items>(&value_)) {
    out += items->empty() ? "[" : "[\n";
    for (std::size_t i = 0; i < items->size(); ++i) {
      out += indent;
      (*items)[i].dump(out, depth + 1);
      out += i + 1 < items->size() ? ",\n" : "\n";
    }
    out += items->empty() ? "]" : close + "]";
  }
}

physics::Result<void> write_json(const std::filesystem::path& path, const Json& json) {
  const std::string text = json.dump();
  if (path == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
    return {};
  }
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) {
    return physics::make_error(physics::ErrorCode::io,
                               fmt::format("{}: cannot write the JSON results", path.string()));
  }
  return {};
}

}  // namespace emit::tool
