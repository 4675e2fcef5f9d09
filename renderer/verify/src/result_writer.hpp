// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace emit::verify {

/// Returns result columns as CSV text: `header`, then one line per row. Numbers have the digits of
/// a round trip: 17 for double, 9 for float. NaN of either sign is `nan`.
/// @pre all columns have the same length
[[nodiscard]] std::string write_csv(std::string_view header,
                                    std::span<const std::vector<double>> columns);
[[nodiscard]] std::string write_csv(std::string_view header,
                                    std::span<const std::vector<float>> columns);

}  // namespace emit::verify
