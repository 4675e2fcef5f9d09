// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::tool {

/// A JSON document to be written; keys keep the order in which they were set. Any thread, setup
/// only.
///   Json result = Json::object();
///   result.set("frames", 5).set("max_error_k", nullptr);
///   write_json("out.json", result);
class Json {
 public:
  Json() = default;  ///< null
  Json(std::nullptr_t) {}
  Json(bool value) : value_(value) {}
  Json(std::integral auto value) : value_(static_cast<std::int64_t>(value)) {}
  Json(std::uint64_t value) : value_(value) {}
  /// Makes a number. NaN and infinities have no JSON form and are written as null.
  Json(std::floating_point auto value) : value_(static_cast<double>(value)) {}
  Json(std::string value) : value_(std::move(value)) {}
  Json(std::string_view value) : value_(std::string(value)) {}
  Json(const char* value) : value_(std::string(value)) {}

  [[nodiscard]] static Json object();
  [[nodiscard]] static Json array();

  /// Replaces or appends a key of an object.
  Json& set(std::string_view key, Json value);
  /// Sets every key of another object.
  Json& merge(const Json& other);
  /// Appends to an array.
  Json& push(Json value);

  /// Returns indented text, UTF-8, with a newline at the end. Doubles survive a round trip.
  [[nodiscard]] std::string dump() const;

 private:
  using Members = std::vector<std::pair<std::string, Json>>;
  using Items = std::vector<Json>;
  void dump(std::string& out, int depth) const;

  std::variant<std::monostate, bool, std::int64_t, std::uint64_t, double, std::string, Members,
               Items>
      value_;
};

/// Writes `json` to `path`, or to standard output when it is "-". Errors: io, naming the file.
[[nodiscard]] physics::Result<void> write_json(const std::filesystem::path& path, const Json& json);

}  // namespace emit::tool
