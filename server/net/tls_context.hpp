// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <openssl/ssl.h>

#include <memory>
#include <string>

#include "net/tls_session.hpp"

/// OpenSSL's types, included by the tls_*.cpp alone.
namespace emit::server {

struct FreeTls {
  void operator()(SSL_CTX* context) const noexcept { SSL_CTX_free(context); }
  void operator()(SSL* ssl) const noexcept { SSL_free(ssl); }
};
using SslPointer = std::unique_ptr<SSL, FreeTls>;

struct TlsContext::Impl {
  std::unique_ptr<SSL_CTX, FreeTls> context;
  bool server = false;
};

/// The oldest entry of this thread's error queue, which it empties.
[[nodiscard]] std::string tls_error_text();

}  // namespace emit::server
