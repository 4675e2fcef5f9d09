// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <memory>
#include <span>
#include <string>

// OpenSSL's digest context; only sha256.cpp includes OpenSSL.
struct evp_md_ctx_st;

namespace emit::server {

/// SHA-256 (FIPS 180-4) of bytes that come in parts. It distinguishes scenarios. OpenSSL computes
/// it.
class Sha256 {
 public:
  Sha256();
  void update(std::span<const std::byte> bytes) noexcept;
  /// Returns the digest as 64 lower-case hexadecimal digits.
  /// @pre finish() was not called before.
  [[nodiscard]] std::string finish();

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const noexcept;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

}  // namespace emit::server
