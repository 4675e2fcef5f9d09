// SPDX-License-Identifier: Apache-2.0
#include "console/console_server.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <exception>
#include <thread>
#include <utility>

#include "console/console_message.hpp"
#include "console/console_session.hpp"
#include "emit/protocol/control.hpp"
#include "net/connection_acceptor.hpp"
#include "net/ip_address.hpp"

namespace emit::server {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::chrono::milliseconds kStatusPeriod{200};
constexpr int kNice = 10;

}  // namespace

struct ConsoleServer::Impl {
  Impl(Context& shared, ConsoleTap& its_tap, Answers given, Options wanted)
      : context(shared),
        tap(its_tap),
        answers(std::move(given)),
        options(std::move(wanted)),
        hub{answers, options.names, std::max<std::size_t>(shared.channels.size(), 1)} {
    hub.pages_changed = [this] { pages_changed(); };
  }

  void take(tcp::socket socket, const SocketAddress& peer) {
    if (hub.connections >= kMaxConnections || !answers.admits(peer)) return;
    const bool local = ip_of(peer).is_loopback();
    std::make_shared<ConsoleSession>(std::move(socket), local, hub)->run();
  }

  /// The tap and the timers work only while somebody looks.
  void pages_changed() {
    const bool any = !hub.pages.empty();
    tap.open(any);
    context.axes.watched.store(any, std::memory_order_relaxed);
    if (any) {
      image_tick();
      status_tick();
    } else {
      image_timer.cancel();
      status_timer.cancel();
    }
  }

  void image_tick() {
    image_timer.expires_after(
        std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / options.rate_hz)));
    image_timer.async_wait([this](const error_code& ended) {
      if (ended || hub.pages.empty()) return;
      ask_for_image();
      image_tick();
    });
  }

  /// Asks for the channel that some page waits for; pages of different channels take turns.
  void ask_for_image() {
    for (std::size_t i = 0; i < hub.channels; ++i) {
      const std::size_t channel = (asked_channel + 1 + i) % hub.channels;
      const bool wanted = std::ranges::any_of(
          hub.pages, [&](const ConsoleSession* page) { return page->wants_image(channel); });
      if (wanted) {
        if (tap.ask(channel)) asked_channel = channel;
        return;
      }
    }
  }

  void status_tick() {
    give_all_status();
    status_timer.expires_after(kStatusPeriod);
    status_timer.async_wait([this](const error_code& ended) {
      if (!ended && !hub.pages.empty()) status_tick();
    });
  }

  void give_all_status() {
    const auto status = std::make_shared<const std::string>(answers.status(hub.pages.size()));
    // A copy: a page that has gone leaves the set meanwhile.
    for (ConsoleSession* page : std::vector(hub.pages.begin(), hub.pages.end())) {
      page->give_status(status);
    }
  }

  /// Takes what agents have put down, whenever they ring.
  void watch_bell() {
    context.bells.console.arm();
    take_replies();
    take_explanations();
    take_image();
    bell.async_wait(asio::posix::stream_descriptor::wait_read, [this](const error_code& ended) {
      watching = false;
      if (ended) return;
      context.bells.console.disarm();
      watch_bell();
    });
    watching = true;
  }

  void take_image() {
    const ConsoleTap::Taken taken = tap.taken();
    if (taken.header == nullptr) return;
    const std::size_t channel = taken.header->channel_index;
    auto message = std::make_shared<std::vector<std::byte>>();
    message->reserve(kConsoleHeaderBytes + taken.pixels.size_bytes());
    const auto header = console_header(*taken.header, ++sequence);
    const auto pixels = std::as_bytes(taken.pixels);
    message->insert(message->end(), header.begin(), header.end());
    message->insert(message->end(), pixels.begin(), pixels.end());
    tap.give_back();
    for (ConsoleSession* page : std::vector(hub.pages.begin(), hub.pages.end())) {
      if (page->wants_image(channel)) page->give_image(message);
    }
  }

  void take_replies() {
    while (const StatusReply* reply = context.console_replies.front()) {
      const auto text = std::make_shared<const std::string>(
          fmt::format(R"({{"type":"answer","ok":{},"command":"{}","text":{}}})",
                      reply->code == StatusCode::ok, protocol::command_name(reply->detail),
                      json_string(protocol::status_text(reply->code, reply->detail))));
      for (ConsoleSession* page : std::vector(hub.pages.begin(), hub.pages.end())) {
        if (page->page() == reply->origin.connection) page->give_answer(text);
      }
      context.console_replies.pop();
    }
  }

  void take_explanations() {
    while (auto explained = answers.explained()) {
      const auto text = std::make_shared<const std::string>(std::move(explained->json));
      for (ConsoleSession* page : std::vector(hub.pages.begin(), hub.pages.end())) {
        if (page->page() == explained->page) page->give_answer(text);
      }
    }
  }

  void run() noexcept {
    // Whoever works on frames goes first.
    ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
    // A request that there is no memory for ends; the next one gets its chance.
    while (!io.stopped()) {
      try {
        acceptor.resume();
        if (!watching) watch_bell();
        io.run();
      } catch (const std::exception&) {
        continue;
      }
    }
  }

  Context& context;
  ConsoleTap& tap;
  const Answers answers;
  const Options options;
  ConsoleHub hub;
  std::size_t asked_channel = 0;
  std::uint64_t sequence = 0;
  bool watching = false;
  asio::io_context io{1};
  ConnectionAcceptor acceptor{
      io, [this](tcp::socket socket, const SocketAddress& peer) { take(std::move(socket), peer); }};
  asio::steady_timer image_timer{io};
  asio::steady_timer status_timer{io};
  asio::posix::stream_descriptor bell{io};
  std::thread thread;
};

ConsoleServer::ConsoleServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

physics::Result<std::unique_ptr<ConsoleServer>> ConsoleServer::start(const SocketAddress& address,
                                                                     Context& context,
                                                                     ConsoleTap& tap,
                                                                     Answers answers,
                                                                     Options options) {
  try {
    auto impl = std::make_unique<Impl>(context, tap, std::move(answers), std::move(options));
    if (auto opened = impl->acceptor.open(address); !opened) {
      return tl::unexpected(std::move(opened.error()));
    }
    impl->bell.assign(::dup(context.bells.console.fd()));
    impl->thread = std::thread([raw = impl.get()] { raw->run(); });
    return std::unique_ptr<ConsoleServer>(new ConsoleServer(std::move(impl)));
  } catch (const std::exception& error) {
    return physics::make_error(physics::ErrorCode::io, to_string(address) + ": " + error.what());
  }
}

ConsoleServer::~ConsoleServer() {
  impl_->io.stop();
  impl_->thread.join();
  impl_->tap.open(false);
  impl_->context.axes.watched.store(false, std::memory_order_relaxed);
  // Connections end with the context, when the timers have gone.
  impl_->hub.pages_changed = [] {};
}

SocketAddress ConsoleServer::address() const noexcept {
  return impl_->acceptor.address();
}

}  // namespace emit::server
