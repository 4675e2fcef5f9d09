// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/surface/emissivity_spectrum.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "../air_tables.hpp"
#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/numerics/gauss_rule.hpp"

namespace emit::physics {
namespace {

constexpr int kFoldPoints = 6;
/// Widest panel in x = c2 / (lambda T), and largest ratio of its wavelengths. Six points integrate
/// the product of spectrum, response and Planck's law over it to 1e-10.
constexpr double kFoldPanelWidth = 0.5;
constexpr double kFoldPanelRatio = 1.25;
/// The whole spectrum of a blackbody reaches from here to there in x; 5e-8 of it lie outside.
constexpr double kWholeLeastX = 0.01;
constexpr double kWholeGreatestX = 60.0;
/// Temperatures at which an emissivity is judged, evenly over their range.
constexpr int kJudged = 9;

double um_of(double per_cm) noexcept {
  return 1e4 / per_cm;
}

/// Returns the piece of the air's spectrum that has a wavelength, or their number.
std::size_t piece_at(double wavelength_um) noexcept {
  const auto pieces = air_tables::pieces();
  const double per_cm = 1e4 / wavelength_um;
  if (per_cm < pieces.front().from_per_cm || per_cm > pieces.back().to_per_cm) {
    return pieces.size();
  }
  const auto after = std::ranges::upper_bound(pieces, per_cm, {}, &air_tables::Piece::from_per_cm);
  return static_cast<std::size_t>(after - pieces.begin()) - 1;
}

double emissivity_at(std::span<const EmissivityPoint> spectrum, double wavelength_um) noexcept {
  const auto after =
      std::ranges::upper_bound(spectrum, wavelength_um, {}, &EmissivityPoint::wavelength_um);
  if (after == spectrum.begin()) return spectrum.front().emissivity_frac;
  if (after == spectrum.end()) return spectrum.back().emissivity_frac;
  const EmissivityPoint& low = *(after - 1);
  return std::lerp(
      low.emissivity_frac, after->emissivity_frac,
      (wavelength_um - low.wavelength_um) / (after->wavelength_um - low.wavelength_um));
}

}  // namespace

SpectralAir::SpectralAir(const AirPath& path) {
  for (const air_tables::Piece& piece : air_tables::pieces()) {
    double passed = 0.0;
    for (std::size_t t = 0; t < air_tables::kPieceTerms; ++t) {
      double depth = 0.0;
      for (std::size_t i = 0; i < path.size(); ++i) {
        depth += std::inner_product(piece.extinction[t].begin(), piece.extinction[t].end(),
                                    path[i].amount.begin(), 0.0);
      }
      passed += piece.weight[t] * std::exp(-depth);
    }
    // The printed weights add up to 1 but for rounding.
    by_piece_.push_back(passed / std::accumulate(piece.weight.begin(), piece.weight.end(), 0.0));
  }
}

double SpectralAir::transmittance_frac(double wavelength_um) const noexcept {
  const std::size_t piece = piece_at(wavelength_um);
  return piece < by_piece_.size() ? by_piece_[piece] : 1.0;
}

SpectralAir SpectralAir::behind(const SpectralAir& other) const {
  if (by_piece_.empty()) return other;
  SpectralAir out = *this;
  for (std::size_t i = 0; i < other.by_piece_.size(); ++i) out.by_piece_[i] *= other.by_piece_[i];
  return out;
}

EmissivityFold::EmissivityFold(std::span<const EmissivityPoint> spectrum, const Band& band,
                               Kelvin coldest) {
  EMIT_CHECK(!spectrum.empty());
  // Cut the band wherever spectrum, response or air have a bend or a step.
  std::vector<double> cuts{band.lo_um, band.hi_um};
  for (const EmissivityPoint& point : spectrum) cuts.push_back(point.wavelength_um);
  for (const ResponsePoint& point : band.response) cuts.push_back(point.wavelength_um);
  for (const air_tables::Piece& piece : air_tables::pieces()) {
    cuts.push_back(um_of(piece.from_per_cm));
    cuts.push_back(um_of(piece.to_per_cm));
  }
  std::ranges::sort(cuts);
  for (std::size_t i = 1; i < cuts.size(); ++i) {
    const double lo_um = std::max(cuts[i - 1], band.lo_um);
    const double hi_um = std::min(cuts[i], band.hi_um);
    if (lo_um < hi_um) add_panels(spectrum, band, lo_um, hi_um, coldest.value());
  }
}

void EmissivityFold::add_panels(std::span<const EmissivityPoint> spectrum, const Band& band,
                                double lo_um, double hi_um, double coldest_k) {
  // A stretch that only rounding makes has no middle to ask for.
  if (!(hi_um > lo_um * (1.0 + 1e-12))) return;
  static const GaussRule<kFoldPoints> rule = gauss_legendre<kFoldPoints>();
  const double from = 1.0 / hi_um;
  const double to = 1.0 / lo_um;
  const int panels =
      static_cast<int>(std::ceil(std::max(kC2UmK / coldest_k * (to - from) / kFoldPanelWidth,
                                          std::log(hi_um / lo_um) / std::log(kFoldPanelRatio))));
  const std::size_t piece = piece_at(2.0 / (from + to));
  const double half = 0.5 * (to - from) / panels;
  for (int panel = 0; panel < panels; ++panel) {
    for (std::size_t i = 0; i < kFoldPoints; ++i) {
      // Planck's law by wavelength turns into one by its inverse: dl = du / u^2.
      const double u = from + half * (2 * panel + 1 + rule.node[i]);
      const double um = 1.0 / u;
      const double weight =
          response_frac(band, um) * kRadianceC1WUm4PerM2Sr * u * u * u * half * rule.weight[i];
      if (!(weight > 0.0)) continue;
      nodes_.push_back({um, weight, emissivity_at(spectrum, um),
                        piece < air_tables::pieces().size() ? piece : kNoPiece,
                        um < spectrum.front().wavelength_um || um > spectrum.back().wavelength_um});
    }
  }
}

EmissivityFold::Sums EmissivityFold::sums(double source_k, const SpectralAir& air) const noexcept {
  const std::span<const double> passed = air.pieces();
  Sums out;
  for (const Node& node : nodes_) {
    const double x = kC2UmK / (node.wavelength_um * source_k);
    const double decay = -std::expm1(-x);
    double black = node.weight * std::exp(-x) / decay;
    if (!passed.empty() && node.piece != kNoPiece) black *= passed[node.piece];
    out.black += black;
    out.slope_per_k += black * x / (decay * source_k);
    out.emitted += black * node.emissivity_frac;
    if (node.beyond) out.beyond += black;
  }
  return out;
}

EmissivityFold::Folded EmissivityFold::at(Kelvin source, const SpectralAir& air) const noexcept {
  const Sums all = sums(source.value(), air);
  if (!(all.black > 0.0)) return {};
  return {all.emitted / all.black, all.beyond / all.black};
}

double EmissivityFold::black_w_m2_sr(Kelvin source, const SpectralAir& air) const noexcept {
  return sums(source.value(), air).black;
}

Kelvin EmissivityFold::apparent(double radiance_w_m2_sr, Kelvin near) const noexcept {
  if (!(radiance_w_m2_sr > 0.0)) return Kelvin(0.0);
  // The logarithm of the radiance is nearly straight over 1/T.
  double kelvin = near.value();
  for (int i = 0; i < 30; ++i) {
    const Sums now = sums(kelvin, {});
    if (!(now.black > 0.0 && now.slope_per_k > 0.0)) break;
    const double miss = std::log(now.black / radiance_w_m2_sr);
    const double step = miss * now.black / (kelvin * kelvin * now.slope_per_k);
    const double next = 1.0 / std::clamp(1.0 / kelvin + step, 0.5 / kelvin, 2.0 / kelvin);
    const bool close = std::abs(next - kelvin) < 1e-7 * kelvin;
    kelvin = next;
    if (close) break;
  }
  return Kelvin(kelvin);
}

EmissivityFold::Folded total_emissivity(std::span<const EmissivityPoint> spectrum,
                                        Kelvin temperature) {
  const double um = kC2UmK / temperature.value();
  return EmissivityFold(spectrum, {um / kWholeGreatestX, um / kWholeLeastX, {}}, temperature)
      .at(temperature);
}

EmissivityErrors emissivity_errors(const EmissivityFold& fold, double emissivity_frac,
                                   const JudgedRange& range, const JudgedAir& air) {
  // Temperatures that a picture shows with the spectrum and without it, where the surface also
  // reflects light. The air in between is as warm as the surface.
  const auto apart_k = [&](Kelvin surface, const SpectralAir& seen_through, double true_frac,
                           double true_reflected, double reflected) {
    const double black = fold.black_w_m2_sr(surface, seen_through);
    const double path = fold.black_w_m2_sr(surface) - black;
    const double truth = fold.apparent(true_frac * black + true_reflected + path, surface).value();
    const double given = fold.apparent(emissivity_frac * black + reflected + path, surface).value();
    return std::abs(given - truth);
  };
  const auto emission_k = [&](Kelvin surface, const SpectralAir& seen_through) {
    return apart_k(surface, seen_through, fold.at(surface, seen_through).emissivity_frac, 0.0, 0.0);
  };
  EmissivityErrors out;
  for (int i = 0; i < kJudged; ++i) {
    const Kelvin surface(std::lerp(range.least.value(), range.greatest.value(),
                                   static_cast<double>(i) / (kJudged - 1)));
    const double folded_k = emission_k(surface, air.folded);
    out.temperature_k = std::max(out.temperature_k, folded_k);
    out.largest_k = std::max(
        {out.largest_k, folded_k, emission_k(surface, {}), emission_k(surface, air.longest)});
    if (range.least.value() == range.greatest.value()) break;
  }
  out.air_k = std::max(emission_k(range.reference, {}), emission_k(range.reference, air.longest));
  out.largest_k = std::max(out.largest_k, out.air_k);
  // Reflected sunlight: irradiance by pi, through the same air as the emission.
  const Kelvin sun(kSunTemperatureK);
  const double sine = std::sin(kSunSemiAngleRad);
  const SpectralAir sunny = air.sun.behind(air.folded);
  const double sunlight = sine * sine * fold.black_w_m2_sr(sun, sunny);
  const double true_frac = fold.at(sun, sunny).emissivity_frac;
  out.sunlight_k = apart_k(range.reference, air.folded, emissivity_frac,
                           (1.0 - true_frac) * sunlight, (1.0 - emissivity_frac) * sunlight);
  return out;
}

}  // namespace emit::physics
