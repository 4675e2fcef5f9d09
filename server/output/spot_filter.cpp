// SPDX-License-Identifier: Apache-2.0
#include "output/spot_filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numeric>

#include "emit/physics/check.hpp"
#include "output/wide.hpp"
#include "output/window_margin.hpp"

namespace emit::server {
namespace {

/// Products are left out when together they change no share by more than this part of the greatest.
constexpr double kLeftOutFrac = 1e-5;
/// Half the side of the square that the veil is spread over, in radii of the spot.
constexpr std::uint32_t kVeilRadii = 3;
/// Eight pixels side by side; the compiler splits them where registers are narrower.
typedef float Pixels __attribute__((vector_size(32)));
constexpr std::size_t kPixels = sizeof(Pixels) / sizeof(float);
/// Groups of pixels whose sums stay in registers.
constexpr std::size_t kGroups = 4;
constexpr std::size_t kBlock = kGroups * kPixels;

/// Adds taps[k] rows[k][i] up to `to`, or to what it holds.
EMIT_LOOP_BODY void add_rows_body(const float* const* rows, std::span<const float> taps, bool adds,
                                  std::span<float> to) noexcept {
  std::size_t i = 0;
  for (; i + kBlock <= to.size(); i += kBlock) {
    std::array<Pixels, kGroups> sum{};
    if (adds) std::memcpy(sum.data(), to.data() + i, sizeof(sum));
    for (std::size_t k = 0; k < taps.size(); ++k) {
      const float* const from = rows[k] + i;
      const Pixels tap = taps[k] - Pixels{};
      for (std::size_t g = 0; g < kGroups; ++g) {
        Pixels pixels;
        std::memcpy(&pixels, from + g * kPixels, sizeof(pixels));
        sum[g] += tap * pixels;
      }
    }
    std::memcpy(to.data() + i, sum.data(), sizeof(sum));
  }
  for (; i < to.size(); ++i) {
    float sum = adds ? to[i] : 0.0F;
    for (std::size_t k = 0; k < taps.size(); ++k) sum += taps[k] * rows[k][i];
    to[i] = sum;
  }
}

void add_rows_plain(const float* const* rows, std::span<const float> taps, bool adds,
                    std::span<float> to) noexcept {
  add_rows_body(rows, taps, adds, to);
}

EMIT_WIDE_TARGET void add_rows_wide(const float* const* rows, std::span<const float> taps,
                                    bool adds, std::span<float> to) noexcept {
  add_rows_body(rows, taps, adds, to);
}

void add_rows(const float* const* rows, std::span<const float> taps, bool adds,
              std::span<float> to) noexcept {
  has_wide() ? add_rows_wide(rows, taps, adds, to) : add_rows_plain(rows, taps, adds, to);
}

/// Singular values and vectors of a square matrix by one-sided Jacobi rotations: the columns of
/// `u` times `v` transposed give the matrix.
struct Decomposed {
  std::vector<double> u;  ///< by row; its columns have the length of the singular values
  std::vector<double> v;
};

Decomposed decompose(const std::vector<double>& matrix, std::size_t n) {
  Decomposed out{matrix, std::vector<double>(n * n, 0.0)};
  for (std::size_t i = 0; i < n; ++i) out.v[i * n + i] = 1.0;
  constexpr int kMostSweeps = 60;
  constexpr double kOrthogonal = 1e-14;
  for (int sweep = 0; sweep < kMostSweeps; ++sweep) {
    bool turned = false;
    for (std::size_t p = 0; p + 1 < n; ++p) {
      for (std::size_t q = p + 1; q < n; ++q) {
        double pp = 0.0;
        double qq = 0.0;
        double pq = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
          pp += out.u[i * n + p] * out.u[i * n + p];
          qq += out.u[i * n + q] * out.u[i * n + q];
          pq += out.u[i * n + p] * out.u[i * n + q];
        }
        if (std::abs(pq) <= kOrthogonal * std::sqrt(pp * qq) || pp * qq < 1e-40) continue;
        turned = true;
        // Turn both columns so that they become orthogonal.
        const double zeta = (qq - pp) / (2.0 * pq);
        const double t = std::copysign(1.0, zeta) / (std::abs(zeta) + std::sqrt(1.0 + zeta * zeta));
        const double c = 1.0 / std::sqrt(1.0 + t * t);
        const double s = c * t;
        for (std::vector<double>* columns : {&out.u, &out.v}) {
          for (std::size_t i = 0; i < n; ++i) {
            double& a = (*columns)[i * n + p];
            double& b = (*columns)[i * n + q];
            const double kept = a;
            a = c * kept - s * b;
            b = s * kept + c * b;
          }
        }
      }
    }
    if (!turned) break;
  }
  return out;
}

}  // namespace

SpotFilter::SpotFilter(const Spot& spot, const scene::PixelRect& part,
                       const protocol::ImageSize& image)
    : part_px_(part),
      reads_px_(grown(part, spot.radius_px, image)),
      image_(image),
      radius_px_(spot.radius_px),
      veil_frac_(static_cast<float>(spot.veil_frac)) {
  // Split the spot into products, the greatest first, until the rest no longer counts.
  const std::size_t n = spot.side();
  const Decomposed parts = decompose(spot.share_frac, n);
  std::vector<double> values(n);
  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t i = 0; i < n; ++i) values[k] += parts.u[i * n + k] * parts.u[i * n + k];
    values[k] = std::sqrt(values[k]);
  }
  std::vector<std::size_t> order(n);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order,
                           [&](std::size_t a, std::size_t b) { return values[a] > values[b]; });
  double left = std::accumulate(values.begin(), values.end(), 0.0);
  const double most = std::ranges::max(spot.share_frac);
  double kept_sum = 0.0;
  for (const std::size_t k : order) {
    if (left <= kLeftOutFrac * most) break;
    left -= values[k];
    // A convolution meets the taps in reverse order.
    Product& product = products_.emplace_back();
    double across_sum = 0.0;
    double down_sum = 0.0;
    for (std::size_t i = n; i-- > 0;) {
      product.across.push_back(static_cast<float>(parts.v[i * n + k]));
      product.down.push_back(static_cast<float>(parts.u[i * n + k]));
      across_sum += static_cast<double>(product.across.back());
      down_sum += static_cast<double>(product.down.back());
    }
    kept_sum += across_sum * down_sum;
  }
  // Give the rest to the greatest product, so that an even image stays as it is.
  const double whole = 1.0 - spot.veil_frac;
  Product& first = products_.front();
  const double across_sum = std::accumulate(first.across.begin(), first.across.end(), 0.0);
  const double down_sum = std::accumulate(first.down.begin(), first.down.end(), 0.0);
  const double scale = 1.0 + (whole - kept_sum) / (across_sum * down_sum);
  for (float& tap : first.down) tap = static_cast<float>(scale * static_cast<double>(tap));
  // Take the memory.
  const std::size_t padded_width = part.width_px + 2 * std::size_t{radius_px_};
  const std::size_t padded_height = part.height_px + 2 * std::size_t{radius_px_};
  padded_.resize(padded_width * padded_height);
  across_.resize(part.width_px * padded_height);
  out_.resize(std::size_t{image.width_px} * image.height_px);
  if (veil_frac_ > 0.0F) column_sums_.resize(padded_width + 1);
}

void SpotFilter::pad(std::span<const float> image) noexcept {
  const std::size_t width = part_px_.width_px + 2 * std::size_t{radius_px_};
  const std::size_t height = part_px_.height_px + 2 * std::size_t{radius_px_};
  const std::size_t left = radius_px_ - (part_px_.x_px - reads_px_.x_px);
  const std::size_t top = radius_px_ - (part_px_.y_px - reads_px_.y_px);
  const std::size_t inner = reads_px_.width_px;
  for (std::size_t row = 0; row < height; ++row) {
    const std::size_t y = std::clamp(row, top, top + reads_px_.height_px - 1) - top;
    const float* const from =
        image.data() + (reads_px_.y_px + y) * image_.width_px + reads_px_.x_px;
    float* const to = padded_.data() + row * width;
    std::fill_n(to, left, from[0]);
    std::copy_n(from, inner, to + left);
    std::fill_n(to + left + inner, width - left - inner, from[inner - 1]);
  }
}

void SpotFilter::add_veil() noexcept {
  // Sums over columns of a band of rows move down with the pixel; sums over columns move right.
  const std::size_t width = part_px_.width_px + 2 * std::size_t{radius_px_};
  const std::size_t height = part_px_.height_px + 2 * std::size_t{radius_px_};
  const std::size_t reach = std::size_t{kVeilRadii} * radius_px_;
  const auto row_of = [&](std::size_t row) { return padded_.data() + row * width; };
  std::size_t first = 0;
  std::size_t end = 0;
  std::ranges::fill(column_sums_, 0.0);
  for (std::size_t y = 0; y < part_px_.height_px; ++y) {
    const std::size_t centre = y + radius_px_;
    const std::size_t want_first = centre > reach ? centre - reach : 0;
    const std::size_t want_end = std::min(centre + reach + 1, height);
    for (; end < want_end; ++end) {
      const float* const row = row_of(end);
      for (std::size_t x = 0; x < width; ++x) column_sums_[x] += static_cast<double>(row[x]);
    }
    for (; first < want_first; ++first) {
      const float* const row = row_of(first);
      for (std::size_t x = 0; x < width; ++x) column_sums_[x] -= static_cast<double>(row[x]);
    }
    float* const out = out_.data() + (part_px_.y_px + y) * image_.width_px + part_px_.x_px;
    double sum = 0.0;
    std::size_t left = 0;
    std::size_t right = 0;
    const double rows = static_cast<double>(want_end - want_first);
    for (std::size_t x = 0; x < part_px_.width_px; ++x) {
      const std::size_t at = x + radius_px_;
      const std::size_t want_left = at > reach ? at - reach : 0;
      const std::size_t want_right = std::min(at + reach + 1, width);
      for (; right < want_right; ++right) sum += column_sums_[right];
      for (; left < want_left; ++left) sum -= column_sums_[left];
      out[x] += veil_frac_ * static_cast<float>(sum / (rows * static_cast<double>(right - left)));
    }
  }
}

std::span<const float> SpotFilter::apply(std::span<const float> image) noexcept {
  EMIT_DCHECK_OP(image.size(), ==, out_.size());
  pad(image);
  const std::size_t width = part_px_.width_px;
  const std::size_t padded_width = width + 2 * std::size_t{radius_px_};
  const std::size_t padded_height = part_px_.height_px + 2 * std::size_t{radius_px_};
  const std::size_t taps = 2 * std::size_t{radius_px_} + 1;
  std::array<const float*, 2 * kMaxSpotRadiusPx + 1> rows{};
  for (std::size_t p = 0; p < products_.size(); ++p) {
    // Convolve along rows, then along columns.
    for (std::size_t row = 0; row < padded_height; ++row) {
      for (std::size_t k = 0; k < taps; ++k) rows[k] = padded_.data() + row * padded_width + k;
      add_rows(rows.data(), products_[p].across, false,
               std::span(across_).subspan(row * width, width));
    }
    for (std::size_t row = 0; row < part_px_.height_px; ++row) {
      for (std::size_t k = 0; k < taps; ++k) rows[k] = across_.data() + (row + k) * width;
      add_rows(
          rows.data(), products_[p].down, p != 0,
          std::span(out_).subspan((part_px_.y_px + row) * image_.width_px + part_px_.x_px, width));
    }
  }
  if (veil_frac_ > 0.0F) add_veil();
  return out_;
}

}  // namespace emit::server
