// SPDX-License-Identifier: Apache-2.0
#include "net/tls_session.hpp"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <mutex>

#include "net/tls_context.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Largest payload of a TLS record, and of one call of write.
constexpr std::size_t kRecordBytes = 16'384;
constexpr std::size_t kMaxWriteBytes = 128u << 10;
constexpr std::string_view kExporterLabel = "EXPORTER-emitd-host-datagrams";

int descriptor_of(BIO* bio) noexcept {
  return static_cast<int>(reinterpret_cast<std::intptr_t>(BIO_get_data(bio)));
}

/// OpenSSL's own socket BIO raises SIGPIPE.
int bio_write(BIO* bio, const char* data, int length) noexcept {
  BIO_clear_retry_flags(bio);
  const ssize_t sent = ::send(descriptor_of(bio), data, static_cast<std::size_t>(length),
                              MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) {
    BIO_set_retry_write(bio);
  }
  return static_cast<int>(sent);
}

int bio_read(BIO* bio, char* space, int length) noexcept {
  BIO_clear_retry_flags(bio);
  const ssize_t got =
      ::recv(descriptor_of(bio), space, static_cast<std::size_t>(length), MSG_DONTWAIT);
  if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) {
    BIO_set_retry_read(bio);
  }
  return static_cast<int>(got);
}

long bio_control(BIO* /*bio*/, int command, long /*number*/, void* /*pointer*/) noexcept {
  return command == BIO_CTRL_FLUSH || command == BIO_CTRL_PUSH || command == BIO_CTRL_POP ? 1 : 0;
}

const BIO_METHOD* descriptor_method() noexcept {
  static BIO_METHOD* const method = [] {
    BIO_METHOD* made = BIO_meth_new(BIO_get_new_index() | BIO_TYPE_SOURCE_SINK, "emitd descriptor");
    if (made != nullptr) {
      BIO_meth_set_write(made, bio_write);
      BIO_meth_set_read(made, bio_read);
      BIO_meth_set_ctrl(made, bio_control);
      BIO_meth_set_create(made, [](BIO* bio) {
        BIO_set_init(bio, 1);
        return 1;
      });
    }
    return made;
  }();
  return method;
}

/// Walks along pieces as if they were one.
class PieceReader {
 public:
  explicit PieceReader(std::span<const std::span<const std::byte>> pieces) noexcept
      : pieces_(pieces) {}
  /// Copies as many bytes as there are and fit.
  std::size_t copy(std::span<std::byte> space) noexcept {
    return walk(space.size(), [&](std::span<const std::byte> part, std::size_t done) {
      std::copy(part.begin(), part.end(), space.begin() + static_cast<std::ptrdiff_t>(done));
    });
  }
  std::size_t skip(std::size_t count) noexcept {
    return walk(count, [](std::span<const std::byte>, std::size_t) {});
  }

 private:
  template <class Take>
  std::size_t walk(std::size_t most, const Take& take) noexcept {
    std::size_t done = 0;
    while (done < most && !pieces_.empty()) {
      const std::size_t length = std::min(pieces_.front().size() - offset_, most - done);
      take(pieces_.front().subspan(offset_, length), done);
      done += length;
      offset_ += length;
      if (offset_ == pieces_.front().size()) {
        pieces_ = pieces_.subspan(1);
        offset_ = 0;
      }
    }
    return done;
  }

  std::span<const std::span<const std::byte>> pieces_;
  std::size_t offset_ = 0;
};

}  // namespace

struct TlsSession::Impl {
  std::shared_ptr<TlsContext::Impl> context;  // outlives the session
  SslPointer ssl;
  std::mutex mutex;
  std::atomic<bool> established{false};
  std::atomic<bool> broken{false};  ///< OpenSSL allows no further call that writes
  bool wants_write = false;
  std::array<std::byte, kRecordBytes> record;  ///< being written
  std::size_t unfinished_bytes = 0;            ///< of it, when the descriptor was full
  std::string error;

  /// Turns the outcome of an SSL call that returned <= 0 into a result.
  IoResult outcome(int returned, bool writing) noexcept {
    const int reason = SSL_get_error(ssl.get(), returned);
    switch (reason) {
      case SSL_ERROR_WANT_READ:
        wants_write = false;
        // A write cannot wait for the peer in TLS 1.3, except behind the reader's back.
        return {writing ? IoStatus::busy : IoStatus::would_block, 0, 0};
      case SSL_ERROR_WANT_WRITE:
        wants_write = true;
        return {IoStatus::would_block, 0, 0};
      case SSL_ERROR_ZERO_RETURN:
        return {IoStatus::closed, 0, 0};
      default:
        break;
    }
    const int system_error = reason == SSL_ERROR_SYSCALL && errno != 0 ? errno : EPROTO;
    broken.store(true, std::memory_order_relaxed);
    return {IoStatus::failed, 0, system_error};
  }
};

TlsSession::TlsSession(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

TlsSession::~TlsSession() {
  shutdown();
}

physics::Result<std::unique_ptr<TlsSession>> TlsSession::create(const TlsContext& context, int fd,
                                                                const std::string& name) {
  const auto failed = [] { return make_error(ErrorCode::io, "tls: " + tls_error_text()); };
  auto impl = std::make_unique<Impl>();
  impl->context = context.get();
  impl->ssl.reset(SSL_new(context.get()->context.get()));
  BIO* bio = descriptor_method() != nullptr ? BIO_new(descriptor_method()) : nullptr;
  if (impl->ssl == nullptr || bio == nullptr) {
    BIO_free(bio);
    return failed();
  }
  BIO_set_data(bio, reinterpret_cast<void*>(static_cast<std::intptr_t>(fd)));
  SSL_set_bio(impl->ssl.get(), bio, bio);
  if (context.get()->server) {
    SSL_set_accept_state(impl->ssl.get());
  } else {
    X509_VERIFY_PARAM* rules = SSL_get0_param(impl->ssl.get());
    X509_VERIFY_PARAM_set_hostflags(rules, X509_CHECK_FLAG_NO_PARTIAL_WILDCARDS);
    // An address is checked against addresses in the certificate, all else against names.
    if (X509_VERIFY_PARAM_set1_ip_asc(rules, name.c_str()) != 1 &&
        (X509_VERIFY_PARAM_set1_host(rules, name.c_str(), 0) != 1 ||
         // This is the macro SSL_set_tlsext_host_name() without its cast.
         SSL_ctrl(impl->ssl.get(), SSL_CTRL_SET_TLSEXT_HOSTNAME, TLSEXT_NAMETYPE_host_name,
                  const_cast<char*>(name.c_str())) != 1)) {
      return failed();
    }
    ERR_clear_error();
    SSL_set_connect_state(impl->ssl.get());
  }
  return std::unique_ptr<TlsSession>(new TlsSession(std::move(impl)));
}

IoResult TlsSession::handshake() noexcept {
  const std::unique_lock lock(impl_->mutex, std::try_to_lock);
  if (!lock.owns_lock()) return {IoStatus::busy, 0, 0};
  ERR_clear_error();
  errno = 0;
  const int returned = SSL_do_handshake(impl_->ssl.get());
  if (returned == 1) {
    impl_->wants_write = false;
    impl_->established.store(true, std::memory_order_release);
    return {IoStatus::done, 0, 0};
  }
  const IoResult result = impl_->outcome(returned, false);
  if (result.status == IoStatus::failed) {
    const long verdict = SSL_get_verify_result(impl_->ssl.get());
    impl_->error = verdict != X509_V_OK    ? X509_verify_cert_error_string(verdict)
                   : ERR_peek_error() != 0 ? tls_error_text()
                                           : "the peer hung up";
  }
  return result;
}

bool TlsSession::established() const noexcept {
  return impl_->established.load(std::memory_order_acquire);
}

bool TlsSession::wants_write() const noexcept {
  return !established() && impl_->wants_write;
}

std::string TlsSession::error() const {
  return impl_->error;
}

IoResult TlsSession::read(std::span<std::byte> space) noexcept {
  const std::unique_lock lock(impl_->mutex, std::try_to_lock);
  if (!lock.owns_lock()) return {IoStatus::busy, 0, 0};
  ERR_clear_error();
  errno = 0;
  std::size_t bytes = 0;
  const int returned = SSL_read_ex(impl_->ssl.get(), space.data(), space.size(), &bytes);
  return returned == 1 ? IoResult{IoStatus::done, bytes, 0} : impl_->outcome(returned, false);
}

IoResult TlsSession::write(std::span<const std::span<const std::byte>> pieces) noexcept {
  PieceReader from(pieces);
  std::size_t total = 0;
  while (total < kMaxWriteBytes) {
    // Lock for one record at a time: the reader gets its turn in between.
    const std::unique_lock lock(impl_->mutex, std::try_to_lock);
    IoResult result{IoStatus::busy, 0, 0};
    if (lock.owns_lock()) {
      // A record that met a full descriptor is offered again by the caller, perhaps cut otherwise.
      const std::size_t length = impl_->unfinished_bytes != 0 ? from.skip(impl_->unfinished_bytes)
                                                              : from.copy(impl_->record);
      if (length < impl_->unfinished_bytes) return {IoStatus::failed, 0, EPROTO};
      if (length == 0) return {IoStatus::done, total, 0};
      ERR_clear_error();
      errno = 0;
      std::size_t bytes = 0;
      const int returned = SSL_write_ex(impl_->ssl.get(), impl_->record.data(), length, &bytes);
      if (returned == 1) {
        impl_->unfinished_bytes = 0;
        total += bytes;
        continue;
      }
      result = impl_->outcome(returned, true);
      impl_->unfinished_bytes = length;
    }
    // Bytes that were sent count. The caller meets the obstacle again when it goes on.
    return total > 0 && result.status != IoStatus::failed ? IoResult{IoStatus::done, total, 0}
                                                          : result;
  }
  return {IoStatus::done, total, 0};
}

bool TlsSession::has_buffered() noexcept {
  const std::unique_lock lock(impl_->mutex, std::try_to_lock);
  // Not known while the other thread is inside: looking again costs nothing.
  return !lock.owns_lock() || SSL_has_pending(impl_->ssl.get()) == 1;
}

void TlsSession::shutdown() noexcept {
  const std::unique_lock lock(impl_->mutex, std::try_to_lock);
  if (lock.owns_lock() && established() && !impl_->broken.load(std::memory_order_relaxed) &&
      impl_->unfinished_bytes == 0) {
    ERR_clear_error();
    SSL_shutdown(impl_->ssl.get());
  }
}

std::vector<std::string> TlsSession::peer_names() const {
  std::vector<std::string> names;
  const auto add = [&names](const ASN1_STRING* text) {
    unsigned char* utf8 = nullptr;
    const int length = ASN1_STRING_to_UTF8(&utf8, text);
    if (length < 0) return;
    names.emplace_back(reinterpret_cast<const char*>(utf8), static_cast<std::size_t>(length));
    OPENSSL_free(utf8);
  };
  X509* certificate = SSL_get0_peer_certificate(impl_->ssl.get());
  if (certificate == nullptr) return names;
  const X509_NAME* subject = X509_get_subject_name(certificate);
  for (int at = -1; (at = X509_NAME_get_index_by_NID(subject, NID_commonName, at)) >= 0;) {
    add(X509_NAME_ENTRY_get_data(X509_NAME_get_entry(subject, at)));
  }
  auto* alternatives = static_cast<GENERAL_NAMES*>(
      X509_get_ext_d2i(certificate, NID_subject_alt_name, nullptr, nullptr));
  for (int i = 0; i < sk_GENERAL_NAME_num(alternatives); ++i) {
    const GENERAL_NAME* name = sk_GENERAL_NAME_value(alternatives, i);
    if (name->type == GEN_DNS) add(name->d.dNSName);
  }
  GENERAL_NAMES_free(alternatives);
  return names;
}

bool TlsSession::export_key(std::span<std::byte> out) const noexcept {
  return established() &&
         SSL_export_keying_material(impl_->ssl.get(), reinterpret_cast<unsigned char*>(out.data()),
                                    out.size(), kExporterLabel.data(), kExporterLabel.size(),
                                    nullptr, 0, 0) == 1;
}

}  // namespace emit::server
