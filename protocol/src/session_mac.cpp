// SPDX-License-Identifier: Apache-2.0
#include <openssl/core_names.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/params.h>
#include <openssl/rand.h>

#include "emit/protocol/host_session.hpp"
#include "wire_bytes.hpp"

namespace emit::protocol {

namespace {

/// Deleter of OpenSSL's objects.
struct FreeMac {
  void operator()(EVP_MAC* mac) const noexcept { EVP_MAC_free(mac); }
  void operator()(EVP_MAC_CTX* context) const noexcept { EVP_MAC_CTX_free(context); }
};
using MacContext = std::unique_ptr<EVP_MAC_CTX, FreeMac>;

const unsigned char* raw(std::span<const std::byte> bytes) noexcept {
  return reinterpret_cast<const unsigned char*>(bytes.data());
}

/// Begins a MAC. The tag's length is one of BLAKE2b's parameters, so it has to be set before the
/// key.
bool start(EVP_MAC_CTX* context, const SessionKey& key, std::size_t tag_bytes) noexcept {
  const OSSL_PARAM parameters[] = {OSSL_PARAM_construct_size_t(OSSL_MAC_PARAM_SIZE, &tag_bytes),
                                   OSSL_PARAM_construct_end()};
  return EVP_MAC_init(context, raw(key), key.size(), parameters) == 1;
}

/// Ends a MAC and writes the tag. Returns false when the library failed.
bool finish(EVP_MAC_CTX* context, std::span<std::byte> tag) noexcept {
  std::size_t length = 0;
  return EVP_MAC_final(context, reinterpret_cast<unsigned char*>(tag.data()), &length,
                       tag.size()) == 1 &&
         length == tag.size();
}

}  // namespace

struct SessionMac::Impl {
  MacContext context;
  SessionKey key{};

  ~Impl() { OPENSSL_cleanse(key.data(), key.size()); }
  bool tag_of(std::span<const std::byte> bytes, std::span<std::byte> tag) noexcept {
    return start(context.get(), key, tag.size()) &&
           EVP_MAC_update(context.get(), raw(bytes), bytes.size()) == 1 &&
           finish(context.get(), tag);
  }
};

SessionMac::SessionMac(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
SessionMac::SessionMac(SessionMac&&) noexcept = default;
SessionMac& SessionMac::operator=(SessionMac&&) noexcept = default;
SessionMac::~SessionMac() = default;

physics::Result<SessionMac> SessionMac::create() {
  const std::unique_ptr<EVP_MAC, FreeMac> algorithm(
      EVP_MAC_fetch(nullptr, OSSL_MAC_NAME_BLAKE2BMAC, nullptr));
  auto impl = std::make_unique<Impl>();
  if (algorithm != nullptr) impl->context.reset(EVP_MAC_CTX_new(algorithm.get()));
  std::array<std::byte, kSessionTagBytes> probe;
  if (impl->context == nullptr || !impl->tag_of({}, probe)) {
    return physics::make_error(physics::ErrorCode::internal,
                               "the cryptographic library has no keyed BLAKE2b");
  }
  return SessionMac(std::move(impl));
}

void SessionMac::set_key(const SessionKey& key) noexcept {
  impl_->key = key;
}

std::span<const std::byte> SessionMac::seal(const SessionHeader& header, std::span<std::byte> space,
                                            std::size_t payload_bytes) noexcept {
  if (payload_bytes > kMaxSessionPayloadBytes ||
      space.size() < kSessionHeaderBytes + payload_bytes + kSessionTagBytes) {
    return {};
  }
  wire::put(space, 0, kSessionMagic);
  wire::put(space, 4, kSessionVersion);
  wire::put(space, 5, static_cast<std::uint8_t>(header.kind));
  wire::put(space, 6, std::uint16_t{0});
  wire::put(space, 8, header.key_id);
  wire::put(space, 16, header.session_id);
  wire::put(space, 24, header.counter);
  const std::size_t covered = kSessionHeaderBytes + payload_bytes;
  if (!impl_->tag_of(space.first(covered), space.subspan(covered, kSessionTagBytes))) return {};
  return space.first(covered + kSessionTagBytes);
}

bool SessionMac::tag(std::span<const std::byte> bytes,
                     std::span<std::byte, kSessionTagBytes> out) noexcept {
  return impl_->tag_of(bytes, out);
}

bool SessionMac::verify(std::span<const std::byte> datagram) noexcept {
  if (datagram.size() < kSessionHeaderBytes + kSessionTagBytes) return false;
  const std::size_t covered = datagram.size() - kSessionTagBytes;
  std::array<std::byte, kSessionTagBytes> tag;
  return impl_->tag_of(datagram.first(covered), tag) &&
         CRYPTO_memcmp(tag.data(), datagram.data() + covered, tag.size()) == 0;
}

SessionKey SessionMac::derive(std::string_view purpose,
                              std::span<const std::byte> context) noexcept {
  SessionKey out{};
  EVP_MAC_CTX* const mac = impl_->context.get();
  // A zero byte marks the end of the purpose, so that no two pairs of purpose and context give the
  // same bytes.
  constexpr unsigned char kEnd = 0;
  const bool made = start(mac, impl_->key, out.size()) &&
                    EVP_MAC_update(mac, reinterpret_cast<const unsigned char*>(purpose.data()),
                                   purpose.size()) == 1 &&
                    EVP_MAC_update(mac, &kEnd, 1) == 1 &&
                    EVP_MAC_update(mac, raw(context), context.size()) == 1 && finish(mac, out);
  // create() has shown that the algorithm works. If it fails all the same, a random key fits
  // nothing.
  if (!made) RAND_bytes(reinterpret_cast<unsigned char*>(out.data()), static_cast<int>(out.size()));
  return out;
}

}  // namespace emit::protocol
