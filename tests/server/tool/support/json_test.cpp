// SPDX-License-Identifier: Apache-2.0
#include "tool/support/json.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

namespace emit::tool {
namespace {

TEST(CliJson, keeps_the_order_of_keys_and_replaces_a_key_set_twice) {
  Json json = Json::object();
  json.set("b", 1).set("a", 2).set("b", 3);
  EXPECT_EQ(json.dump(), "{\n  \"b\": 3,\n  \"a\": 2\n}\n");
}

TEST(CliJson, writes_every_kind_of_value) {
  Json list = Json::array();
  list.push(nullptr).push(true).push(-5).push(std::uint64_t{18446744073709551615ULL});
  list.push(0.1).push("text").push(Json::object()).push(Json::array());
  EXPECT_EQ(
      list.dump(),
      "[\n  null,\n  true,\n  -5,\n  18446744073709551615,\n  0.1,\n  \"text\",\n  {},\n  []\n]\n");
}

TEST(CliJson, numbers_without_a_json_form_become_null) {
  Json list = Json::array();
  list.push(std::numeric_limits<double>::quiet_NaN());
  list.push(std::numeric_limits<double>::infinity());
  EXPECT_EQ(list.dump(), "[\n  null,\n  null\n]\n");
}

TEST(CliJson, doubles_survive_a_round_trip) {
  const double value = 1.0 / 3.0 * 1e-7;
  Json list = Json::array();
  list.push(value);
  std::istringstream text(list.dump().substr(2));
  double read = 0.0;
  text >> read;
  EXPECT_EQ(read, value);
}

TEST(CliJson, escapes_quotes_backslashes_and_control_characters) {
  Json list = Json::array();
  list.push(std::string("a\"b\\c\nd\x01"));
  EXPECT_EQ(list.dump(), "[\n  \"a\\\"b\\\\c\\nd\\u0001\"\n]\n");
}

TEST(CliJson, a_file_that_cannot_be_written_is_named) {
  const auto result = write_json("/nonexistent-folder/x.json", Json::object());
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().code, physics::ErrorCode::io);
  EXPECT_NE(result.error().text.find("/nonexistent-folder/x.json"), std::string::npos);
}

}  // namespace
}  // namespace emit::tool
