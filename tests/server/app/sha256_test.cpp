// SPDX-License-Identifier: Apache-2.0
#include "app/sha256.hpp"

#include <gtest/gtest.h>

#include <string>

namespace emit::server {
namespace {

// The digests are the examples of FIPS 180-4.
TEST(Sha256, MatchesTheStandard) {
  Sha256 empty;
  EXPECT_EQ(empty.finish(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  Sha256 abc;
  const std::string text = "abc";
  abc.update(std::as_bytes(std::span(text)));
  EXPECT_EQ(abc.finish(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(Sha256, DoesNotDependOnTheParts) {
  const std::string text(1000, 'x');
  Sha256 whole;
  whole.update(std::as_bytes(std::span(text)));
  Sha256 parts;
  for (std::size_t at = 0; at < text.size(); at += 7) {
    const std::string part = text.substr(at, 7);
    parts.update(std::as_bytes(std::span(part)));
  }
  EXPECT_EQ(whole.finish(), parts.finish());
}

}  // namespace
}  // namespace emit::server
