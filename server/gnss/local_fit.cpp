// SPDX-License-Identifier: Apache-2.0
#include "gnss/local_fit.hpp"

#include <algorithm>
#include <vector>

#include "emit/physics/check.hpp"

namespace emit::server {
namespace {

/// Values of one orthogonal polynomial at the samples, and with its derivatives at the wanted
/// instant.
struct Basis {
  std::vector<double> at_samples;
  std::array<double, 4> at_wanted{};
};

}  // namespace

std::array<glm::dvec3, 4> fit_at(std::span<const FitSample> samples, std::size_t degree,
                                 double at_s) {
  EMIT_CHECK(!samples.empty());
  EMIT_CHECK_OP(degree, <=, std::size_t{6});
  const std::size_t count = samples.size();
  const double centre_s = 0.5 * (samples.front().time_s + samples.back().time_s);
  // Scaled times lie in [-1, 1].
  const double half_s = count > 1 ? 0.5 * (samples.back().time_s - samples.front().time_s) : 1.0;
  EMIT_CHECK_OP(half_s, >, 0.0);
  const auto scaled = [&](double time_s) { return (time_s - centre_s) / half_s; };
  const double wanted = scaled(at_s);

  Basis before{std::vector<double>(count, 0.0), {}};
  Basis now{std::vector<double>(count, 1.0), {1.0, 0.0, 0.0, 0.0}};
  std::array<glm::dvec3, 4> sums{};
  double norm_before = 1.0;
  const std::size_t most = std::min(degree, count - 1);
  for (std::size_t k = 0;; ++k) {
    double norm = 0.0;
    double moment = 0.0;
    glm::dvec3 projection(0.0);
    for (std::size_t i = 0; i < count; ++i) {
      const double p = now.at_samples[i];
      norm += p * p;
      moment += scaled(samples[i].time_s) * p * p;
      projection += p * samples[i].value;
    }
    const glm::dvec3 coefficient = projection / norm;
    for (std::size_t d = 0; d < sums.size(); ++d) sums[d] += coefficient * now.at_wanted[d];
    if (k == most) break;

    const double shift = moment / norm;
    const double back = k == 0 ? 0.0 : norm / norm_before;
    Basis next{std::vector<double>(count), {}};
    for (std::size_t i = 0; i < count; ++i) {
      next.at_samples[i] =
          (scaled(samples[i].time_s) - shift) * now.at_samples[i] - back * before.at_samples[i];
    }
    for (std::size_t d = 0; d < next.at_wanted.size(); ++d) {
      next.at_wanted[d] = (wanted - shift) * now.at_wanted[d] - back * before.at_wanted[d];
      if (d > 0) next.at_wanted[d] += static_cast<double>(d) * now.at_wanted[d - 1];
    }
    before = std::move(now);
    now = std::move(next);
    norm_before = norm;
  }
  double scale = 1.0;
  for (glm::dvec3& sum : sums) {
    sum *= scale;
    scale /= half_s;
  }
  return sums;
}

}  // namespace emit::server
