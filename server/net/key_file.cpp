// SPDX-License-Identifier: Apache-2.0
#include "net/key_file.hpp"

#include "net/tls_session.hpp"

namespace emit::server {

physics::Result<std::vector<protocol::SessionKey>> read_key_file(
    const std::filesystem::path& file) {
  const auto text = read_secret_file(file);
  if (!text) return tl::unexpected(physics::Error(text.error()));
  auto keys = protocol::parse_key_file(*text);
  if (!keys) return tl::unexpected(std::move(keys.error()).with_context(file.string()));
  return keys;
}

}  // namespace emit::server
