// SPDX-License-Identifier: Apache-2.0
#include "tool/support/statistics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::tool {
namespace {
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
}

Samples::Samples(std::size_t most) : most_(most) {
  EMIT_CHECK(most > 0 && most % 2 == 0);
  values_.resize(most);  // written once, so that a long run does not look as if it leaked
  values_.clear();
}

void Samples::add(double value) {
  max_ = count_ == 0 ? value : std::max(max_, value);
  sum_ += value;
  if (count_++ % stride_ != 0) return;
  values_.push_back(value);
  if (most_ == 0 || values_.size() < most_) return;
  for (std::size_t i = 0; 2 * i < values_.size(); ++i) values_[i] = values_[2 * i];
  values_.resize((values_.size() + 1) / 2);
  stride_ *= 2;
}

double Samples::percentile(double frac) const {
  if (values_.empty()) return kNan;
  std::vector<double> sorted = values_;
  const double count = static_cast<double>(sorted.size());
  const auto rank = static_cast<std::size_t>(std::max(1.0, std::ceil(frac * count - 1e-9)));
  const auto nth = sorted.begin() + static_cast<std::ptrdiff_t>(std::min(rank, sorted.size()) - 1);
  std::nth_element(sorted.begin(), nth, sorted.end());
  return *nth;
}

double Samples::median() const {
  if (values_.empty()) return kNan;
  std::vector<double> sorted = values_;
  std::sort(sorted.begin(), sorted.end());
  const std::size_t middle = sorted.size() / 2;
  return sorted.size() % 2 == 1 ? sorted[middle] : 0.5 * (sorted[middle - 1] + sorted[middle]);
}

double Samples::mean() const {
  return values_.empty() ? kNan : sum_ / static_cast<double>(count_);
}

double Samples::max() const {
  return values_.empty() ? kNan : max_;
}

double Samples::sum() const {
  return sum_;
}

std::string histogram_text(const Samples& samples, const std::string& unit) {
  if (samples.empty()) return "";
  constexpr std::array<double, 3> kSteps{1.0, 2.0, 5.0};
  const auto& values = samples.values();
  const double largest = samples.max();
  double decade = 1.0;
  const double smallest = std::max(1e-9, *std::min_element(values.begin(), values.end()));
  while (decade > smallest) decade /= 10.0;
  while (decade * 10.0 <= smallest) decade *= 10.0;

  // The smallest and the largest sample are at most 40 decades apart.
  std::vector<double> edges(1, 0.0);
  for (int step = 0; step < 120 && edges.back() <= largest; ++step) {
    edges.push_back(decade * kSteps[static_cast<std::size_t>(step % 3)]);
    if (step % 3 == 2) decade *= 10.0;
  }
  std::vector<std::size_t> counts(edges.size(), 0);
  for (const double value : values) {
    const auto above = std::upper_bound(edges.begin(), edges.end(), value);
    const std::ptrdiff_t bin = above - edges.begin() - 1;
    ++counts[static_cast<std::size_t>(std::max<std::ptrdiff_t>(bin, 0))];
  }
  std::size_t tallest = 1;
  for (const std::size_t count : counts) tallest = std::max(tallest, count);
  std::string out;
  for (std::size_t i = 0; i + 1 < edges.size(); ++i) {
    if (counts[i] == 0) continue;
    constexpr std::size_t kBarWidth = 40;
    const std::size_t length = std::max<std::size_t>(1, kBarWidth * counts[i] / tallest);
    out += fmt::format("  {:>8g} .. {:<8g} {} {:>7} {}\n", edges[i], edges[i + 1], unit, counts[i],
                       std::string(length, '#'));
  }
  return out;
}

}  // namespace emit::tool
