// SPDX-License-Identifier: Apache-2.0
#include "tool/campaign/campaign_elements.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numeric>
#include <random>

#include "tool/offline/time_list.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Text of TOML without its quotes.
std::string bare(const std::string& text) {
  const bool quoted = text.size() >= 2 && text.front() == '"' && text.back() == '"';
  return quoted ? text.substr(1, text.size() - 2) : text;
}

/// The grid as a list of axes: those of the file, then the times of the head.
std::vector<config::CampaignAxis> all_axes(const config::CampaignDesc& campaign,
                                           const std::vector<double>& times_s) {
  std::vector<config::CampaignAxis> axes = campaign.axes;
  if (times_s.empty()) return axes;
  config::CampaignAxis times{{"time_s"}, {}};
  for (const double time_s : times_s) times.rows.push_back({fmt::format("{}", time_s)});
  axes.push_back(std::move(times));
  return axes;
}

/// Takes one value of a condition. Errors: invalid_argument (a time that is none).
Result<void> take(const std::string& key, const std::string& value, const ClockOfDay& clock,
                  CampaignElement& element) {
  if (key != "time" && key != "time_s") {
    element.conditions.emplace_back(key, value);
    return {};
  }
  const auto times_s = parse_times(bare(value), clock);
  if (!times_s) return tl::unexpected(physics::Error(times_s.error()).with_context(key));
  if (times_s->size() != 1) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{}: '{}' is more than one instant", key, value));
  }
  element.time_s = times_s->front();
  return {};
}

}  // namespace

std::vector<std::string> CampaignElement::overrides(const config::CampaignDesc& campaign) const {
  std::vector<std::string> out = campaign.set;
  for (const auto& [key, value] : conditions) out.push_back(key + "=" + value);
  return out;
}

std::vector<std::vector<double>> latin_hypercube(std::size_t samples, std::size_t dimensions,
                                                 std::uint64_t seed) {
  std::vector<std::vector<double>> points(samples, std::vector<double>(dimensions));
  std::mt19937_64 random(seed);
  // The distributions of the standard library differ between implementations.
  const auto uniform = [&random] { return static_cast<double>(random() >> 11U) * 0x1p-53; };
  std::vector<std::size_t> strata(samples);
  for (std::size_t d = 0; d < dimensions; ++d) {
    std::iota(strata.begin(), strata.end(), std::size_t{0});
    for (std::size_t i = samples; i > 1; --i) {
      const auto other = static_cast<std::size_t>(uniform() * static_cast<double>(i));
      std::swap(strata[i - 1], strata[other]);
    }
    for (std::size_t s = 0; s < samples; ++s) {
      points[s][d] = (static_cast<double>(strata[s]) + uniform()) / static_cast<double>(samples);
    }
  }
  return points;
}

Result<std::vector<CampaignElement>> campaign_elements(const config::CampaignDesc& campaign,
                                                       std::int64_t epoch_utc_ns) {
  const ClockOfDay clock{epoch_utc_ns, campaign.utc_offset_h};
  std::vector<double> times_s;
  if (!campaign.times.empty()) {
    auto parsed = parse_times(campaign.times, clock);
    if (!parsed) return tl::unexpected(std::move(parsed.error()).with_context("times"));
    times_s = std::move(*parsed);
  }
  const std::vector<config::CampaignAxis> axes = all_axes(campaign, times_s);
  std::size_t grid = 1;
  const std::size_t points = std::max<std::size_t>(campaign.samples, 1);
  for (const config::CampaignAxis& axis : axes) {
    if (axis.rows.size() > kMaxElements / grid / points) {
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format("{}: more than {} elements", campaign.file.string(), kMaxElements));
    }
    grid *= axis.rows.size();
  }
  const auto cube = latin_hypercube(campaign.samples, campaign.sampled.size(), campaign.seed);
  std::vector<CampaignElement> elements;
  for (std::size_t s = 0; s < points; ++s) {
    for (std::size_t g = 0; g < grid; ++g) {
      CampaignElement element;
      element.number = elements.size();
      std::size_t rest = grid;
      for (const config::CampaignAxis& axis : axes) {
        rest /= axis.rows.size();
        const std::vector<std::string>& row = axis.rows[g / rest % axis.rows.size()];
        for (std::size_t k = 0; k < axis.keys.size(); ++k) {
          if (auto taken = take(axis.keys[k], row[k], clock, element); !taken) {
            return tl::unexpected(taken.error());
          }
        }
      }
      for (std::size_t d = 0; campaign.samples > 0 && d < campaign.sampled.size(); ++d) {
        const config::CampaignSample& sample = campaign.sampled[d];
        const double share = cube[s][d];
        const double value = sample.logarithmic
                                 ? sample.low * std::pow(sample.high / sample.low, share)
                                 : sample.low + (sample.high - sample.low) * share;
        // Twelve digits say the same on machines whose pow() differs in the last bit.
        if (auto taken = take(sample.key, fmt::format("{:.12g}", value), clock, element); !taken) {
          return tl::unexpected(taken.error());
        }
      }
      elements.push_back(std::move(element));
    }
  }
  return elements;
}

}  // namespace emit::tool
