// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace emit::verify {

/// Result columns as CSV text: `header`, then one line per row. `columns` have equal length.
/// Round-trip digits: 17 for double, 9 for float; NaN of either sign is `nan`.
[[nodiscard]] std::string write_csv(std::string_view header,
                                    std::span<const std::vector<double>> columns);
[[nodiscard]] std::string write_csv(std::string_view header,
                                    std::span<const std::vector<float>> columns);

}  // namespace emit::verify
