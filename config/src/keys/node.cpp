// SPDX-License-Identifier: Apache-2.0
#include "node.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace emit::config {

std::string Location::to_string() const {
  const std::string name = source ? source->name : std::string("configuration");
  if (line == 0) {
    return name;
  }
  return fmt::format("{}:{}:{}", name, line, column);
}

const Node* Node::find(std::string_view key) const noexcept {
  for (const Member& member : members) {
    if (member.key == key) {
      return &member.value;
    }
  }
  return nullptr;
}

Node* Node::find(std::string_view key) noexcept {
  for (Member& member : members) {
    if (member.key == key) {
      return &member.value;
    }
  }
  return nullptr;
}

const Member* Node::find_member(std::string_view key) const noexcept {
  for (const Member& member : members) {
    if (member.key == key) {
      return &member;
    }
  }
  return nullptr;
}

std::string_view kind_name(Node::Kind kind) noexcept {
  switch (kind) {
    case Node::Kind::boolean:
      return "a boolean";
    case Node::Kind::integer:
      return "an integer";
    case Node::Kind::number:
      return "a float";
    case Node::Kind::text:
      return "a string";
    case Node::Kind::instant:
      return "an instant";
    case Node::Kind::local_time:
      return "a date or time without offset";
    case Node::Kind::array:
      return "an array";
    case Node::Kind::table:
      return "a table";
  }
  return "a value";
}

void Diagnostics::add(const Location& at, std::string_view text) {
  lines_.push_back(at.to_string() + ": " + std::string(text));
}

physics::Error Diagnostics::error() const {
  std::string text;
  for (const std::string& line : lines_) {
    text += (text.empty() ? "" : "\n") + line;
  }
  return physics::Error{physics::ErrorCode::config, std::move(text)};
}

std::string toml_number(double value) {
  std::string text = fmt::format("{}", value);
  // TOML requires a point or an exponent in a float.
  if (text.find_first_of(".en") == std::string::npos) {
    text += ".0";
  }
  return text;
}

std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (byte < 0x20 || byte == 0x7F) {
      out += fmt::format("\\u{:04X}", static_cast<unsigned>(byte));
    } else {
      out += c;
    }
  }
  return out + "\"";
}

std::string toml_instant(std::int64_t posix_ns) {
  using namespace std::chrono;
  const sys_time<nanoseconds> instant{nanoseconds{posix_ns}};
  const sys_days day = floor<days>(instant);
  const year_month_day date{day};
  const hh_mm_ss<nanoseconds> time{instant - day};
  std::string out =
      fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}", static_cast<int>(date.year()),
                  static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                  time.hours().count(), time.minutes().count(), time.seconds().count());
  if (time.subseconds().count() != 0) {
    out += fmt::format(".{:09}", time.subseconds().count());
  }
  return out + "Z";
}

}  // namespace emit::config
