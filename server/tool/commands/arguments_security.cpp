// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/arguments.hpp"

namespace emit::tool {

void add_security(CLI::App& app, client::Security& target) {
  CLI::Option* certificate =
      add_path(app, "--tls-cert", target.tls_certificate, "TLS: this client's certificate, PEM");
  CLI::Option* key = add_path(app, "--tls-key", target.tls_key,
                              "TLS: its private key, PEM, not readable by others");
  CLI::Option* authority =
      add_path(app, "--tls-ca", target.tls_ca, "TLS: who signs the daemon's certificate, PEM");
  certificate->needs(key)->needs(authority);
  key->needs(certificate);
  authority->needs(certificate);
  app.add_option("--tls-name", target.tls_name,
                 "TLS: name or address in the daemon's certificate; default: the URL's host")
      ->type_name("NAME")
      ->needs(certificate);
}

}  // namespace emit::tool
