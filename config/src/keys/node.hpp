// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/nearest_name.hpp"

/// A parsed file as plain values that know their place in the file. Only toml_adapter.cpp includes
/// the TOML library.
namespace emit::config {

/// A file, an environment variable or an override.
struct Source {
  std::string name;                 ///< name for messages
  std::filesystem::path directory;  ///< relative paths start here
};

struct Location {
  std::shared_ptr<const Source> source;
  std::uint32_t line = 0;  ///< from 1; 0: the source as a whole
  std::uint32_t column = 0;

  /// Text "file:line:column", or only the name of the source.
  [[nodiscard]] std::string to_string() const;
};

struct Member;

struct Node {
  enum class Kind : std::uint8_t {
    boolean,
    integer,
    number,
    text,
    instant,
    local_time,
    array,
    table
  };

  Kind kind = Kind::table;
  Location at;
  bool boolean = false;
  std::int64_t integer = 0;
  double number = 0.0;
  std::string text;
  std::int64_t instant_ns = 0;  ///< POSIX ns, UTC
  std::string raw;              ///< text of an override before it was read as TOML
  std::vector<Node> items;      ///< array
  std::vector<Member> members;  ///< table, in file order

  [[nodiscard]] const Node* find(std::string_view key) const noexcept;
  [[nodiscard]] Node* find(std::string_view key) noexcept;
  [[nodiscard]] const Member* find_member(std::string_view key) const noexcept;
  [[nodiscard]] bool has(std::string_view key) const noexcept { return find(key) != nullptr; }
};

struct Member {
  std::string key;
  Location key_at;
  Node value;
};

/// "a string", "an integer", ... for messages.
[[nodiscard]] std::string_view kind_name(Node::Kind kind) noexcept;

/// Collects the faults of one load, so that all are reported together.
class Diagnostics {
 public:
  void add(const Location& at, std::string_view text);
  [[nodiscard]] bool empty() const noexcept { return lines_.empty(); }
  [[nodiscard]] std::size_t size() const noexcept { return lines_.size(); }
  [[nodiscard]] physics::Error error() const;

 private:
  std::vector<std::string> lines_;
};

/// Reads a TOML file. Errors: not_found, io, config with "file:line:column: what".
[[nodiscard]] physics::Result<Node> parse_toml_file(const std::filesystem::path& file);
[[nodiscard]] physics::Result<Node> parse_toml_text(std::string_view text,
                                                    std::shared_ptr<const Source> source);
/// Reads one value as in `--set key=value`: as TOML, else as plain text. All locations are `source`
/// as a whole.
[[nodiscard]] Node parse_override_value(std::string_view text,
                                        std::shared_ptr<const Source> source);
/// Reads an RFC 3339 instant with offset, such as 2014-06-21T06:00:00Z. False when it is none.
[[nodiscard]] bool parse_instant(std::string_view text, std::int64_t& posix_ns);

/// Values in the spelling of TOML.
[[nodiscard]] std::string toml_number(double value);
[[nodiscard]] std::string toml_string(std::string_view text);
[[nodiscard]] std::string toml_instant(std::int64_t posix_ns);

using physics::did_you_mean;

}  // namespace emit::config
