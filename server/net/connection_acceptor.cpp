// SPDX-License-Identifier: Apache-2.0
#include "net/connection_acceptor.hpp"

#include <chrono>
#include <utility>

#include "net/asio_endpoint.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

using boost::asio::ip::tcp;
using boost::system::error_code;

constexpr std::chrono::milliseconds kRetry{100};

}  // namespace

physics::Result<void> ConnectionAcceptor::open(const SocketAddress& address) {
  const auto endpoint = to_endpoint<tcp::endpoint>(address);
  error_code error;
  acceptor_.open(endpoint.protocol(), error);
  if (!error) acceptor_.set_option(tcp::acceptor::reuse_address(true), error);
  if (!error) acceptor_.bind(endpoint, error);
  if (!error) acceptor_.listen(tcp::acceptor::max_listen_connections, error);
  tcp::endpoint bound;
  if (!error) bound = acceptor_.local_endpoint(error);
  if (error) {
    return physics::make_error(physics::ErrorCode::io,
                               to_string(address) + ": " + bind_error_text(error.value()));
  }
  bound_ = from_endpoint(bound);
  accept();
  return {};
}

void ConnectionAcceptor::resume() {
  if (!accepting_) accept();
}

void ConnectionAcceptor::accept() {
  acceptor_.async_accept([this](const error_code& error, tcp::socket socket) {
    accepting_ = false;
    if (error == boost::asio::error::operation_aborted) return;
    if (error) {
      // Out of descriptors, and who knocks still waits: asked again after a while.
      retry_.expires_after(kRetry);
      retry_.async_wait([this](const error_code& ended) {
        accepting_ = false;
        if (!ended) accept();
      });
      accepting_ = true;
      return;
    }
    accept();  // first: for this connection there may be no memory
    error_code gone;
    const tcp::endpoint peer = socket.remote_endpoint(gone);
    if (!gone) take_(std::move(socket), from_endpoint(peer));
  });
  accepting_ = true;
}

}  // namespace emit::server
