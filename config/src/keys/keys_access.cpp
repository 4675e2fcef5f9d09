// SPDX-License-Identifier: Apache-2.0
#include "keys.hpp"

/// Keys of the daemon's configuration that say who may connect.
namespace emit::config {

namespace {

/// Key of an array of strings. `take` turns a string into an element, or reports a fault.
template <class T, class Field, class Take, class Write>
Key<T> texts(std::string name, std::string range, Field field, Take take, Write write,
             std::string meaning) {
  return custom<T>(
      {name, "array of strings", "", std::move(range), std::move(meaning), false},
      [name, field, take](T& out, const Node& node, Diagnostics& diagnostics) {
        if (node.kind != Node::Kind::array) {
          diagnostics.add(node.at, "'" + name + "' must be an array of strings, not " +
                                       std::string(kind_name(node.kind)));
          return;
        }
        std::decay_t<decltype(field(out))> elements;
        for (const Node& item : node.items) {
          std::string word;
          if (read_text(item, name, word, diagnostics)) take(elements, word, item.at, diagnostics);
        }
        field(out) = std::move(elements);
      },
      [field, write](const T& in) -> std::optional<std::string> {
        std::string out = "[";
        for (const auto& element : field(in)) {
          out += (out.size() > 1 ? ", " : "") + toml_string(write(element));
        }
        return out + "]";
      });
}

template <class Field>
Key<AccessConfig> networks(std::string name, Field field, std::string meaning) {
  return texts<AccessConfig>(
      name, "networks such as 10.0.0.0/8, fd00::/8", field,
      [name](std::vector<protocol::Network>& out, const std::string& word, const Location& at,
             Diagnostics& diagnostics) {
        const auto network = protocol::parse_network(word);
        network ? out.push_back(*network)
                : diagnostics.add(at, "'" + name + "': " + network.error().text);
      },
      [](const protocol::Network& network) { return to_string(network); }, std::move(meaning));
}

}  // namespace

std::vector<protocol::Network> AccessConfig::default_multicast_groups() {
  return {*protocol::parse_network("239.255.0.0/16"), *protocol::parse_network("ff15::/16")};
}

const KeyTable<AccessConfig>& access_keys() {
  static const KeyTable<AccessConfig> keys = {
      networks(
          "allow", EMIT_FIELD(allow),
          "Networks whose hosts may reach the control, host, metrics and console ports, beside "
          "loopback. Others are dropped before a byte is read. Empty: all."),
      networks("multicast_groups", EMIT_FIELD(multicast_groups),
               "Multicast groups that a client may have frames sent to. The default is the "
               "site-local scopes."),
      integer<AccessConfig>(
          "max_connections_per_peer", "", 1, 1024, EMIT_FIELD(max_connections_per_peer),
          "Largest number of connections at a time from one address of another host."),
      integer<AccessConfig>(
          "max_host_frames_hz", "1/s", 1, 10'000'000, EMIT_FIELD(max_host_frames_hz),
          "Largest rate of host frames from one address (on this host: one socket). More are "
          "refused (`CODE_OVERLOADED`). A quarter second's number may come at once."),
      integer<AccessConfig>(
          "max_control_records_hz", "1/s", 1, 10'000'000, EMIT_FIELD(max_control_records_hz),
          "Largest rate of hello, subscribe and command records, in the same way."),
  };
  return keys;
}

const KeyTable<TlsConfig>& tls_keys() {
  static const KeyTable<TlsConfig> keys = {
      path<TlsConfig>("certificate", EMIT_FIELD(certificate),
                      "Certificate of the daemon (PEM), with intermediate ones behind it. Without "
                      "it there is no TLS."),
      path<TlsConfig>("key", EMIT_FIELD(key),
                      "Private key of the certificate (PEM), in a file that others cannot read."),
      path<TlsConfig>(
          "client_ca", EMIT_FIELD(client_ca),
          "Certificates (PEM) of the authorities that sign the certificates of clients."),
      texts<TlsConfig>(
          "allow_names", "", EMIT_FIELD(allow_names),
          [](std::vector<std::string>& out, const std::string& word, const Location&,
             Diagnostics&) { out.push_back(word); },
          [](const std::string& name) { return name; },
          "Names in a client's certificate (subject CN or DNS name of subjectAltName) that may "
          "connect. When it is empty, every certificate of the authorities may."),
      integer<TlsConfig>("max_handshakes", "", 1, 1024, EMIT_FIELD(max_handshakes),
                         "Largest number of handshakes at a time. Further connections are closed."),
  };
  return keys;
}

}  // namespace emit::config
