// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "data_files.hpp"
#include "emit/config/load.hpp"
#include "key.hpp"
#include "keys.hpp"

namespace emit::config {

namespace {

void wrong_type(const Node& node, const std::string& name, std::string_view wanted,
                Diagnostics& diagnostics) {
  diagnostics.add(node.at,
                  fmt::format("'{}' must be {}, not {}", name, wanted, kind_name(node.kind)));
}

/// Takes a float or an integer as a number. It returns false when the node is something else.
bool as_number(const Node& node, double& out) {
  if (node.kind == Node::Kind::number) {
    out = node.number;
    return true;
  }
  if (node.kind == Node::Kind::integer) {
    out = static_cast<double>(node.integer);
    return true;
  }
  return false;
}

}  // namespace

std::string Range::to_string() const {
  const bool has_lo = std::isfinite(lo);
  const bool has_hi = std::isfinite(hi);
  if (has_lo && has_hi) {
    return lo_open ? fmt::format("> {}, <= {}", lo, hi) : fmt::format("{} .. {}", lo, hi);
  }
  if (has_lo) {
    return fmt::format("{} {}", lo_open ? ">" : ">=", lo);
  }
  return has_hi ? fmt::format("<= {}", hi) : std::string("finite");
}

void read_number(const Node& node, const std::string& name, const Range& range, double& out,
                 Diagnostics& diagnostics) {
  double value = 0.0;
  if (!as_number(node, value)) {
    wrong_type(node, name, "a number", diagnostics);
    return;
  }
  if (!range.contains(value)) {
    diagnostics.add(node.at, fmt::format("'{}' is {}, must be {}", name, value, range.to_string()));
    return;
  }
  out = value;
}

void read_integer(const Node& node, const std::string& name, std::int64_t lo, std::int64_t hi,
                  std::int64_t& out, Diagnostics& diagnostics) {
  if (node.kind != Node::Kind::integer) {
    wrong_type(node, name, "an integer", diagnostics);
    return;
  }
  if (node.integer < lo || node.integer > hi) {
    diagnostics.add(node.at,
                    fmt::format("'{}' is {}, must be {} .. {}", name, node.integer, lo, hi));
    return;
  }
  out = node.integer;
}

void read_boolean(const Node& node, const std::string& name, bool& out, Diagnostics& diagnostics) {
  if (node.kind != Node::Kind::boolean) {
    wrong_type(node, name, "true or false", diagnostics);
    return;
  }
  out = node.boolean;
}

bool read_text(const Node& node, const std::string& name, std::string& out,
               Diagnostics& diagnostics) {
  if (node.kind == Node::Kind::text) {
    out = node.text;
    return true;
  }
  // The command line may leave out the quotes: `--set sensor.name=7` means the word 7.
  if (!node.raw.empty() && node.kind != Node::Kind::array && node.kind != Node::Kind::table) {
    out = node.raw;
    return true;
  }
  wrong_type(node, name, "a string", diagnostics);
  return false;
}

void read_path(const Node& node, const std::string& name, std::filesystem::path& out,
               Diagnostics& diagnostics) {
  std::string text;
  if (!read_text(node, name, text, diagnostics)) {
    return;
  }
  if (text.empty()) {
    out.clear();
    return;
  }
  physics::Result<std::filesystem::path> resolved =
      resolve_path(text, node.at.source ? node.at.source->directory : std::filesystem::path());
  if (!resolved) {
    diagnostics.add(node.at, fmt::format("'{}': {}", name, resolved.error().text));
    return;
  }
  out = *resolved;
}

void read_vector(const Node& node, const std::string& name, std::size_t count, double* out,
                 Diagnostics& diagnostics) {
  if (node.kind != Node::Kind::array || node.items.size() != count) {
    diagnostics.add(node.at, fmt::format("'{}' must be an array of {} numbers, not {}", name, count,
                                         node.kind == Node::Kind::array
                                             ? fmt::format("of {}", node.items.size())
                                             : std::string(kind_name(node.kind))));
    return;
  }
  for (std::size_t i = 0; i < count; ++i) {
    double value = 0.0;
    if (!as_number(node.items[i], value)) {
      wrong_type(node.items[i], name, "an array of numbers", diagnostics);
      return;
    }
    if (!std::isfinite(value)) {
      diagnostics.add(node.items[i].at, fmt::format("'{}' must be finite", name));
      return;
    }
    out[i] = value;
  }
}

void read_instant(const Node& node, const std::string& name, std::int64_t& out,
                  Diagnostics& diagnostics) {
  if (node.kind == Node::Kind::instant) {
    out = node.instant_ns;
    return;
  }
  if (node.kind == Node::Kind::text && parse_instant(node.text, out)) {
    return;
  }
  diagnostics.add(node.at, fmt::format("'{}' must be an instant with offset between the years 1900 "
                                       "and 2199, such as 2014-06-21T06:00:00Z",
                                       name));
}

bool expect_table(const Node& node, const std::string& name, Diagnostics& diagnostics) {
  if (node.kind != Node::Kind::table) {
    wrong_type(node, name, "a table", diagnostics);
    return false;
  }
  return true;
}

bool expect_table_array(const Node& node, const std::string& name, Diagnostics& diagnostics) {
  if (node.kind != Node::Kind::array) {
    wrong_type(node, name, "an array of tables", diagnostics);
    return false;
  }
  for (const Node& item : node.items) {
    if (item.kind != Node::Kind::table) {
      wrong_type(item, name, "an array of tables", diagnostics);
      return false;
    }
  }
  return true;
}

std::string unknown_key_text(std::string_view key, const std::vector<std::string_view>& known) {
  return fmt::format("unknown key '{}'{}", key, did_you_mean(key, known));
}

std::string unscaled_number(double value, double scale) {
  if (scale == 1.0) {
    return toml_number(value);
  }
  const double plain = value / scale;
  // 48.56 degrees in radians and back are 48.560000000000002. The shortest decimal that gives the
  // very same radians is better to read.
  for (int digits = 6; digits <= 17; ++digits) {
    const std::string text = fmt::format("{:.{}g}", plain, digits);
    const double back = std::stod(text);
    if (back * scale == value) {
      return toml_number(back);
    }
  }
  // The quotient itself may not give the value back, but a neighbour does.
  double below = plain;
  double beyond = plain;
  for (int i = 0; i < 4; ++i) {
    below = std::nextafter(below, -std::numeric_limits<double>::infinity());
    beyond = std::nextafter(beyond, std::numeric_limits<double>::infinity());
    if (below * scale == value) {
      return toml_number(below);
    }
    if (beyond * scale == value) {
      return toml_number(beyond);
    }
  }
  return toml_number(plain);
}

std::string toml_vector(const double* values, std::size_t count) {
  std::string out = "[";
  for (std::size_t i = 0; i < count; ++i) {
    out += (i > 0 ? ", " : "") + toml_number(values[i]);
  }
  return out + "]";
}

}  // namespace emit::config
