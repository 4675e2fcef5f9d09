// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <string>

namespace emit::client {

/// Files with which a client proves its identity and checks the daemon's. Empty: neither.
struct Security {
  std::filesystem::path tls_ca;           ///< PEM: signs the daemon's certificate
  std::filesystem::path tls_certificate;  ///< PEM, this client's
  std::filesystem::path tls_key;          ///< PEM, not readable by others
  std::string tls_name;  ///< name or address in the daemon's certificate; empty: the URL's host
  /// Host datagrams: file whose first key authenticates them. Without, but with TLS, a key is
  /// agreed over a connection to `control`, tcp://host:port.
  std::filesystem::path key_file;
  std::string control;

  [[nodiscard]] bool tls() const noexcept { return !tls_certificate.empty(); }
};

}  // namespace emit::client
