// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstring>

#include "net/socket_address.hpp"

// Between the plain address and Asio's endpoints. Private to the files that include Boost.Asio.
namespace emit::server {

template <typename Endpoint>
[[nodiscard]] Endpoint to_endpoint(const SocketAddress& address) noexcept {
  Endpoint endpoint;
  std::memcpy(endpoint.data(), &address.storage,
              std::min<std::size_t>(address.length, endpoint.capacity()));
  return endpoint;
}

template <typename Endpoint>
[[nodiscard]] SocketAddress from_endpoint(const Endpoint& endpoint) noexcept {
  SocketAddress address;
  address.length = static_cast<socklen_t>(endpoint.size());
  std::memcpy(&address.storage, endpoint.data(), endpoint.size());
  return address;
}

}  // namespace emit::server
