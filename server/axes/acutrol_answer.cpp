// SPDX-License-Identifier: Apache-2.0
#include "axes/acutrol_answer.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

namespace emit::server {
namespace {

constexpr std::string_view kBetweenWords = " \t,;=";

constexpr char small_letter(char c) noexcept {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

/// Returns true if a word is the other one, which has small letters.
bool same(std::string_view word, std::string_view small) noexcept {
  return std::ranges::equal(word, small, {}, small_letter);
}

/// Reads a whole word as a number. Returns false if it is none, or not finite.
bool read_word(std::string_view word, double& out) noexcept {
  // Names such as "nan" and "inf" are words and no numbers.
  if (word.find_first_not_of("+-.0123456789eE") != std::string_view::npos) return false;
  if (word.starts_with('+') && !word.starts_with("+-")) word.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) {
    return false;
  }
  out = value;
  return true;
}

}  // namespace

AcutrolAnswer parse_acutrol_answer(std::string_view line) noexcept {
  using Kind = AcutrolAnswer::Kind;
  AcutrolAnswer out;
  std::string_view last;
  bool error = false;
  while (!line.empty()) {
    const std::size_t size = std::min(line.find_first_of(kBetweenWords), line.size());
    const std::string_view word = line.substr(0, size);
    line.remove_prefix(std::min(size + 1, line.size()));
    if (word.empty()) continue;
    last = word;
    error = error || same(word.substr(0, 3), "err");
    if (read_word(word, out.value)) out.kind = Kind::number;
  }
  if (error) {
    out.kind = Kind::error;
  } else if (same(last, "ok")) {
    out.kind = Kind::ok;
  } else if (same(last, "close") || same(last, "closed")) {
    out.kind = Kind::closed;
  } else if (same(last, "open")) {
    out.kind = Kind::open;
  } else if (same(last, "fault")) {
    out.kind = Kind::fault;
  }
  return out;
}

bool LineSplitter::next(std::string_view& bytes) noexcept {
  if (ended_) clear();
  while (!bytes.empty()) {
    const char c = bytes.front();
    bytes.remove_prefix(1);
    if (c == '\n' || c == '\r') {
      if (size_ == 0) continue;
      ended_ = true;
      return true;
    }
    if (size_ < chars_.size()) chars_[size_++] = c;
  }
  return false;
}

}  // namespace emit::server
