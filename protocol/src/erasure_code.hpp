// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

/// Arithmetic of the erasure code, by Intel's ISA-L: GF(2^8) with the polynomial x^8 + x^4 + x^3 +
/// x^2 + 1. Parity p of a group is the sum over its fragments j of coefficient(p, j) times fragment
/// j, byte by byte. The coefficients form a Cauchy matrix. Every square part of it can be inverted,
/// so any loss of up to m fragments can be repaired. All functions are RT-safe.
namespace emit::protocol::erasure {

/// Length of ISA-L's expanded form of one coefficient, bytes.
inline constexpr std::size_t kTableBytes = 32;

/// Returns the coefficient of a data fragment in a parity fragment.
/// @pre parity < 128 && data < 128
[[nodiscard]] std::uint8_t coefficient(std::uint32_t parity, std::uint32_t data) noexcept;
/// Returns the product of two elements of the field.
[[nodiscard]] std::uint8_t multiply(std::uint8_t a, std::uint8_t b) noexcept;
/// Inverts an n x n matrix, row-major. `in` is overwritten. Returns false when the matrix is
/// singular.
[[nodiscard]] bool invert(std::span<std::uint8_t> in, std::span<std::uint8_t> out,
                          std::uint32_t n) noexcept;
/// Expands rows x columns coefficients into tables of kTableBytes each.
void expand(std::span<const std::uint8_t> coefficients, std::uint32_t rows, std::uint32_t columns,
            std::span<std::uint8_t> tables) noexcept;
/// Computes out[r] = sum over c of coefficients[r][c] * in[c]. Every input and output is `bytes`
/// long.
void combine(std::size_t bytes, std::span<const std::uint8_t> tables,
             std::span<const std::byte* const> in, std::span<std::byte* const> out) noexcept;

}  // namespace emit::protocol::erasure
