// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/csv.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

namespace emit::physics {
namespace {

using testing::HasSubstr;

/// The header and the rows as "a|b|c", or the error's text as the last element.
std::vector<std::string> rows_of(std::string text) {
  std::vector<std::string> out;
  auto reader = CsvReader::from_text(std::move(text), "t.csv");
  if (!reader) return {reader.error().text};
  const auto joined = [](std::span<const CsvCell> cells) {
    std::string line;
    for (const CsvCell& cell : cells) line += (line.empty() ? "" : "|") + cell.text;
    return line;
  };
  out.push_back(joined(reader->header()));
  while (true) {
    const auto more = reader->next();
    if (!more) out.push_back(more.error().text);
    if (!more || !*more) return out;
    out.push_back(joined(reader->row()));
  }
}

using Rows = std::vector<std::string>;

TEST(CsvReader, LinesEndInAnyOfThreeWays) {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    EXPECT_EQ(rows_of("a,b" + end + "1,2" + end + end + "3,4" + end), (Rows{"a|b", "1|2", "3|4"}));
    EXPECT_EQ(rows_of("a,b" + end + "1,2"), (Rows{"a|b", "1|2"}));
  }
}

TEST(CsvReader, QuotesFollowRfc4180) {
  EXPECT_EQ(rows_of("\"a\",\"b,c\"\n\"1\",\"say \"\"x\"\"\"\n \"2\" , 3 \n"),
            (Rows{"a|b,c", "1|say \"x\"", "2|3"}));
  EXPECT_EQ(rows_of("a,b\n\"1\r\n2\",3\n"), (Rows{"a|b", "1\n2|3"}));
  EXPECT_EQ(rows_of("a,b\n\" 1 \",\"#x\"\n"), (Rows{"a|b", " 1 |#x"}));
  EXPECT_EQ(rows_of("a,b\n\"1,2\n"),
            (Rows{"a|b", "t.csv:2:1: the quoted cell that begins here is never closed"}));
  EXPECT_EQ(rows_of("a,b\n\"1\"2,3\n"),
            (Rows{"a|b", "t.csv:2:4: a comma is missing behind a closing quote"}));
}

TEST(CsvReader, AByteOrderMarkCommentsAndRowsWithoutContentAreSkipped) {
  EXPECT_EQ(rows_of("\xEF\xBB\xBF# c, d\na,b,,\n\n# x\n1,2,,\n,,,\n3,4\n"),
            (Rows{"a|b", "1|2", "3|4"}));
  EXPECT_EQ(rows_of("sep=,\na,b\n1,2\n"), (Rows{"a|b", "1|2"}));
}

TEST(CsvReader, PlacesAreLinesAndCharacters) {
  auto reader = CsvReader::from_text("# \xC3\xA4\na, b\n\"\xC3\xA4\", 7\n", "t.csv");
  ASSERT_TRUE(reader.has_value());
  EXPECT_EQ(reader->line(), 2U);
  ASSERT_TRUE(reader->next().value());
  EXPECT_EQ(reader->place_of(reader->row()[1]), "t.csv:3:6");
}

struct Dialect {
  const char* name;
  std::string text;
  const char* error;
};

/// Each foreign dialect gives one line that says what is the matter.
TEST(CsvReader, OtherDialectsGiveOneLineThatSaysWhatIsTheMatter) {
  using std::string_literals::operator""s;
  const std::vector<Dialect> dialects = {
      {"utf-16 le",
       "\xFF\xFE"
       "a\0,\0"s,
       "t.csv: the file is UTF-16 text: save it as UTF-8"},
      {"utf-16 be", "\xFE\xFF\0a\0,"s, "t.csv: the file is UTF-16 text: save it as UTF-8"},
      {"utf-16 without mark", "a\0,\0"s, "the file is UTF-16 text or binary"},
      {"xlsx", "PK\x03\x04zip", "the file is a spreadsheet or an archive"},
      {"gzip", "\x1F\x8B\x08", "the file is compressed"},
      {"semicolons", "a;b\n1,5;2\n", "t.csv:1:1: cells are separated by ';'; commas are wanted"},
      {"quoted semicolons", "\"a\";\"b\"\n", "t.csv:1:4: cells are separated by ';'"},
      {"tabs", "a\tb\n", "cells are separated by tabs"},
      {"quoted tabs", "\"a\"\t\"b\"\n", "cells are separated by tabs"},
      {"bars", "a|b\n", "cells are separated by '|'"},
      {"blanks", "a b\n", "cells are separated by blanks"},
      {"spreadsheet note", "sep=;\na;b\n", "t.csv:1:1: cells are separated by ';'"},
      {"indented comment", "  # measured\na,b\n", "t.csv:1:3: a comment has to begin in the first"},
      {"no names", "1,2\n3,4\n", "t.csv:1:1: the first row has to name the columns"},
      {"names in a comment", "#a,b\n1,2\n", "does the comment in line 1 hold the names?"},
      {"no name", "a,,b\n", "t.csv:1:3: the column has no name"},
      {"empty", "", "t.csv: the file has no header row"},
      {"comments alone", "# x\n", "t.csv: the file has no header row"},
  };
  for (const Dialect& dialect : dialects) {
    const Rows rows = rows_of(dialect.text);
    ASSERT_EQ(rows.size(), 1U) << dialect.name;
    EXPECT_THAT(rows[0], HasSubstr(dialect.error)) << dialect.name;
    EXPECT_EQ(rows[0].find('\n'), std::string::npos) << dialect.name;
  }
  EXPECT_THAT(rows_of("a,b\n1,2\n\t# later\n").back(), HasSubstr("t.csv:3:2: a comment has to"));
  EXPECT_THAT(rows_of("a,b\n1\n").back(), HasSubstr("t.csv:2:1: 1 values, the header has 2"));
}

TEST(CsvReader, FilesThatCannotBeReadAreNamed) {
  EXPECT_EQ(CsvReader::open("/nonexistent/t.csv").error().code, ErrorCode::not_found);
  EXPECT_EQ(CsvReader::open("/").error().code, ErrorCode::io);
}

TEST(CsvReader, ColumnsAreFoundByName) {
  const auto reader = CsvReader::from_text("a,b,c,c\n", "t.csv");
  ASSERT_TRUE(reader.has_value());
  EXPECT_EQ(reader->find("b").value(), 1U);
  EXPECT_EQ(reader->find("x").error().text,
            "t.csv:1: column 'x' is missing (the file has a, b, c, c)");
  EXPECT_EQ(reader->find("c").error().text, "t.csv:1: column 'c' appears twice");
}

TEST(CsvNumber, TakesDecimalNumbersWithASign) {
  EXPECT_EQ(csv_number("1.5"), 1.5);
  EXPECT_EQ(csv_number("+4"), 4.0);
  EXPECT_EQ(csv_number("-2e3"), -2000.0);
  EXPECT_EQ(csv_number("1e-400"), 0.0);
  EXPECT_EQ(csv_number("-1e400"), -std::numeric_limits<double>::infinity());
  for (const char* text : {"", "x", "1x", "0x10", "1 2", "--1", "+-1", "++1", "1,5"}) {
    EXPECT_FALSE(csv_number(text).has_value()) << text;
  }
}

TEST(CsvNumber, FaultsSayWhatTheTextLooksLike) {
  EXPECT_EQ(not_a_number_text("x"), "'x' is not a number");
  EXPECT_THAT(not_a_number_text("1,5"), HasSubstr("write '.' for the decimal point"));
  EXPECT_THAT(not_a_number_text("2014-06-21T06:00:00Z"), HasSubstr("epoch_utc"));
  EXPECT_THAT(not_a_number_text("1/2/2014 6:00"), HasSubstr("epoch_utc"));
  EXPECT_EQ(unix_time_hint(2e5), "");
  EXPECT_THAT(unix_time_hint(1764115200.0), HasSubstr("UNIX time in seconds (2025-11-26)"));
  EXPECT_THAT(unix_time_hint(1764115200e3), HasSubstr("UNIX time in milliseconds (2025-11-26)"));
  EXPECT_EQ(unix_time_hint(std::numeric_limits<double>::quiet_NaN()), "");
}

CsvTable table_of(const std::string& text) {
  auto table = CsvTable::parse(text, "t.csv");
  EXPECT_TRUE(table.has_value()) << table.error().text;
  return std::move(*table);
}

TEST(CsvTable, ReadsColumnsByName) {
  const CsvTable table =
      table_of("# a comment\r\n\r\nb, a,name\r\n1.5 ,-2e3,x\r\n#2,3,y\n\nnan,+4,z z");
  ASSERT_EQ(table.rows(), 2U);
  EXPECT_THAT(*table.numbers("a"), testing::ElementsAre(-2000.0, 4.0));
  EXPECT_THAT(*table.numbers("b"), testing::ElementsAre(1.5, testing::IsNan()));
  EXPECT_THAT(*table.texts("name"), testing::ElementsAre("x", "z z"));
  EXPECT_EQ(table.line_of(0), 4U);
  EXPECT_EQ(table.line_of(1), 7U);
}

TEST(CsvTable, KeepsItsCellsWhenMoved) {
  CsvTable table = table_of("a\n7\n");
  const CsvTable moved = std::move(table);
  EXPECT_THAT(*moved.texts("a"), testing::ElementsAre("7"));
}

TEST(CsvTable, FaultsNameFileLineAndColumn) {
  const auto missing = table_of("a,b\n1,2\n").numbers("lambda");
  ASSERT_FALSE(missing.has_value());
  EXPECT_EQ(missing.error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(missing.error().text, HasSubstr("column 'lambda' is missing"));
  const auto twice = table_of("a,a\n1,2\n").numbers("a");
  EXPECT_THAT(twice.error().text, HasSubstr("column 'a' appears twice"));
  const auto bad = table_of("a,b\n1x,1\n").numbers("a");
  ASSERT_FALSE(bad.has_value());
  EXPECT_EQ(bad.error().code, ErrorCode::parse);
  EXPECT_EQ(bad.error().text, "t.csv:2: column 'a': '1x' is not a number");
  EXPECT_EQ(CsvTable::read("/nonexistent/t.csv").error().code, ErrorCode::not_found);
}

}  // namespace
}  // namespace emit::physics
