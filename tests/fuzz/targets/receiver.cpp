// SPDX-License-Identifier: Apache-2.0
// Fuzz target: the daemon's end of a connection and of the host port. Hello, subscriptions,
// commands and host frames reach the receiver, stepped on one thread. The input is a sequence of
// pieces, each behind a byte of instructions and its length (u16). Bits of the byte: 1 the piece is
// a datagram to the host port instead of bytes on the connection, 2 sender and recorder first
// return their connections, 4 the conductor takes nothing meanwhile, 8 the connection is reset
// right behind the piece and another one opened.
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <memory>
#include <vector>

#include "agents/receiver/receiver.hpp"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/sound_pose.hpp"
#include "support/fake_clock.hpp"

namespace {

using namespace emit;

void check(bool done, const char* what) {
  if (done) return;
  std::perror(what);
  std::exit(1);
}

/// Connects a socket. A signal (the fuzzer's own alarm, a debugger) may let connect() return early,
/// while the connection goes on.
bool connected(int fd, const server::SocketAddress& to) {
  if (::connect(fd, to.get(), to.length) == 0) return true;
  pollfd writable{fd, POLLOUT, 0};
  while (errno == EINTR) {
    if (::poll(&writable, 1, -1) == 1) return (writable.revents & (POLLERR | POLLHUP)) == 0;
  }
  return false;
}

/// Receiver whose neighbouring agents take everything and do nothing with it.
class Rig {
 public:
  Rig() : context_(clock_, 1u << 16, 4) {
    config_.host.udp = config_.control.tcp = "127.0.0.1:0";
    config_.control.max_clients = 4;
    config_.control.max_record_bytes = 4096;
    server::Channel channel;
    channel.sensor = "seeker";
    channel.band = "8-12";
    channel.width_px = channel.height_px = 8;
    context_.channels.push_back(channel);
    receiver_ = std::make_unique<server::Receiver>(context_, config_);
    check(receiver_->open() && receiver_->on_start(), "opening the ports");
    udp_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const server::SocketAddress host = receiver_->host_address();
    check(udp_ >= 0 && ::connect(udp_, host.get(), host.length) == 0,
          "connecting to the host port");
  }

  void connect() {
    tcp_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const server::SocketAddress control = receiver_->control_address();
    check(tcp_ >= 0 && connected(tcp_, control), "connecting");
    // The connection ends by a reset, because thousands of closed connections a second would use up
    // the ports.
    const linger abrupt{1, 0};
    ::setsockopt(tcp_, SOL_SOCKET, SO_LINGER, &abrupt, sizeof abrupt);
    step();
  }
  void give_back() {
    for (const server::ClientReleased& client : lent_to_sender_) {
      static_cast<void>(context_.from_sender.push(client));
    }
    for (const server::RecorderReleased& recorder : lent_to_recorder_) {
      static_cast<void>(context_.from_recorder.push(recorder));
    }
    lent_to_sender_.clear();
    lent_to_recorder_.clear();
  }
  void let_conductor_sleep(bool asleep) { conductor_sleeps_ = asleep; }
  void say(std::span<const std::byte> bytes) {
    static_cast<void>(::send(tcp_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL));
    step();
  }
  /// Sends bytes and closes, so that the receiver reads and answers them after the connection is
  /// gone.
  void say_and_reset(std::span<const std::byte> bytes) {
    static_cast<void>(::send(tcp_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL));
    ::close(tcp_);
    step();
    connect();
  }
  void datagram(std::span<const std::byte> bytes) {
    static_cast<void>(::send(udp_, bytes.data(), bytes.size(), MSG_DONTWAIT));
    step();
  }
  void disconnect() {
    ::close(tcp_);
    step();
    // The advance of the clock ends a connection that times out.
    clock_.advance(60'000'000'000);
    step();
  }

 private:
  /// Runs receiver and neighbours until none of them has work.
  void step() {
    for (int idle = 0; idle < 2;) {
      const int work = receiver_->do_work(clock_.tai_ns()) + play_the_others();
      idle = work == 0 ? idle + 1 : 0;
    }
  }

  int play_the_others() {
    int work = 0;
    while (server::HostInput* input = conductor_sleeps_ ? nullptr : context_.host_inputs.front()) {
      if (input->kind == server::HostInput::Kind::frame) fuzz::require_sound(input->frame);
      context_.host_inputs.pop();
      ++work;
    }
    for (; const server::ClientCommand* command = context_.to_sender.front(); ++work) {
      const server::ClientReleased client{command->connection, command->client};
      const bool add = command->kind == server::ClientCommand::Kind::add;
      context_.to_sender.pop();
      add ? lent_to_sender_.push_back(client) : give_back();
    }
    for (; const server::ResendCommand* command = context_.resends.front(); ++work) {
      for (const server::ClientReleased& lent : lent_to_sender_) {
        if (lent.connection == command->connection) {
          static_cast<void>(lent.client->ask_again(command->request));
        }
      }
      context_.resends.pop();
    }
    for (; const server::RecorderCommand* command = context_.to_recorder.front(); ++work) {
      const server::RecorderReleased recorder{command->connection};
      const bool add = command->kind == server::ClientCommand::Kind::add;
      context_.to_recorder.pop();
      add ? lent_to_recorder_.push_back(recorder) : give_back();
    }
    while (context_.receiver_events.ring().front() != nullptr) {
      context_.receiver_events.ring().pop();
    }
    return work;
  }

  test::FakeClock clock_;
  server::Context context_;
  config::DaemonConfig config_;
  std::unique_ptr<server::Receiver> receiver_;
  std::vector<server::ClientReleased> lent_to_sender_;
  std::vector<server::RecorderReleased> lent_to_recorder_;
  bool conductor_sleeps_ = false;
  int udp_ = -1;
  int tcp_ = -1;
};

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Rig rig;
  fuzz::InputReader input(fuzz::as_bytes(data, size));
  rig.connect();
  while (!input.empty()) {
    const auto instructions = input.number<std::uint8_t>();
    const auto piece = input.bytes(input.number<std::uint16_t>());
    if ((instructions & 2u) != 0) rig.give_back();
    rig.let_conductor_sleep((instructions & 4u) != 0);
    if ((instructions & 1u) != 0) {
      rig.datagram(piece);
    } else if ((instructions & 8u) != 0) {
      rig.say_and_reset(piece);
    } else if (!piece.empty()) {
      rig.say(piece);
    }
  }
  rig.let_conductor_sleep(false);
  rig.disconnect();
  return 0;
}
