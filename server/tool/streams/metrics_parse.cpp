// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/metrics_parse.hpp"

#include <fmt/format.h>

#include <charconv>
#include <optional>

namespace emit::tool {
namespace {

bool is_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == ':';
}

/// Rest of a line that is not parsed yet.
class Line {
 public:
  explicit Line(std::string_view text) : left_(text) {}

  std::string_view name() {
    std::size_t count = 0;
    while (count < left_.size() && is_name(left_[count])) ++count;
    return take(count);
  }
  bool skip(std::string_view what) {
    if (!left_.starts_with(what)) return false;
    left_.remove_prefix(what.size());
    return true;
  }
  /// Takes a text between quotes, with \\, \" and \n.
  std::optional<std::string> quoted() {
    if (!skip("\"")) return std::nullopt;
    std::string out;
    while (!left_.empty()) {
      const char c = take(1)[0];
      if (c == '"') return out;
      if (c != '\\') {
        out += c;
        continue;
      }
      if (left_.empty()) break;
      const char escaped = take(1)[0];
      out += escaped == 'n' ? '\n' : escaped;
    }
    return std::nullopt;
  }
  std::optional<double> number() {
    const std::string_view word = take(std::min(left_.find(' '), left_.size()));
    double value = 0.0;
    const std::string_view digits = word.starts_with('+') ? word.substr(1) : word;
    const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (code != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
    return value;
  }

 private:
  std::string_view take(std::size_t count) {
    const std::string_view part = left_.substr(0, count);
    left_.remove_prefix(part.size());
    return part;
  }
  std::string_view left_;
};

std::optional<MetricSample> parse_line(std::string_view text) {
  Line line(text);
  MetricSample sample;
  sample.name = line.name();
  if (sample.name.empty()) return std::nullopt;
  if (line.skip("{")) {
    while (!line.skip("}")) {
      const std::string label(line.name());
      if (label.empty() || !line.skip("=")) return std::nullopt;
      const auto value = line.quoted();
      if (!value) return std::nullopt;
      sample.labels[label] = *value;
      static_cast<void>(line.skip(","));
    }
  }
  if (!line.skip(" ")) return std::nullopt;
  const auto value = line.number();
  if (!value) return std::nullopt;
  sample.value = *value;
  return sample;
}

}  // namespace

std::string MetricSample::label(const std::string& key) const {
  const auto found = labels.find(key);
  return found != labels.end() ? found->second : std::string();
}

physics::Result<std::vector<MetricSample>> parse_metrics(std::string_view text) {
  std::vector<MetricSample> samples;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.empty() || line.front() == '#') continue;
    auto sample = parse_line(line);
    if (!sample) {
      return physics::make_error(physics::ErrorCode::parse,
                                 fmt::format("line {}: '{}' is no metric", number, line));
    }
    samples.push_back(std::move(*sample));
  }
  return samples;
}

double quantile_bound(const std::vector<std::pair<double, double>>& buckets, double share) {
  if (buckets.empty() || buckets.back().second <= 0.0) return 0.0;
  for (const auto& [upper, count] : buckets) {
    if (count >= share * buckets.back().second) return upper;
  }
  return buckets.back().first;
}

}  // namespace emit::tool
