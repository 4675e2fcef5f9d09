// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "console/console_server.hpp"

namespace emit::server {

/// Message to pages, shared by all that get it.
using ConsoleBytes = std::shared_ptr<const std::vector<std::byte>>;
using ConsoleText = std::shared_ptr<const std::string>;

class ConsoleSession;

/// State that the connections of one server share. The server's thread alone touches it.
struct ConsoleHub {
  const ConsoleServer::Answers& answers;
  const std::vector<std::string>& names;
  std::size_t channels = 1;
  int connections = 0;                ///< open, pages and requests
  std::set<ConsoleSession*> pages{};  ///< those with a WebSocket
  std::uint32_t next_page = 1;
  /// Called when the first page opens and when the last one has gone.
  std::function<void()> pages_changed{};
};

/// One connection; lives as long as an operation of it is under way. A request for a file is
/// answered and ends it; a request for /live makes it a WebSocket.
class ConsoleSession : public std::enable_shared_from_this<ConsoleSession> {
 public:
  ConsoleSession(boost::asio::ip::tcp::socket socket, bool local, ConsoleHub& hub);
  ~ConsoleSession();
  ConsoleSession(const ConsoleSession&) = delete;
  ConsoleSession& operator=(const ConsoleSession&) = delete;

  void run();

  [[nodiscard]] std::uint32_t page() const noexcept { return page_; }
  /// Returns whether the page has drawn its last image and shows this channel.
  [[nodiscard]] bool wants_image(std::size_t channel) const noexcept {
    return wants_image_ && channel_ == channel;
  }
  [[nodiscard]] bool wants_image() const noexcept { return wants_image_; }
  [[nodiscard]] std::size_t channel() const noexcept { return channel_; }
  void give_image(ConsoleBytes image);
  /// Replaces a status that has not been sent yet.
  void give_status(ConsoleText status);
  /// Queues an answer. A page that leaves many of them unread is closed.
  void give_answer(ConsoleText answer);

 private:
  void answer_request();
  void open_page();
  void read_message();
  void take_message(std::string_view text);
  void take_command(std::string_view word);
  void take_question(std::string_view words);
  void take_replay(std::string_view words);
  void say_answer(bool ok, std::string_view command, std::string_view text);
  /// Sends what there is, the most urgent first, one message at a time.
  void pump();
  void write(boost::asio::const_buffer bytes, bool binary);

  ConsoleHub& hub_;
  const bool local_;
  boost::beast::websocket::stream<boost::beast::tcp_stream> stream_;
  boost::beast::flat_buffer buffer_{ConsoleServer::kMaxRequestBytes};
  boost::beast::http::request_parser<boost::beast::http::empty_body> parser_;
  boost::beast::http::response<boost::beast::http::string_body> response_;
  std::uint32_t page_ = 0;
  std::size_t channel_ = 0;
  bool wants_image_ = false;
  bool writing_ = false;
  bool closed_ = false;
  std::deque<ConsoleText> answers_;
  ConsoleText status_;
  ConsoleBytes image_;
  ConsoleText text_under_way_;
  ConsoleBytes image_under_way_;
};

}  // namespace emit::server
