// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <map>
#include <string>
#include <string_view>
#include <variant>

#include "emit/physics/error.hpp"

namespace emit::tool {

/// A JSON object on one line, as programs of the closed loop print them. Any thread.
class JsonLine {
 public:
  /// Errors (protocol): no JSON object.
  [[nodiscard]] static physics::Result<JsonLine> parse(const std::string& line);

  /// Returns a finite number. Errors (protocol): the key is missing or holds something else.
  [[nodiscard]] physics::Result<double> number(const std::string& key) const;
  /// Returns true or false. Errors (protocol): the key is missing or holds something else.
  [[nodiscard]] physics::Result<bool> boolean(const std::string& key) const;
  /// Returns a text. Errors (protocol): the key is missing or holds something else.
  [[nodiscard]] physics::Result<std::string> text(const std::string& key) const;
  [[nodiscard]] bool has(const std::string& key) const { return values_.contains(key); }

 private:
  using Value = std::variant<std::monostate, double, bool, std::string>;
  std::map<std::string, Value> values_;
};

}  // namespace emit::tool
