// SPDX-License-Identifier: Apache-2.0
#include "console/console_session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/write.hpp>
#include <charconv>
#include <chrono>
#include <limits>
#include <optional>
#include <utility>

#include "console/console_access.hpp"
#include "console/console_files.hpp"
#include "console/console_message.hpp"
#include "emit/protocol/control.hpp"

namespace emit::server {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

using Request = http::request<http::empty_body>;
using Response = http::response<http::string_body>;

constexpr std::size_t kMaxAnswers = 64;

std::string_view view(beast::string_view text) {
  return {text.data(), text.size()};
}

std::optional<std::size_t> number_of(std::string_view text) {
  std::size_t value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Forbids the page every request but those to this server, whatever its script wants.
void restrict(Response& response, std::string_view host) {
  response.set("Content-Security-Policy",
               fmt::format("default-src 'none'; script-src 'self'; style-src 'self'; img-src "
                           "'self'; connect-src 'self' ws://{}; base-uri 'none'; form-action "
                           "'none'; frame-ancestors 'none'",
                           host));
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  response.set(http::field::cache_control, "no-store");
}

void fill(Response& response, const Request& request, const ConsoleHub& hub) {
  constexpr std::string_view kTemperatures = "/temperatures?channel=";
  const std::string_view target = view(request.target());
  const auto say = [&](http::status status, std::string_view text) {
    response.result(status);
    response.set(http::field::content_type, "text/plain; charset=utf-8");
    response.body() = text;
  };
  if (!is_own_host(view(request[http::field::host]), hub.names)) {
    say(http::status::forbidden, "the Host of the request is not this server's\n");
    return;
  }
  restrict(response, view(request[http::field::host]));
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    say(http::status::method_not_allowed, "GET or HEAD\n");
    response.set(http::field::allow, "GET, HEAD");
  } else if (const ConsoleFile* file = find_console_file(target)) {
    const std::string_view type = media_type(file->name);
    response.set(http::field::content_type, {type.data(), type.size()});
    response.body() = file->text;
  } else if (target.starts_with(kTemperatures)) {
    const auto channel = number_of(target.substr(kTemperatures.size()));
    std::string table =
        channel && *channel < hub.channels ? hub.answers.temperatures(*channel) : std::string();
    if (table.empty()) {
      say(http::status::not_found, "the channel has no band\n");
      return;
    }
    response.set(http::field::content_type, "application/octet-stream");
    response.body() = std::move(table);
  } else {
    say(http::status::not_found, "there is /\n");
  }
}

}  // namespace

ConsoleSession::ConsoleSession(asio::ip::tcp::socket socket, bool local, ConsoleHub& hub)
    : hub_(hub), local_(local), stream_(std::move(socket)) {
  ++hub_.connections;
  parser_.header_limit(ConsoleServer::kMaxRequestBytes);
  parser_.body_limit(0);
}

ConsoleSession::~ConsoleSession() {
  --hub_.connections;
  if (hub_.pages.erase(this) > 0 && hub_.pages.empty()) hub_.pages_changed();
}

void ConsoleSession::run() {
  auto& lowest = beast::get_lowest_layer(stream_);
  error_code ignored;
  lowest.socket().set_option(asio::ip::tcp::no_delay(true), ignored);
  lowest.expires_after(std::chrono::nanoseconds(ConsoleServer::kTimeoutNs));
  http::async_read(lowest, buffer_, parser_,
                   [self = shared_from_this()](const error_code& error, std::size_t) {
                     // Bodies are not read, but who sends one is answered.
                     if (!error || error == http::error::body_limit) self->answer_request();
                   });
}

void ConsoleSession::answer_request() {
  const Request& request = parser_.get();
  const std::string_view host = view(request[http::field::host]);
  response_ = Response(http::status::ok, request.version());
  response_.keep_alive(false);
  if (view(request.target()) == "/live" && websocket::is_upgrade(request)) {
    // A page of another site may open a WebSocket here; the browser says where it came from.
    if (is_own_host(host, hub_.names) && is_own_origin(view(request[http::field::origin]), host)) {
      open_page();
      return;
    }
    response_.result(http::status::forbidden);
    response_.body() = "a WebSocket is for the page of this server\n";
  } else {
    fill(response_, request, hub_);
  }
  response_.content_length(response_.body().size());
  if (request.method() == http::verb::head) response_.body().clear();
  auto& lowest = beast::get_lowest_layer(stream_);
  http::async_write(lowest, response_, [self = shared_from_this()](const error_code&, std::size_t) {
    error_code ignored;
    beast::get_lowest_layer(self->stream_)
        .socket()
        .shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
  });
}

void ConsoleSession::open_page() {
  // The WebSocket has timeouts of its own: it pings a page that is silent.
  beast::get_lowest_layer(stream_).expires_never();
  stream_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
  stream_.read_message_max(ConsoleServer::kMaxMessageBytes);
  stream_.auto_fragment(false);
  stream_.async_accept(parser_.get(), [self = shared_from_this()](const error_code& error) {
    if (error) return;
    self->page_ = self->hub_.next_page++;
    // The first of all messages, before a status.
    self->give_answer(std::make_shared<const std::string>(self->hub_.answers.hello(self->local_)));
    const bool first = self->hub_.pages.empty();
    self->hub_.pages.insert(self.get());
    if (first) self->hub_.pages_changed();
    self->buffer_.clear();
    self->read_message();
  });
}

void ConsoleSession::read_message() {
  stream_.async_read(buffer_, [self = shared_from_this()](const error_code& error, std::size_t) {
    if (error) {
      self->closed_ = true;
      self->wants_image_ = false;
      return;
    }
    const auto bytes = self->buffer_.cdata();
    self->take_message({static_cast<const char*>(bytes.data()), bytes.size()});
    self->buffer_.clear();
    self->read_message();
  });
}

void ConsoleSession::take_message(std::string_view text) {
  constexpr std::string_view kNext = "next ";
  constexpr std::string_view kCommand = "command ";
  constexpr std::string_view kExplain = "explain ";
  constexpr std::string_view kReplay = "replay ";
  if (text.starts_with(kNext)) {
    const auto channel = number_of(text.substr(kNext.size()));
    if (channel && *channel < hub_.channels) {
      channel_ = *channel;
      wants_image_ = true;
    }
  } else if (text.starts_with(kCommand)) {
    take_command(text.substr(kCommand.size()));
  } else if (text.starts_with(kExplain)) {
    take_question(text.substr(kExplain.size()));
  } else if (text.starts_with(kReplay)) {
    take_replay(text.substr(kReplay.size()));
  }
}

void ConsoleSession::take_question(std::string_view words) {
  std::array<std::size_t, 4> numbers{};
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::size_t end = std::min(words.find(' '), words.size());
    const auto number = number_of(words.substr(0, end));
    const bool last = i + 1 == numbers.size();
    if (!number || last != (end == words.size())) return;
    numbers[i] = *number;
    words.remove_prefix(std::min(end + 1, words.size()));
  }
  constexpr std::size_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (numbers[0] >= hub_.channels || numbers[1] > kMost || numbers[2] > kMost) return;
  ExplainRequest request;
  request.page = page_;
  request.channel = numbers[0];
  request.x_px = static_cast<std::uint32_t>(numbers[1]);
  request.y_px = static_cast<std::uint32_t>(numbers[2]);
  request.frame_number = numbers[3];
  const std::string refusal = hub_.answers.explain(request);
  if (!refusal.empty()) say_answer(false, "explain", refusal);
}

void ConsoleSession::take_replay(std::string_view words) {
  if (!hub_.answers.replay) {
    say_answer(false, "replay", "nothing is replayed here");
    return;
  }
  const auto replayed = hub_.answers.replay(words);
  say_answer(replayed.ok, "replay", replayed.text);
}

void ConsoleSession::say_answer(bool ok, std::string_view command, std::string_view text) {
  give_answer(std::make_shared<const std::string>(fmt::format(
      R"({{"type":"answer","ok":{},"command":"{}","text":{}}})", ok, command, json_string(text))));
}

void ConsoleSession::take_command(std::string_view word) {
  const auto named = std::ranges::find(protocol::kCommandNames, word);
  if (named == protocol::kCommandNames.begin() || named == protocol::kCommandNames.end()) return;
  const auto command = static_cast<CommandKind>(named - protocol::kCommandNames.begin());
  const std::string refusal = hub_.answers.command(command, local_, page_);
  if (!refusal.empty()) say_answer(false, *named, refusal);
}

void ConsoleSession::give_image(ConsoleBytes image) {
  wants_image_ = false;
  image_ = std::move(image);
  pump();
}

void ConsoleSession::give_status(ConsoleText status) {
  status_ = std::move(status);
  pump();
}

void ConsoleSession::give_answer(ConsoleText answer) {
  if (answers_.size() >= kMaxAnswers) {
    beast::get_lowest_layer(stream_).cancel();
    return;
  }
  answers_.push_back(std::move(answer));
  pump();
}

void ConsoleSession::pump() {
  if (writing_ || closed_) return;
  if (!answers_.empty()) {
    text_under_way_ = std::move(answers_.front());
    answers_.pop_front();
    write(asio::buffer(*text_under_way_), false);
  } else if (status_) {
    text_under_way_ = std::move(status_);
    write(asio::buffer(*text_under_way_), false);
  } else if (image_) {
    image_under_way_ = std::move(image_);
    write(asio::buffer(*image_under_way_), true);
  }
}

void ConsoleSession::write(asio::const_buffer bytes, bool binary) {
  writing_ = true;
  stream_.binary(binary);
  stream_.async_write(bytes, [self = shared_from_this()](const error_code& error, std::size_t) {
    self->writing_ = false;
    self->image_under_way_.reset();
    self->text_under_way_.reset();
    if (error) {
      self->closed_ = true;
      beast::get_lowest_layer(self->stream_).cancel();
      return;
    }
    self->pump();
  });
}

}  // namespace emit::server
