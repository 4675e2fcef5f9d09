// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::tool {

struct MetricSample {
  std::string name;  ///< with _bucket, _sum or _count where it is a histogram's
  std::map<std::string, std::string> labels;
  double value = 0.0;

  /// Returns the value of a label; empty when there is none of that name.
  [[nodiscard]] std::string label(const std::string& key) const;
};

/// Parses samples of Prometheus' text format, in their order. Comments and time stamps are ignored.
/// Errors (parse) name the line.
[[nodiscard]] physics::Result<std::vector<MetricSample>> parse_metrics(std::string_view text);

/// Returns the value below which this share of a histogram's samples lies: the upper end of the
/// bucket that holds it. `buckets` has upper ends and counts up to them, ascending. The result is 0
/// without samples.
[[nodiscard]] double quantile_bound(const std::vector<std::pair<double, double>>& buckets,
                                    double share);

}  // namespace emit::tool
