// SPDX-License-Identifier: Apache-2.0
// This is the only file that includes the TOML library.
#include <toml++/toml.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <sstream>

#include "keys/node.hpp"

namespace emit::config {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace {

using SourcePtr = std::shared_ptr<const Source>;

Location locate(const toml::source_region& region, const SourcePtr& source) {
  return {source, static_cast<std::uint32_t>(region.begin.line),
          static_cast<std::uint32_t>(region.begin.column)};
}

std::int64_t posix_ns(const toml::date_time& value) {
  using namespace std::chrono;
  const sys_days day{year{value.date.year} / value.date.month / value.date.day};
  const nanoseconds of_day = hours{value.time.hour} + minutes{value.time.minute} +
                             seconds{value.time.second} + nanoseconds{value.time.nanosecond};
  const minutes offset{value.offset ? value.offset->minutes : 0};
  return duration_cast<nanoseconds>(day.time_since_epoch() + of_day - offset).count();
}

/// True for the years that int64 ns since 1970 can hold; they end in 2262.
bool year_fits(const toml::date& date) {
  return date.year >= 1900 && date.year <= 2199;
}

Node convert(const toml::node& in, const SourcePtr& source) {
  Node out;
  out.at = locate(in.source(), source);
  if (const auto* boolean = in.as_boolean()) {
    out.kind = Node::Kind::boolean;
    out.boolean = boolean->get();
  } else if (const auto* integer = in.as_integer()) {
    out.kind = Node::Kind::integer;
    out.integer = integer->get();
  } else if (const auto* number = in.as_floating_point()) {
    out.kind = Node::Kind::number;
    out.number = number->get();
  } else if (const auto* text = in.as_string()) {
    out.kind = Node::Kind::text;
    out.text = text->get();
  } else if (const auto* instant = in.as_date_time()) {
    const toml::date_time& value = instant->get();
    out.kind = value.offset && year_fits(value.date) ? Node::Kind::instant : Node::Kind::local_time;
    if (out.kind == Node::Kind::instant) {
      out.instant_ns = posix_ns(value);
    }
  } else if (const auto* array = in.as_array()) {
    out.kind = Node::Kind::array;
    for (const toml::node& item : *array) {
      out.items.push_back(convert(item, source));
    }
  } else if (const auto* table = in.as_table()) {
    out.kind = Node::Kind::table;
    for (const auto& [key, value] : *table) {
      out.members.push_back(
          {std::string(key.str()), locate(key.source(), source), convert(value, source)});
    }
    std::stable_sort(out.members.begin(), out.members.end(), [](const Member& a, const Member& b) {
      return std::pair(a.key_at.line, a.key_at.column) < std::pair(b.key_at.line, b.key_at.column);
    });
  } else {
    out.kind = Node::Kind::local_time;
  }
  return out;
}

void relocate(Node& node, const Location& at) {
  node.at = at;
  for (Node& item : node.items) {
    relocate(item, at);
  }
  for (Member& member : node.members) {
    member.key_at = at;
    relocate(member.value, at);
  }
}

}  // namespace

Result<Node> parse_toml_text(std::string_view text, std::shared_ptr<const Source> source) {
  try {
    const toml::table root = toml::parse(text, source->name);
    Node out = convert(root, source);
    out.at = {source, 1, 1};
    return out;
  } catch (const toml::parse_error& error) {
    return make_error(ErrorCode::config, locate(error.source(), source).to_string() + ": " +
                                             std::string(error.description()));
  } catch (const std::exception& error) {
    return make_error(ErrorCode::config, source->name + ": " + error.what());
  }
}

Result<Node> parse_toml_file(const std::filesystem::path& file) {
  std::error_code code;
  if (!std::filesystem::exists(file, code)) {
    return make_error(ErrorCode::not_found, file.string() + ": no such file");
  }
  if (!std::filesystem::is_regular_file(file, code)) {
    return make_error(ErrorCode::io, file.string() + ": not a regular file");
  }
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    return make_error(ErrorCode::io, file.string() + ": cannot be opened: " + std::strerror(errno));
  }
  std::ostringstream content;
  content << stream.rdbuf();
  const std::string text = content.str();
  if (stream.bad()) {
    return make_error(ErrorCode::io, file.string() + ": reading failed");
  }
  std::filesystem::path directory = std::filesystem::absolute(file, code).parent_path();
  return parse_toml_text(
      text, std::make_shared<const Source>(Source{file.string(), directory.lexically_normal()}));
}

Node parse_override_value(std::string_view text, std::shared_ptr<const Source> source) {
  const Location at{source, 0, 0};
  Node out;
  out.kind = Node::Kind::text;
  out.text = std::string(text);
  // A line end could bring in more keys, and a `#` would drop the rest of a plain word.
  const bool quoted = !text.empty() && (text.front() == '"' || text.front() == '\'' ||
                                        text.front() == '[' || text.front() == '{');
  if (text.find('\n') == std::string_view::npos &&
      (quoted || text.find('#') == std::string_view::npos)) {
    if (Result<Node> parsed = parse_toml_text("v = " + std::string(text), source);
        parsed && parsed->members.size() == 1 && parsed->members[0].key == "v") {
      out = std::move(parsed->members[0].value);
    }
  }
  relocate(out, at);
  out.raw = std::string(text);
  return out;
}

bool parse_instant(std::string_view text, std::int64_t& posix) {
  auto source = std::make_shared<const Source>();
  const Node node = parse_override_value(text, source);
  if (node.kind != Node::Kind::instant) {
    return false;
  }
  posix = node.instant_ns;
  return true;
}

}  // namespace emit::config
