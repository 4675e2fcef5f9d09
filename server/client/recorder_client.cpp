// SPDX-License-Identifier: Apache-2.0
#include "client/client_connection.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/v1/control.pb.h"

namespace emit::client {
namespace {

class TcpRecorder final : public RecorderClient {
 public:
  explicit TcpRecorder(ClientConnection connection) : connection_(std::move(connection)) {}

  const ServerInfo& server() const noexcept override { return connection_.server(); }
  physics::Result<bool> receive(v1::JournalEntry& entry, std::int64_t timeout_ns) override {
    const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
    protocol::Record record;
    for (;;) {
      auto received = connection_.receive(record, end_ns);
      if (!received) {
        if (connection_.closed() && !closed()) {
          received.error().text +=
              " without the end of the journal: the daemon was killed or dropped this recorder";
        }
        return received;
      }
      if (!*received) {
        return received;
      }
      v1::ControlRecord message;
      if (record.kind != protocol::RecordKind::control ||
          !protocol::parse_control_record(record.body, message)) {
        continue;
      }
      if (message.has_journal()) {
        entry.Swap(message.mutable_journal());
        return true;
      }
      if (message.has_journal_gap()) {
        gap_ = {message.journal_gap().first_sequence(), message.journal_gap().last_sequence()};
      }
      ended_ = ended_ || message.has_journal_end();
    }
  }
  bool closed() const noexcept override {
    return connection_.closed() && (ended_ || !connection_.server().sends_journal_end);
  }
  const JournalGap& gap() const noexcept override { return gap_; }

 private:
  ClientConnection connection_;
  JournalGap gap_;
  bool ended_ = false;
};

}  // namespace

std::unique_ptr<RecorderClient> make_recorder(ClientConnection connection) {
  return std::make_unique<TcpRecorder>(std::move(connection));
}

physics::Result<std::unique_ptr<RecorderClient>> RecorderClient::connect(const std::string& url,
                                                                         std::int64_t timeout_ns,
                                                                         const Security& security) {
  const auto parsed = parse_url(url);
  if (!parsed) {
    return tl::unexpected<physics::Error>(physics::Error(parsed.error()));
  }
  if (parsed->scheme != Url::Scheme::tcp) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               "'" + url + "': the journal comes over tcp://host:port");
  }
  auto connection =
      ClientConnection::open(*parsed, protocol::PeerRole::recorder, timeout_ns, security);
  if (!connection) {
    return tl::unexpected<physics::Error>(std::move(connection.error()));
  }
  return make_recorder(std::move(*connection));
}

}  // namespace emit::client
