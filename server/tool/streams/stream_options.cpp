// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/stream_options.hpp"

#include <string>

#include "tool/streams/error_correction.hpp"

namespace emit::tool {
namespace {

template <class Target>
void add_fec(CommandLine& line, Target& target) {
  line.parsed(
          "--fec",
          [&target](const std::string& text) -> physics::Result<void> {
            const auto fec = parse_error_correction(text);
            if (!fec) return tl::unexpected(fec.error());
            target = *fec;
            return {};
          },
          "UDP: error correction, K+M: groups of up to K fragments with M parity fragments, of "
          "which any M may be "
          "lost, e.g. 48+5; off: none")
      .type_name("K+M");
}

}  // namespace

void add_security(CommandLine& line, client::Security& target) {
  Option certificate =
      line.path("--tls-cert", target.tls_certificate, "TLS: this client's certificate, PEM");
  Option key =
      line.path("--tls-key", target.tls_key, "TLS: its private key, PEM, not readable by others");
  Option authority =
      line.path("--tls-ca", target.tls_ca, "TLS: who signs the daemon's certificate, PEM");
  certificate.needs(key).needs(authority);
  key.needs(certificate);
  authority.needs(certificate);
  line.option("--tls-name", target.tls_name,
              "TLS: name or address in the daemon's certificate; default: the URL's host")
      .type_name("NAME")
      .needs(certificate);
}

void add_error_correction(CommandLine& line, protocol::FecParams& target) {
  add_fec(line, target);
}

void add_error_correction(CommandLine& line, std::optional<protocol::FecParams>& target) {
  add_fec(line, target);
}

}  // namespace emit::tool
