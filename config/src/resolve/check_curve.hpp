// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <fmt/format.h>

#include <string>
#include <vector>

#include "resolve.hpp"

namespace emit::config {

/// Checks a curve over wavelength: two or more samples, wavelengths that ascend within those of the
/// key table, and shares of 0..1. Reports the first fault at `at` and returns false.
/// @param whole  of the curve, for messages: "a response"
/// @param share  of a sample, for messages: "response"
template <class Sample>
bool check_curve(const std::vector<Sample>& samples, const std::string& whole,
                 const std::string& share, const Location& at, Diagnostics& diagnostics) {
  const auto fail = [&](const std::string& text) {
    diagnostics.add(at, text);
    return false;
  };
  if (samples.size() < 2) return fail(whole + " needs at least two samples");
  double last_um = 0.0;
  for (const auto& [wavelength_um, share_frac] : samples) {
    if (!kWavelengthUm.contains(wavelength_um)) {
      return fail(fmt::format("a wavelength of {} is {}, must be {}{}", whole, wavelength_um,
                              kWavelengthUm.to_string(), wavelength_hint(wavelength_um)));
    }
    if (!(share_frac >= 0.0 && share_frac <= 1.0)) {
      return fail(
          fmt::format("the {} at {} um is {}, must be 0 .. 1", share, wavelength_um, share_frac));
    }
    if (!(wavelength_um > last_um)) {
      return fail(fmt::format("the wavelengths of {} must ascend ({} um follows {})", whole,
                              wavelength_um, last_um));
    }
    last_um = wavelength_um;
  }
  return true;
}

}  // namespace emit::config
