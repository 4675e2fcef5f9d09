// SPDX-License-Identifier: Apache-2.0
#include "net/socket_address.hpp"

#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <charconv>
#include <cstring>
#include <exception>
#include <system_error>

#include "net/asio_endpoint.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;
using physics::ErrorCode;
using physics::make_error;

// Nothing here depends on the transport: udp stands for both.
using AnyEndpoint = asio::ip::udp::endpoint;

/// Asio folds the resolver's codes into categories of its own; people know the texts of the system.
std::string resolver_error_text(const error_code& error) {
  if (error == asio::error::host_not_found) {
    return ::gai_strerror(EAI_NONAME);
  }
  if (error == asio::error::host_not_found_try_again) {
    return ::gai_strerror(EAI_AGAIN);
  }
  if (error == asio::error::no_recovery) {
    return ::gai_strerror(EAI_FAIL);
  }
  if (error == asio::error::service_not_found) {
    return ::gai_strerror(EAI_SERVICE);
  }
  if (error == asio::error::socket_type_not_supported) {
    return ::gai_strerror(EAI_SOCKTYPE);
  }
  return error.category() == asio::error::get_system_category() ? error_text(error.value())
                                                                : error.message();
}

template <typename Protocol>
physics::Result<SocketAddress> resolve_with(const HostPort& where, bool passive) {
  using Resolver = typename Protocol::resolver;
  asio::io_context context;
  Resolver resolver(context);
  auto flags = Resolver::numeric_service;
  if (passive) {
    flags |= Resolver::passive;
  }
  error_code error;
  const auto found = resolver.resolve(where.host, std::to_string(where.port), flags, error);
  if (error || found.empty()) {
    return make_error(ErrorCode::io,
                      fmt::format("{}:{}: {}", where.host, where.port,
                                  error ? resolver_error_text(error) : std::string("no address")));
  }
  return from_endpoint(found.begin()->endpoint());
}

}  // namespace

std::uint16_t SocketAddress::port() const noexcept {
  return to_endpoint<AnyEndpoint>(*this).port();
}

void SocketAddress::set_port(std::uint16_t port) noexcept {
  if (length == 0) {
    return;
  }
  auto endpoint = to_endpoint<AnyEndpoint>(*this);
  endpoint.port(port);
  *this = from_endpoint(endpoint);
}

bool SocketAddress::is_multicast() const noexcept {
  return length != 0 && to_endpoint<AnyEndpoint>(*this).address().is_multicast();
}

physics::Result<HostPort> parse_host_port(std::string_view text) {
  const auto bad = [&] {
    return make_error(
        ErrorCode::config,
        fmt::format("'{}' is not host:port (such as 127.0.0.1:7000 or [::1]:7000)", text));
  };
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) {
    return bad();
  }
  HostPort out;
  std::string_view host = text.substr(0, colon);
  const std::string_view port = text.substr(colon + 1);
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string_view::npos) {
    return bad();
  }
  out.host = host;
  const auto parsed = std::from_chars(port.data(), port.data() + port.size(), out.port);
  if (parsed.ec != std::errc{} || parsed.ptr != port.data() + port.size()) {
    return bad();
  }
  return out;
}

physics::Result<SocketAddress> resolve(const HostPort& where, Transport transport, bool passive) {
  try {
    return transport == Transport::tcp ? resolve_with<asio::ip::tcp>(where, passive)
                                       : resolve_with<asio::ip::udp>(where, passive);
  } catch (const std::exception& error) {
    return make_error(ErrorCode::io,
                      fmt::format("{}:{}: {}", where.host, where.port, error.what()));
  }
}

SocketAddress numeric_address(const std::string& host, std::uint16_t port) noexcept {
  error_code error;
  const auto address = asio::ip::make_address(host.c_str(), error);
  return error ? SocketAddress{} : from_endpoint(AnyEndpoint(address, port));
}

unsigned interface_of(const SocketAddress& local) noexcept {
  ifaddrs* all = nullptr;
  if (local.length == 0 || ::getifaddrs(&all) != 0) {
    return 0;
  }
  const auto wanted = to_endpoint<AnyEndpoint>(local).address();
  unsigned index = 0;
  for (const ifaddrs* each = all; each != nullptr && index == 0; each = each->ifa_next) {
    const int family = each->ifa_addr != nullptr ? each->ifa_addr->sa_family : AF_UNSPEC;
    if (family != AF_INET && family != AF_INET6) {
      continue;
    }
    SocketAddress candidate;
    candidate.length = family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6);
    std::memcpy(&candidate.storage, each->ifa_addr, candidate.length);
    auto address = to_endpoint<AnyEndpoint>(candidate).address();
    // An IPv4 peer of a socket for both families.
    const bool mapped = wanted.is_v6() && wanted.to_v6().is_v4_mapped() && address.is_v4();
    if (address == wanted ||
        (mapped &&
         asio::ip::make_address_v4(asio::ip::v4_mapped, wanted.to_v6()) == address.to_v4())) {
      index = ::if_nametoindex(each->ifa_name);
    }
  }
  ::freeifaddrs(all);
  return index;
}

std::string to_string(const SocketAddress& address) {
  if (address.length == 0) {
    return "unknown address";
  }
  const auto endpoint = to_endpoint<AnyEndpoint>(address);
  const bool v6 = endpoint.address().is_v6();
  return fmt::format("{}{}{}:{}", v6 ? "[" : "", endpoint.address().to_string(), v6 ? "]" : "",
                     endpoint.port());
}

}  // namespace emit::server
