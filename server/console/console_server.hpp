// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "console/console_tap.hpp"
#include "console/explainer.hpp"
#include "emit/physics/error.hpp"
#include "net/socket_address.hpp"

namespace emit::server {

/// Serves the operator's console: files of the page over HTTP, one request a connection, and a
/// WebSocket at /live with images, states and commands (docs/console.md). It runs on a thread of
/// its own with the lowest claim to the processor (nice 10), which no agent waits for.
///
/// Bounded: kMaxConnections at a time, further ones are closed at once; kMaxRequestBytes of
/// request, kMaxMessageBytes of message. A page gets an image only after it has said that it drew
/// the one before, so a slow browser lacks images and nobody else does.
class ConsoleServer {
 public:
  static constexpr int kMaxConnections = 16;
  static constexpr std::size_t kMaxRequestBytes = 8192;
  static constexpr std::size_t kMaxMessageBytes = 64;
  static constexpr std::int64_t kTimeoutNs = 10'000'000'000;

  /// Called on the server's thread.
  struct Answers {
    /// Answer to words about a replay.
    struct Replayed {
      bool ok = false;
      std::string text;
    };
    /// Whether this peer may connect; others are closed at once.
    std::function<bool(const SocketAddress&)> admits;
    /// Returns what a page is told first, JSON.
    /// @param local  the peer is on this host
    std::function<std::string(bool local)> hello;
    /// Returns what every page is told some times a second, JSON.
    std::function<std::string(std::size_t pages)> status;
    /// Returns the radiances of the temperature table of a channel, doubles, little endian; empty:
    /// it has none.
    std::function<std::string(std::size_t channel)> temperatures;
    /// Hands a command to the run. Returns why not; empty: it is on its way, and its answer comes
    /// through Context::console_replies.
    std::function<std::string(CommandKind command, bool local, std::uint32_t page)> command;
    /// Begins to explain a pixel. Returns why not; empty: the answer comes by `explained`. The
    /// channel exists; the rest is not checked.
    std::function<std::string(const ExplainRequest&)> explain;
    /// Returns an explanation that is done; it is asked when Doorbells::console rings.
    std::function<std::optional<Explained>()> explained;
    /// Takes words about the recording that is replayed. Empty function: nothing is replayed.
    std::function<Replayed(std::string_view words)> replay = {};
  };
  struct Options {
    double rate_hz = 10.0;           ///< images a second, all pages together
    std::vector<std::string> names;  ///< names of this host that a request may state
  };

  /// Opens the port and starts the thread. The context and the tap outlive the server.
  /// Errors (io): address in use and so on, naming it.
  [[nodiscard]] static physics::Result<std::unique_ptr<ConsoleServer>> start(
      const SocketAddress& address, Context& context, ConsoleTap& tap, Answers answers,
      Options options);
  /// Ends with whatever is under way cut off.
  ~ConsoleServer();

  [[nodiscard]] SocketAddress address() const noexcept;

 private:
  struct Impl;
  explicit ConsoleServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::server
