// SPDX-License-Identifier: Apache-2.0
#include "net/tls_context.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/err.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <system_error>

#include "net/socket_address.hpp"
#include "rt/error_text.hpp"
#include "rt/fd.hpp"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;

namespace {

auto failure(const std::filesystem::path& file, std::string_view why) {
  return make_error(ErrorCode::config, fmt::format("{}: {}", file.string(), why));
}

physics::Result<Fd> open_secret(const std::filesystem::path& file) {
  Fd fd(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (!fd || ::fstat(fd.get(), &status) != 0) return failure(file, error_text(errno));
  if (!S_ISREG(status.st_mode)) return failure(file, "not a file");
  if ((status.st_mode & S_IRWXO) != 0) {
    return failure(file, fmt::format("open to others (mode {:04o}): a secret; chmod o= {}",
                                     status.st_mode & 07777U, file.string()));
  }
  return fd;
}

}  // namespace

std::string tls_error_text() {
  const unsigned long code = ERR_get_error();
  ERR_clear_error();
  // OpenSSL has no text for an error of the system.
  if (ERR_SYSTEM_ERROR(code)) return std::generic_category().message(ERR_GET_REASON(code));
  const char* reason = code != 0 ? ERR_reason_error_string(code) : nullptr;
  return reason != nullptr ? reason : fmt::format("error {:08x}", code);
}

physics::Result<void> check_secret_file(const std::filesystem::path& file) {
  auto fd = open_secret(file);
  if (!fd) return tl::unexpected(std::move(fd.error()));
  return {};
}

physics::Result<std::string> read_secret_file(const std::filesystem::path& file) {
  auto fd = open_secret(file);
  if (!fd) return tl::unexpected(std::move(fd.error()));
  constexpr std::size_t kMaxBytes = 64u << 10;
  std::string text;
  std::array<char, 4096> piece;
  for (;;) {
    const ssize_t got = ::read(fd->get(), piece.data(), piece.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return failure(file, error_text(errno));
    if (got == 0) return text;
    text.append(piece.data(), static_cast<std::size_t>(got));
    if (text.size() > kMaxBytes) return failure(file, "longer than 64 KiB");
  }
}

physics::Result<TlsContext> TlsContext::make(const TlsFiles& files, bool server) {
  if (auto sound = check_secret_file(files.key); !sound) {
    return tl::unexpected(std::move(sound.error()));
  }
  ERR_clear_error();
  auto impl = std::make_shared<Impl>();
  impl->server = server;
  impl->context.reset(SSL_CTX_new(server ? TLS_server_method() : TLS_client_method()));
  SSL_CTX* context = impl->context.get();
  if (context == nullptr || SSL_CTX_set_min_proto_version(context, TLS1_3_VERSION) != 1 ||
      SSL_CTX_set_max_proto_version(context, TLS1_3_VERSION) != 1) {
    return make_error(ErrorCode::internal, "TLS 1.3: " + tls_error_text());
  }
  if (SSL_CTX_use_certificate_chain_file(context, files.certificate.c_str()) != 1) {
    return failure(files.certificate, tls_error_text());
  }
  if (SSL_CTX_use_PrivateKey_file(context, files.key.c_str(), SSL_FILETYPE_PEM) != 1) {
    return failure(files.key, tls_error_text());
  }
  if (SSL_CTX_load_verify_locations(context, files.ca.c_str(), nullptr) != 1) {
    return failure(files.ca, tls_error_text());
  }
  SSL_CTX_set_verify(context, SSL_VERIFY_PEER | SSL_VERIFY_FAIL_IF_NO_PEER_CERT, nullptr);
  // Neither side may carry a session over to another connection: every one proves itself anew.
  SSL_CTX_set_num_tickets(context, 0);
  SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_OFF);
  return TlsContext(std::move(impl));
}

physics::Result<TlsContext> TlsContext::server(const TlsFiles& files) {
  return make(files, true);
}

physics::Result<TlsContext> TlsContext::client(const TlsFiles& files) {
  return make(files, false);
}

}  // namespace emit::server
