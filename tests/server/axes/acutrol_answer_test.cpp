// SPDX-License-Identifier: Apache-2.0
#include "axes/acutrol_answer.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace emit::server {
namespace {

using Kind = AcutrolAnswer::Kind;

TEST(AcutrolAnswer, is_told_by_its_last_word) {
  EXPECT_EQ(parse_acutrol_answer("OK").kind, Kind::ok);
  EXPECT_EQ(parse_acutrol_answer("ACUTROL ok ").kind, Kind::ok);
  EXPECT_EQ(parse_acutrol_answer("00000012\tOK").kind, Kind::ok);
  EXPECT_EQ(parse_acutrol_answer("OK 12").kind, Kind::number);
  EXPECT_EQ(parse_acutrol_answer("Close").kind, Kind::closed);
  EXPECT_EQ(parse_acutrol_answer("interlock closed").kind, Kind::closed);
  EXPECT_EQ(parse_acutrol_answer("Open").kind, Kind::open);
  EXPECT_EQ(parse_acutrol_answer("Fault").kind, Kind::fault);
  EXPECT_EQ(parse_acutrol_answer("").kind, Kind::other);
  EXPECT_EQ(parse_acutrol_answer(" ;, ").kind, Kind::other);
  EXPECT_EQ(parse_acutrol_answer("OKAY").kind, Kind::other);
  EXPECT_EQ(parse_acutrol_answer("12.5 deg?").kind, Kind::number);
}

TEST(AcutrolAnswer, has_the_last_word_that_is_a_number) {
  const auto value = [](std::string_view line) {
    const AcutrolAnswer answer = parse_acutrol_answer(line);
    return answer.kind == Kind::number ? answer.value : 1e99;
  };
  EXPECT_EQ(value("10.0001"), 10.0001);
  EXPECT_EQ(value("POS 1 = -0.125 deg"), -0.125);
  EXPECT_EQ(value(":R:P 1 +12.5"), 12.5);
  EXPECT_EQ(value("1.25E+2"), 125.0);
  EXPECT_EQ(value("7;44.125"), 44.125);
  EXPECT_EQ(value("-.5"), -0.5);
}

TEST(AcutrolAnswer, knows_what_is_no_number) {
  for (const char* line : {"nan", "inf", "-inf", "0x10", "1e999", "12deg", "--1", "+-1", "+", "e",
                           ".", "1.2.3", "1e"}) {
    EXPECT_EQ(parse_acutrol_answer(line).kind, Kind::other) << line;
  }
}

TEST(AcutrolAnswer, an_error_is_no_number_whatever_stands_behind_it) {
  EXPECT_EQ(parse_acutrol_answer("ERROR 12").kind, Kind::error);
  EXPECT_EQ(parse_acutrol_answer("header err: -113").kind, Kind::error);
  EXPECT_EQ(parse_acutrol_answer("Error OK").kind, Kind::error);
  EXPECT_EQ(parse_acutrol_answer("er 12").kind, Kind::number);
}

std::vector<std::string> lines_of(LineSplitter& splitter, std::string_view bytes) {
  std::vector<std::string> out;
  while (splitter.next(bytes)) out.emplace_back(splitter.line());
  EXPECT_TRUE(bytes.empty());
  return out;
}

TEST(LineSplitter, cuts_bytes_into_lines_however_they_arrive) {
  const std::string stream = "OK\r\n\r\n1.5\nOpen\rClose\n\r";
  const std::vector<std::string> expected{"OK", "1.5", "Open", "Close"};
  for (std::size_t piece = 1; piece <= stream.size(); ++piece) {
    LineSplitter splitter;
    std::vector<std::string> got;
    for (std::size_t at = 0; at < stream.size(); at += piece) {
      for (std::string& line : lines_of(splitter, std::string_view(stream).substr(at, piece))) {
        got.push_back(std::move(line));
      }
    }
    EXPECT_EQ(got, expected) << piece;
  }
}

TEST(LineSplitter, keeps_an_unfinished_line_and_cuts_a_long_one) {
  LineSplitter splitter;
  EXPECT_TRUE(lines_of(splitter, "12.").empty());
  EXPECT_EQ(lines_of(splitter, "5\nO"), std::vector<std::string>{"12.5"});
  splitter.clear();
  const auto got = lines_of(splitter, std::string(1000, 'x') + "\nOK\n");
  ASSERT_EQ(got.size(), 2U);
  EXPECT_EQ(got[0].size(), LineSplitter::kMostChars);
  EXPECT_EQ(got[1], "OK");
}

}  // namespace
}  // namespace emit::server
