// SPDX-License-Identifier: Apache-2.0
#include "telemetry/metrics_server.hpp"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>
#include <chrono>
#include <exception>
#include <string_view>
#include <thread>
#include <utility>

#include "net/connection_acceptor.hpp"

namespace emit::server {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using asio::ip::tcp;
using boost::system::error_code;

using Response = http::response<http::string_body>;

Response answer_to(const http::request<http::empty_body>& request,
                   const MetricsServer::Answers& answers) {
  Response response(http::status::ok, request.version());
  response.keep_alive(false);
  response.set(http::field::content_type, "text/plain; version=0.0.4; charset=utf-8");
  // Scrapers add parameters to the path; no answer depends on them.
  const auto target = request.target().substr(0, request.target().find('?'));
  const auto say_whether = [&](bool good, std::string_view reason) {
    response.result(good ? http::status::ok : http::status::service_unavailable);
    response.body() = good ? "yes\n" : fmt::format("no{}{}\n", reason.empty() ? "" : ": ", reason);
  };
  const bool head = request.method() == http::verb::head;
  if (!head && request.method() != http::verb::get) {
    response.result(http::status::method_not_allowed);
    response.set(http::field::allow, "GET, HEAD");
  } else if (target == "/metrics") {
    response.body() = answers.metrics();
  } else if (target == "/trace") {
    response.set(http::field::content_type, "application/json");
    response.body() = answers.trace();
  } else if (target == "/healthz") {
    say_whether(answers.healthy(), {});
  } else if (target == "/readyz") {
    const std::string reason = answers.why_not_ready();
    say_whether(reason.empty(), reason);
  } else {
    response.result(http::status::not_found);
    response.body() = "there are /metrics, /trace, /healthz and /readyz\n";
  }
  response.content_length(response.body().size());
  if (head) response.body().clear();
  return response;
}

/// One connection; lives as long as an operation of it is under way.
class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(tcp::socket socket, const MetricsServer::Answers& answers, int& open)
      : stream_(std::move(socket)), answers_(answers), open_(open) {
    ++open_;
    parser_.header_limit(MetricsServer::kMaxRequestBytes);
    parser_.body_limit(0);
  }
  ~Session() { --open_; }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  void run() {
    stream_.expires_after(std::chrono::nanoseconds(MetricsServer::kTimeoutNs));
    http::async_read(stream_, buffer_, parser_,
                     [self = shared_from_this()](const error_code& error, std::size_t) {
                       // Bodies are not read, but who sends one is answered.
                       if (!error || error == http::error::body_limit) self->answer();
                     });
  }

 private:
  void answer() {
    response_ = answer_to(parser_.get(), answers_);
    http::async_write(stream_, response_,
                      [self = shared_from_this()](const error_code&, std::size_t) {
                        error_code ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                      });
  }

  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{MetricsServer::kMaxRequestBytes};
  http::request_parser<http::empty_body> parser_;
  Response response_;
  const MetricsServer::Answers& answers_;
  int& open_;
};

}  // namespace

struct MetricsServer::Impl {
  explicit Impl(Answers given) : answers(std::move(given)) {}

  void take(tcp::socket socket, const SocketAddress& peer) {
    if (sessions >= kMaxConnections || !answers.admits(peer)) return;
    std::make_shared<Session>(std::move(socket), answers, sessions)->run();
  }

  void run() noexcept {
    // A request that there is no memory for ends; the next one gets its chance.
    while (!context.stopped()) {
      try {
        acceptor.resume();
        context.run();
      } catch (const std::exception&) {
        continue;
      }
    }
  }

  const Answers answers;
  int sessions = 0;
  asio::io_context context{1};
  ConnectionAcceptor acceptor{context, [this](tcp::socket socket, const SocketAddress& peer) {
                                take(std::move(socket), peer);
                              }};
  std::thread thread;
};

MetricsServer::MetricsServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

physics::Result<std::unique_ptr<MetricsServer>> MetricsServer::start(const SocketAddress& address,
                                                                     Answers answers) {
  try {
    auto impl = std::make_unique<Impl>(std::move(answers));
    if (auto opened = impl->acceptor.open(address); !opened) {
      return tl::unexpected(std::move(opened.error()));
    }
    impl->thread = std::thread([raw = impl.get()] { raw->run(); });
    return std::unique_ptr<MetricsServer>(new MetricsServer(std::move(impl)));
  } catch (const std::exception& error) {
    return physics::make_error(physics::ErrorCode::io, to_string(address) + ": " + error.what());
  }
}

MetricsServer::~MetricsServer() {
  impl_->context.stop();
  impl_->thread.join();
}

SocketAddress MetricsServer::address() const noexcept {
  return impl_->acceptor.address();
}

}  // namespace emit::server
