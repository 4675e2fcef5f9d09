// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "net/io_result.hpp"

/// TLS 1.3 with certificates on both sides, over a connected non-blocking descriptor. OpenSSL's
/// headers stay in the .cpp files.
namespace emit::server {

struct TlsFiles {
  std::filesystem::path ca;           ///< PEM: who signs the other side's certificates
  std::filesystem::path certificate;  ///< PEM, chain behind it
  std::filesystem::path key;          ///< PEM, not readable by others
};

/// Certificates, key and rules of one side; many sessions. Thread: any, after construction.
class TlsContext {
 public:
  /// Errors (config), naming file and reason.
  [[nodiscard]] static physics::Result<TlsContext> server(const TlsFiles& files);
  [[nodiscard]] static physics::Result<TlsContext> client(const TlsFiles& files);

  struct Impl;
  [[nodiscard]] const std::shared_ptr<Impl>& get() const noexcept { return impl_; }

 private:
  [[nodiscard]] static physics::Result<TlsContext> make(const TlsFiles& files, bool server);
  explicit TlsContext(std::shared_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
  std::shared_ptr<Impl> impl_;
};

/// One connection's session. Two threads may use it, one reading and one writing: whoever comes
/// while the other is inside is told `busy` and tries again soon; nobody waits. A turn holds it for
/// one TLS record (16 KiB), tens of microseconds.
/// Real time: reading and writing never wait, but OpenSSL takes two small blocks of heap memory for
/// every record: connections that must not allocate are plain ones.
class TlsSession {
 public:
  /// `name`: client only, the name or address that the server's certificate must bear.
  /// Errors (io). The descriptor stays the caller's and must outlive the session.
  [[nodiscard]] static physics::Result<std::unique_ptr<TlsSession>> create(
      const TlsContext& context, int fd, const std::string& name);
  /// Says goodbye to the peer if it still can, without waiting.
  ~TlsSession();
  TlsSession(const TlsSession&) = delete;
  TlsSession& operator=(const TlsSession&) = delete;

  /// Goes on as far as it can. done: both sides have proved who they are.
  [[nodiscard]] IoResult handshake() noexcept;
  [[nodiscard]] bool established() const noexcept;
  /// The handshake waits until the descriptor takes bytes, not until it has some.
  [[nodiscard]] bool wants_write() const noexcept;
  /// Why a handshake or a call failed; for the log.
  [[nodiscard]] std::string error() const;

  [[nodiscard]] IoResult read(std::span<std::byte> space) noexcept;
  /// Up to a few records. After would_block or busy the bytes that did not count have to be offered
  /// again; pieces may be cut otherwise and lie elsewhere.
  [[nodiscard]] IoResult write(std::span<const std::span<const std::byte>> pieces) noexcept;
  /// Bytes lie decrypted in the session: the descriptor will not announce them.
  [[nodiscard]] bool has_buffered() noexcept;
  void shutdown() noexcept;

  /// Subject CN and DNS names of the peer's certificate.
  [[nodiscard]] std::vector<std::string> peer_names() const;
  /// Keying material that both sides know and nobody else (RFC 8446 section 7.5).
  /// False: not established.
  [[nodiscard]] bool export_key(std::span<std::byte> out) const noexcept;

 private:
  struct Impl;
  explicit TlsSession(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// A file that holds a secret. Errors (config), naming it: not there, readable by others.
[[nodiscard]] physics::Result<void> check_secret_file(const std::filesystem::path& file);
/// Its contents, at most 64 KiB.
[[nodiscard]] physics::Result<std::string> read_secret_file(const std::filesystem::path& file);

}  // namespace emit::server
