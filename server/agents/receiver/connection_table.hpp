// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "agents/context.hpp"
#include "agents/receiver/host_sessions.hpp"
#include "agents/receiver/read_pace.hpp"
#include "agents/sender/sender_client.hpp"
#include "emit/protocol/control.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/ip_address.hpp"
#include "net/socket.hpp"
#include "rt/fd.hpp"

namespace emit::v1 {
class ControlRecord;
}

namespace emit::server {

/// A control connection of a host, a client or a recorder, or a free place in the table.
struct Connection {
  using Role = protocol::PeerRole;

  std::uint32_t index = 0;
  std::uint32_t generation = 0;
  TcpSocket socket;
  SocketAddress peer;
  protocol::IpAddress ip;
  Role role = Role::none;
  bool welcomed = false;
  bool closing = false;      ///< closes as soon as nobody else uses the descriptor
  bool flush_close = false;  ///< closes once the queued answers are sent
  bool lent = false;         ///< sender or recorder hold it (or its client) and must give it back
  bool write_lent = false;   ///< they write to the descriptor: nobody else may
  bool stuck = false;        ///< the conductor's ring is full: records wait in the parser
  bool paused = false;       ///< it sent more than its pace: records wait in the parser
  bool dirty = false;        ///< ConnectionTable::watch() must be called
  bool handshaking = false;  ///< TLS: neither side has proved itself yet
  bool reread = false;       ///< bytes wait where the descriptor does not show them
  bool agreed_key = false;   ///< the host sessions know the key of this connection
  std::uint32_t misbehaved = 0;
  ReadPace pace;
  std::int64_t since_ns = 0;                     ///< monotonic
  std::optional<protocol::RecordParser> parser;  ///< a large buffer, taken on connecting
  std::vector<std::byte> out;
  std::size_t out_sent = 0;
  std::unique_ptr<SenderClient> client;

  [[nodiscard]] bool open() const noexcept { return static_cast<bool>(socket); }
  /// Returns true while nothing is read: the peer's bytes wait in the parser and in the kernel.
  [[nodiscard]] bool waits() const noexcept { return stuck || paused; }
  /// Key of the connection on rings: the place in the table and how often it was used.
  [[nodiscard]] std::uint32_t key() const noexcept {
    return generation << kConnectionPlaceBits | index;
  }
  /// Fills a free place, except for the members that its new owner sets. Nothing of the previous
  /// connection is left.
  void begin() noexcept;
};

/// The places of all connections: the answers written to them, and their ends. Sender and recorder
/// borrow a descriptor and return it before it is closed. Thread: the receiver's. Real time: not
/// RT-safe, because answers allocate.
class ConnectionTable {
 public:
  explicit ConnectionTable(Context& context);

  /// Makes the places. Setup only.
  void make_places(std::uint32_t count);
  /// Sets the sessions from which keys of closed connections are removed; null: there are none.
  void set_host_sessions(HostSessions* sessions) noexcept { sessions_ = sessions; }
  [[nodiscard]] int epoll_fd() const noexcept { return epoll_.get(); }

  [[nodiscard]] std::vector<std::unique_ptr<Connection>>& all() noexcept { return connections_; }
  /// Returns a free place; null: all are taken.
  [[nodiscard]] Connection* free_place() noexcept;
  /// Returns the open connection with this key; null: it is closed.
  /// @pre the place of `key` exists
  [[nodiscard]] Connection* find(std::uint64_t key) noexcept;
  [[nodiscard]] std::size_t open_from(const protocol::IpAddress& peer) const noexcept;
  [[nodiscard]] std::size_t handshakes() const noexcept;

  /// Counts and logs a refusal, and answers it. `event_text` goes to the log in place of `text`
  /// where that holds values of the message.
  void refuse(Connection& connection, StatusCode code, const std::string& text,
              std::uint64_t host_frame_number = 0, std::string_view event_text = {});
  /// Does what refuse() does, and closes the connection once the answer is sent.
  void refuse_and_close(Connection& connection, StatusCode code, const std::string& text);
  void send_status(Connection& connection, StatusCode code, const std::string& text,
                   std::uint64_t host_frame_number, std::uint64_t count);
  void queue(Connection& connection, const v1::ControlRecord& record);
  void flush(Connection& connection) noexcept;
  void close(Connection& connection, std::string_view why) noexcept;
  void finish_close(Connection& connection) noexcept;
  /// Takes back the descriptors that sender and recorder have returned. Returns their number.
  int take_released() noexcept;
  /// Asks the kernel for the events that the connection waits for. Returns false when it refuses.
  [[nodiscard]] bool begin_watch(Connection& connection) noexcept;
  void watch(Connection& connection) noexcept;

 private:
  void released(std::uint32_t key) noexcept;

  Context& context_;
  Fd epoll_;
  std::vector<std::unique_ptr<Connection>> connections_;
  HostSessions* sessions_ = nullptr;
};

}  // namespace emit::server
