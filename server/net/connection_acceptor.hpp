// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <functional>

#include "emit/physics/error.hpp"
#include "net/socket_address.hpp"

namespace emit::server {

/// Accepts TCP connections on an io_context, one after the other, whatever fails in between: when
/// there are no descriptors or no memory, who knocks still waits and is asked again.
/// Thread: the one that runs the context. Not real time.
class ConnectionAcceptor {
 public:
  /// Takes a connection of a peer. What it throws ends the connection alone.
  using Take = std::function<void(boost::asio::ip::tcp::socket socket, const SocketAddress& peer)>;

  ConnectionAcceptor(boost::asio::io_context& context, Take take)
      : acceptor_(context), retry_(context), take_(std::move(take)) {}
  ConnectionAcceptor(const ConnectionAcceptor&) = delete;
  ConnectionAcceptor& operator=(const ConnectionAcceptor&) = delete;

  /// Opens the port and asks for the first connection. Errors (io): address in use and so on,
  /// naming it.
  [[nodiscard]] physics::Result<void> open(const SocketAddress& address);
  /// Asks for a connection if nobody does; call it before the context runs again after a throw.
  void resume();
  /// Address with the port that was chosen. @pre open() has succeeded
  [[nodiscard]] const SocketAddress& address() const noexcept { return bound_; }

 private:
  void accept();
  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer retry_;
  Take take_;
  SocketAddress bound_;
  bool accepting_ = false;  ///< or about to, after a while: something will call accept()
};

}  // namespace emit::server
