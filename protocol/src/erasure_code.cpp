// SPDX-License-Identifier: Apache-2.0
#include "erasure_code.hpp"

#include <isa-l/erasure_code.h>

#include "emit/physics/check.hpp"

namespace emit::protocol::erasure {
namespace {

/// First row number of the parity. No row number equals a column number, as a Cauchy matrix
/// requires.
constexpr std::uint32_t kFirstRow = 128;

}  // namespace

std::uint8_t coefficient(std::uint32_t parity, std::uint32_t data) noexcept {
  EMIT_DCHECK_OP(parity, <, kFirstRow);
  EMIT_DCHECK_OP(data, <, kFirstRow);
  return ::gf_inv(static_cast<unsigned char>((kFirstRow + parity) ^ data));
}

std::uint8_t multiply(std::uint8_t a, std::uint8_t b) noexcept {
  return ::gf_mul(a, b);
}

bool invert(std::span<std::uint8_t> in, std::span<std::uint8_t> out, std::uint32_t n) noexcept {
  return ::gf_invert_matrix(in.data(), out.data(), static_cast<int>(n)) == 0;
}

void expand(std::span<const std::uint8_t> coefficients, std::uint32_t rows, std::uint32_t columns,
            std::span<std::uint8_t> tables) noexcept {
  // ISA-L only reads its inputs, here and in combine(), but its interface is not const.
  ::ec_init_tables(static_cast<int>(columns), static_cast<int>(rows),
                   const_cast<std::uint8_t*>(coefficients.data()), tables.data());
}

void combine(std::size_t bytes, std::span<const std::uint8_t> tables,
             std::span<const std::byte* const> in, std::span<std::byte* const> out) noexcept {
  ::ec_encode_data(static_cast<int>(bytes), static_cast<int>(in.size()),
                   static_cast<int>(out.size()), const_cast<std::uint8_t*>(tables.data()),
                   reinterpret_cast<unsigned char**>(const_cast<std::byte**>(in.data())),
                   reinterpret_cast<unsigned char**>(const_cast<std::byte**>(out.data())));
}

}  // namespace emit::protocol::erasure
