// SPDX-License-Identifier: Apache-2.0
#include "client/http_get.hpp"

#include <fmt/format.h>
#include <poll.h>

#include <array>
#include <charconv>
#include <optional>

#include "client/client_connection.hpp"
#include "net/socket.hpp"
#include "rt/error_text.hpp"

namespace emit::client {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

struct Target {
  server::HostPort where;
  std::string path = "/metrics";
};

Result<Target> parse_target(const std::string& url) {
  constexpr std::string_view kScheme = "http://";
  Target target;
  std::string_view rest = url;
  const bool known = rest.starts_with(kScheme);
  if (known) rest.remove_prefix(kScheme.size());
  if (const auto slash = rest.find('/'); slash != std::string_view::npos) {
    if (slash + 1 < rest.size()) target.path = rest.substr(slash);
    rest = rest.substr(0, slash);
  }
  const auto where = server::parse_host_port(rest);
  if (!known || !where || where->host.empty() || where->port == 0) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("'{}': not http://host:port[/path]", url));
  }
  target.where = *where;
  return target;
}

Result<void> send_all(server::TcpSocket& socket, std::string_view text, std::int64_t end_ns) {
  std::span<const std::byte> left = std::as_bytes(std::span(text));
  while (!left.empty()) {
    const server::IoResult sent = socket.write_some(left);
    if (sent.status == server::IoStatus::done) {
      left = left.subspan(sent.bytes);
    } else if (sent.status != server::IoStatus::would_block ||
               !wait_for(socket.fd(), POLLOUT, end_ns)) {
      return make_error(ErrorCode::io, "the request is not taken");
    }
  }
  return {};
}

/// Everything up to the end of the connection.
Result<std::string> receive_all(server::TcpSocket& socket, std::int64_t end_ns) {
  std::string text;
  std::array<std::byte, 16384> piece;
  for (;;) {
    const server::IoResult got = socket.read_some(piece);
    if (got.status == server::IoStatus::closed) return text;
    if (got.status == server::IoStatus::failed)
      return make_error(ErrorCode::io, server::error_text(got.error));
    if (got.status == server::IoStatus::would_block) {
      if (!wait_for(socket.fd(), POLLIN, end_ns)) {
        return make_error(ErrorCode::io, "no answer within the timeout");
      }
      continue;
    }
    text.append(reinterpret_cast<const char*>(piece.data()), got.bytes);
    if (text.size() > kMaxHttpBytes) {
      return make_error(ErrorCode::io, fmt::format("more than {} bytes", kMaxHttpBytes));
    }
  }
}

Result<HttpAnswer> parse_answer(const std::string& text) {
  HttpAnswer answer;
  constexpr std::string_view kVersion = "HTTP/1.";
  const std::size_t end = text.find("\r\n\r\n");
  const std::size_t code = text.find(' ');
  if (!text.starts_with(kVersion) || end == std::string::npos || code > end ||
      std::from_chars(text.data() + code + 1, text.data() + end, answer.status).ec != std::errc()) {
    return make_error(ErrorCode::protocol, "the answer is no HTTP");
  }
  answer.body = text.substr(end + 4);
  return answer;
}

}  // namespace

Result<HttpAnswer> http_get(const std::string& url, std::int64_t timeout_ns) {
  const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
  const auto target = parse_target(url);
  if (!target) return tl::unexpected(target.error());
  const auto named = [&](const physics::Error& error) {
    return tl::unexpected(physics::Error(error).with_context(url));
  };
  const auto address = server::resolve(target->where, server::Transport::tcp, false);
  if (!address) return named(address.error());
  const server::SocketContext context;
  auto socket = server::TcpSocket::connect(context, *address, timeout_ns);
  if (!socket) return named(socket.error());
  // HTTP/1.0: the answer comes in one piece and ends with the connection.
  const std::string request =
      fmt::format("GET {} HTTP/1.0\r\nHost: {}\r\n\r\n", target->path, target->where.host);
  if (auto sent = send_all(*socket, request, end_ns); !sent) return named(sent.error());
  const auto text = receive_all(*socket, end_ns);
  if (!text) return named(text.error());
  auto answer = parse_answer(*text);
  if (!answer) return named(answer.error());
  return answer;
}

}  // namespace emit::client
