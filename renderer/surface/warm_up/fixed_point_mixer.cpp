// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/fixed_point_mixer.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/threads/parallel.hpp"

namespace emit::renderer {
namespace {

/// Values in one term of a sum, and in one task of a loop. Terms of a fixed size are added in
/// order, so that sums do not depend on how the loop is cut.
constexpr std::size_t kTerm = 8192;

/// Calls body(begin, end) for terms of [0, count).
template <class Body>
void by_terms(std::size_t count, const Body& body) {
  threads::parallel_parts((count + kTerm - 1) / kTerm, 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t t = from; t < to; ++t) body(t * kTerm, std::min(count, (t + 1) * kTerm));
  });
}

/// Solves the symmetric system `a` x = `b` of `n` rows by Cholesky's method. A direction in which
/// `a` is as good as singular gets 0.
template <std::size_t most>
void solve_symmetric(std::array<std::array<double, most>, most> a, std::array<double, most>& b,
                     std::size_t n) noexcept {
  constexpr double kSingular = 1e-12;
  std::array<bool, most> dropped{};
  for (std::size_t i = 0; i < n; ++i) {
    const double whole = a[i][i];
    for (std::size_t k = 0; k < i; ++k) {
      if (!dropped[k]) a[i][i] -= a[i][k] * a[i][k];
    }
    dropped[i] = !(a[i][i] > kSingular * whole);
    if (dropped[i]) continue;
    a[i][i] = std::sqrt(a[i][i]);
    for (std::size_t j = i + 1; j < n; ++j) {
      for (std::size_t k = 0; k < i; ++k) {
        if (!dropped[k]) a[j][i] -= a[j][k] * a[i][k];
      }
      a[j][i] /= a[i][i];
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (!dropped[k]) b[i] -= a[i][k] * b[k];
    }
    b[i] = dropped[i] ? 0.0 : b[i] / a[i][i];
  }
  for (std::size_t i = n; i-- > 0;) {
    if (dropped[i]) continue;
    for (std::size_t k = i + 1; k < n; ++k) b[i] -= a[k][i] * b[k];
    b[i] /= a[i][i];
  }
}

}  // namespace

void FixedPointMixer::mix(std::span<const float> x, std::span<float> g) {
  EMIT_CHECK_OP(x.size(), ==, g.size());
  const std::size_t count = x.size();
  last_off_.resize(count);
  last_image_.resize(count);
  off_steps_.resize(kDepth);
  image_steps_.resize(kDepth);
  // Keep the differences to the call before.
  std::size_t newest = steps_ % kDepth;
  if (!first_) {
    off_steps_[newest].resize(count);
    image_steps_[newest].resize(count);
    ++steps_;
  }
  const bool stores = !first_;
  by_terms(count, [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) {
      const float off = g[i] - x[i];
      if (stores) {
        off_steps_[newest][i] = off - last_off_[i];
        image_steps_[newest][i] = g[i] - last_image_[i];
      }
      last_off_[i] = off;
      last_image_[i] = g[i];
    }
  });
  first_ = false;
  const std::size_t depth = std::min(steps_, kDepth);
  if (depth == 0) return;
  // Find the mixture of the differences that comes closest to g(x) - x, by least squares.
  struct Sums {
    std::array<std::array<double, kDepth>, kDepth> a{};
    std::array<double, kDepth> b{};
  };
  std::vector<Sums> terms((count + kTerm - 1) / kTerm);
  by_terms(count, [&](std::size_t from, std::size_t to) {
    Sums& sums = terms[from / kTerm];
    for (std::size_t k = 0; k < depth; ++k) {
      const float* const step = off_steps_[k].data();
      for (std::size_t i = from; i < to; ++i) {
        sums.b[k] += static_cast<double>(step[i]) * static_cast<double>(last_off_[i]);
      }
      for (std::size_t l = 0; l <= k; ++l) {
        const float* const other = off_steps_[l].data();
        for (std::size_t i = from; i < to; ++i) {
          sums.a[k][l] += static_cast<double>(step[i]) * static_cast<double>(other[i]);
        }
      }
    }
  });
  Sums whole;
  for (const Sums& sums : terms) {
    for (std::size_t k = 0; k < depth; ++k) {
      whole.b[k] += sums.b[k];
      for (std::size_t l = 0; l <= k; ++l) whole.a[k][l] += sums.a[k][l];
    }
  }
  solve_symmetric(whole.a, whole.b, depth);
  // Step back along the differences of the images.
  by_terms(count, [&](std::size_t from, std::size_t to) {
    for (std::size_t k = 0; k < depth; ++k) {
      const float* const step = image_steps_[k].data();
      const auto share = static_cast<float>(whole.b[k]);
      for (std::size_t i = from; i < to; ++i) g[i] -= share * step[i];
    }
  });
}

}  // namespace emit::renderer
