// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <optional>
#include <span>
#include <string_view>

#include "emit/physics/air_model.hpp"

/// Numbers of the air model (air_tables.cpp, air_spectrum.cpp).
namespace emit::physics::air_tables {

/// Air of one climate at one height.
struct Level {
  double height_km;
  double pressure_hpa;
  double kelvin;
  double vapour_g_m3;
  double ozone_atm_cm_km;
};
inline constexpr std::size_t kLevels = 33;
/// Returns the levels of a climate, from the ground upwards.
[[nodiscard]] std::span<const Level, kLevels> levels(AirClimate climate) noexcept;

inline constexpr std::size_t kBandTerms = 10;
/// Temperatures at which the weights of the thermal emission are given, K.
inline constexpr std::array<double, 8> kEmissionK{180, 200, 220, 240, 260, 280, 300, 330};

/// Terms of a band that were fitted to it alone. Extinction is by unit of the absorbers' density
/// (km of path).
struct BandTerms {
  std::string_view name;
  double lo_um;
  double hi_um;
  double sun_w_m2;  ///< outside the atmosphere at 1 au, LOWTRAN7's spectrum
  std::array<std::array<double, kAirAbsorbers>, kBandTerms> extinction;
  std::array<std::array<double, kBandTerms>, kAirSources> weight;
  std::array<std::array<double, kBandTerms>, kEmissionK.size()> emission_weight;
};
/// Returns the bands with terms of their own, flat within their limits.
[[nodiscard]] std::span<const BandTerms> bands() noexcept;

inline constexpr std::size_t kPieceTerms = 4;
/// Terms of a piece of the spectrum, with extinction likewise.
struct Piece {
  double from_per_cm;  ///< wavenumber
  double to_per_cm;
  double sun_w_m2_cm;  ///< sunlight outside the atmosphere at 1 au, by wavenumber
  std::array<double, kPieceTerms> weight;
  std::array<std::array<double, kAirAbsorbers>, kPieceTerms> extinction;
};
/// Returns the pieces in the order of wavenumber. They cover it without gaps.
[[nodiscard]] std::span<const Piece> pieces() noexcept;
/// Returns the part of a band that lies in a piece; empty where the response is zero there.
[[nodiscard]] std::optional<Band> part_of(const Band& band, const Piece& piece);

/// Integrals of a band's response over wavelength, um, and over wavenumber, cm-1.
struct Response {
  double over_um = 0.0;
  double over_per_cm = 0.0;
};
/// Returns the integrals over a part of a band that is as narrow as a piece.
[[nodiscard]] Response integrate_response(const Band& part);

}  // namespace emit::physics::air_tables
