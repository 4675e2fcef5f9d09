// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/json_line.hpp"

#include <fmt/format.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>

#include <cmath>

namespace emit::tool {
namespace {

tl::unexpected<physics::Error> lacks(const std::string& key, std::string_view kind) {
  return physics::make_error(physics::ErrorCode::protocol,
                             fmt::format("'{}' is missing or is no {}", key, kind));
}

}  // namespace

physics::Result<JsonLine> JsonLine::parse(const std::string& line) {
  google::protobuf::Struct object;
  if (!google::protobuf::util::JsonStringToMessage(line, &object).ok()) {
    constexpr std::size_t kShownBytes = 120;
    return physics::make_error(physics::ErrorCode::protocol,
                               fmt::format("no JSON object: {}", line.substr(0, kShownBytes)));
  }
  JsonLine out;
  for (const auto& [key, value] : object.fields()) {
    switch (value.kind_case()) {
      case google::protobuf::Value::kNumberValue:
        out.values_[key] = value.number_value();
        break;
      case google::protobuf::Value::kBoolValue:
        out.values_[key] = value.bool_value();
        break;
      case google::protobuf::Value::kStringValue:
        out.values_[key] = value.string_value();
        break;
      default:
        out.values_[key] = std::monostate();
    }
  }
  return out;
}

physics::Result<double> JsonLine::number(const std::string& key) const {
  const auto at = values_.find(key);
  const double* const value = at == values_.end() ? nullptr : std::get_if<double>(&at->second);
  if (value == nullptr || !std::isfinite(*value)) return lacks(key, "finite number");
  return *value;
}

physics::Result<bool> JsonLine::boolean(const std::string& key) const {
  const auto at = values_.find(key);
  const bool* const value = at == values_.end() ? nullptr : std::get_if<bool>(&at->second);
  if (value == nullptr) return lacks(key, "truth value");
  return *value;
}

physics::Result<std::string> JsonLine::text(const std::string& key) const {
  const auto at = values_.find(key);
  const auto* const value = at == values_.end() ? nullptr : std::get_if<std::string>(&at->second);
  if (value == nullptr) return lacks(key, "text");
  return *value;
}

}  // namespace emit::tool
