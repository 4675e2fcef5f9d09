// SPDX-License-Identifier: Apache-2.0
#include "console/console_access.hpp"

#include <algorithm>
#include <cctype>

#include "emit/protocol/ip_address.hpp"

namespace emit::server {
namespace {

bool equal_names(std::string_view a, std::string_view b) {
  return std::ranges::equal(
      a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

}  // namespace

bool is_own_host(std::string_view host, const std::vector<std::string>& names) {
  if (host.starts_with('[')) {
    const std::size_t end = host.find(']');
    return end != std::string_view::npos && protocol::parse_ip(host.substr(1, end - 1)).has_value();
  }
  const std::string_view name = host.substr(0, host.find(':'));
  if (name.empty()) {
    return false;
  }
  return equal_names(name, "localhost") || protocol::parse_ip(name).has_value() ||
         std::ranges::any_of(names, [&](const std::string& own) { return equal_names(own, name); });
}

bool is_own_origin(std::string_view origin, std::string_view host) {
  constexpr std::string_view kScheme = "http://";
  return !host.empty() && origin.starts_with(kScheme) &&
         equal_names(origin.substr(kScheme.size()), host);
}

}  // namespace emit::server
