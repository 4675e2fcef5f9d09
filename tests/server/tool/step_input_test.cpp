// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/step_input.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <string_view>

namespace emit::tool {
namespace {

/// Pipe with a text in it; its other end is closed.
class Piped {
 public:
  explicit Piped(std::string_view text) {
    EXPECT_EQ(::pipe(ends_.data()), 0);
    EXPECT_EQ(::write(ends_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
    ::close(ends_[1]);
  }
  ~Piped() { ::close(ends_[0]); }
  Piped(const Piped&) = delete;
  Piped& operator=(const Piped&) = delete;
  [[nodiscard]] int fd() const { return ends_[0]; }

 private:
  std::array<int, 2> ends_{-1, -1};
};

int lines_of(std::string_view text) {
  const Piped piped(text);
  StepInput input(piped.fd());
  int lines = 0;
  while (input.wait_for_line()) ++lines;
  return lines;
}

TEST(StepInput, one_line_is_one_frame) {
  EXPECT_EQ(lines_of("\n\n\n"), 3);
  EXPECT_EQ(lines_of("next\r\n \n"), 2);
}

TEST(StepInput, q_ends) {
  EXPECT_EQ(lines_of("\n\nq\n\n\n"), 2);
  EXPECT_EQ(lines_of("\nq\r\n\n"), 1);
  EXPECT_EQ(lines_of("\nq"), 1);
  EXPECT_EQ(lines_of("quiet\n"), 1) << "only the letter alone ends";
}

TEST(StepInput, the_end_of_the_input_ends) {
  EXPECT_EQ(lines_of(""), 0);
  EXPECT_EQ(lines_of("\nlast"), 2);
}

TEST(StepInput, a_closed_input_ends) {
  int closed = -1;
  {
    const Piped piped("\n");
    closed = piped.fd();
  }
  StepInput input(closed);
  EXPECT_FALSE(input.wait_for_line());
}

}  // namespace
}  // namespace emit::tool
