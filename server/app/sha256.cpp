// SPDX-License-Identifier: Apache-2.0
#include "app/sha256.hpp"

#include <openssl/evp.h>

#include <array>

#include "emit/physics/check.hpp"

namespace emit::server {

void Sha256::Free::operator()(evp_md_ctx_st* context) const noexcept {
  EVP_MD_CTX_free(context);
}

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
  EMIT_CHECK(context_ != nullptr);
  EMIT_CHECK(EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) == 1);
}

void Sha256::update(std::span<const std::byte> bytes) noexcept {
  EMIT_CHECK(context_ != nullptr);
  EMIT_CHECK(EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()) == 1);
}

std::string Sha256::finish() {
  EMIT_CHECK(context_ != nullptr);
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int bytes = 0;
  EMIT_CHECK(EVP_DigestFinal_ex(context_.get(), digest.data(), &bytes) == 1);
  context_.reset();
  constexpr char kDigits[] = "0123456789abcdef";
  std::string hex;
  for (unsigned int i = 0; i < bytes; ++i) {
    hex.push_back(kDigits[digest[i] >> 4U]);
    hex.push_back(kDigits[digest[i] & 0xFU]);
  }
  return hex;
}

}  // namespace emit::server
