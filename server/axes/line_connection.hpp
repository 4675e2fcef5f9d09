// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "net/io_result.hpp"
#include "net/socket_address.hpp"
#include "rt/fd.hpp"

namespace emit::server {

/// TCP connection that begins and begins again without waiting, for texts that are short against
/// the buffers of the kernel.
///
/// Thread: one owner. Real time: RT-safe, with the system calls of a socket.
class LineConnection {
 public:
  enum class State : std::uint8_t { closed, connecting, connected };

  explicit LineConnection(const SocketAddress& peer) noexcept : peer_(peer) {}
  LineConnection(LineConnection&&) noexcept = default;
  LineConnection& operator=(LineConnection&&) noexcept = default;
  ~LineConnection() { close(); }

  /// Begins to connect where it is closed, at most once a second, or looks whether that has ended.
  State advance(std::int64_t now_ns) noexcept;
  [[nodiscard]] State state() const noexcept { return state_; }
  /// Returns the descriptor of an established connection, else -1.
  [[nodiscard]] int fd() const noexcept { return state_ == State::connected ? fd_.get() : -1; }

  /// @pre connected
  [[nodiscard]] IoResult read(std::span<char> space) noexcept;
  /// Writes the whole text, or fails: the peer has not read for long then.
  /// @pre connected
  [[nodiscard]] bool write(std::string_view text) noexcept;
  /// Ends the connection. What was written still arrives.
  void close() noexcept;

 private:
  void begin(std::int64_t now_ns) noexcept;
  void look(std::int64_t now_ns) noexcept;

  SocketAddress peer_;
  Fd fd_;
  State state_ = State::closed;
  bool began_once_ = false;
  std::int64_t began_ns_ = 0;  ///< when it began to connect last
};

}  // namespace emit::server
