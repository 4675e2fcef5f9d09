// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <string_view>
#include <vector>

/// Which requests of a browser are the operator's own. A page of another site that the operator has
/// open can make the browser send requests to any address, this port's too; what it cannot do is to
/// choose their Host and Origin.
namespace emit::server {

/// Returns whether a request's Host names this server: an address in numbers, localhost, or one of
/// `names`. A site that points its own name to this address (DNS rebinding) is refused by that.
/// @param host  "name", "name:port", "[address]:port"
[[nodiscard]] bool is_own_host(std::string_view host, const std::vector<std::string>& names);

/// Returns whether a WebSocket is opened by a page that came from `host` itself.
[[nodiscard]] bool is_own_origin(std::string_view origin, std::string_view host);

}  // namespace emit::server
