// SPDX-License-Identifier: Apache-2.0
#include "net/tls_session.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <atomic>
#include <random>
#include <thread>

#include "rt/fd.hpp"
#include "support/certificates.hpp"
#include "support/daemon_process.hpp"
#include "support/heap_counter.hpp"

namespace emit::server {
namespace {

using Bytes = std::vector<std::byte>;

/// A daemon's and a client's end, joined, with the handshake done.
class TlsPair : public ::testing::Test {
 protected:
  void SetUp() override {
    const test::Authority rig("rig authority");
    rig.write(folder_.file("ca.pem"));
    rig.issue("emitd", "DNS:emitd", folder_.file("d.pem"), folder_.file("d.key"));
    rig.issue("viewer", "DNS:viewer.rig", folder_.file("c.pem"), folder_.file("c.key"));
    int pair[2] = {-1, -1};
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, pair), 0);
    near_fd_ = Fd(pair[0]);
    far_fd_ = Fd(pair[1]);
    const auto server =
        TlsContext::server({folder_.file("ca.pem"), folder_.file("d.pem"), folder_.file("d.key")});
    const auto client =
        TlsContext::client({folder_.file("ca.pem"), folder_.file("c.pem"), folder_.file("c.key")});
    ASSERT_TRUE(server.has_value()) << server.error().text;
    ASSERT_TRUE(client.has_value()) << client.error().text;
    near_ = std::move(*TlsSession::create(*server, near_fd_.get(), ""));
    far_ = std::move(*TlsSession::create(*client, far_fd_.get(), "emitd"));
    for (int i = 0; i < 10 && !(near_->established() && far_->established()); ++i) {
      if (!far_->established()) static_cast<void>(far_->handshake());
      if (!near_->established()) static_cast<void>(near_->handshake());
    }
    ASSERT_TRUE(near_->established() && far_->established()) << near_->error() << far_->error();
  }

  static IoResult write(TlsSession& session, std::span<const std::byte> bytes) {
    return session.write(std::span(&bytes, 1));
  }

  test::ScratchFolder folder_;
  Fd near_fd_;
  Fd far_fd_;
  std::unique_ptr<TlsSession> near_;
  std::unique_ptr<TlsSession> far_;
};

Bytes noise(std::size_t length) {
  std::mt19937 random(3);
  Bytes out(length);
  for (std::byte& byte : out) byte = static_cast<std::byte>(random());
  return out;
}

TEST_F(TlsPair, BothKnowTheOtherAndTheSameKey) {
  EXPECT_EQ(near_->peer_names(), (std::vector<std::string>{"viewer", "viewer.rig"}));
  std::array<std::byte, 32> here{};
  std::array<std::byte, 32> there{};
  EXPECT_TRUE(near_->export_key(here) && far_->export_key(there));
  EXPECT_EQ(here, there);
  EXPECT_NE(here, (std::array<std::byte, 32>{}));
}

// A frame is written in pieces that end anywhere, from memory that moves while half of it is sent.
TEST_F(TlsPair, AWriteThatMeetsAFullSocketGoesOnFromOtherMemory) {
  const Bytes sent = noise(3'000'000);
  Bytes moved = sent;
  Bytes got;
  std::array<std::byte, 65536> space;
  std::size_t offset = 0;
  bool blocked = false;
  while (got.size() < sent.size()) {
    const Bytes& from = blocked ? moved : sent;
    while (offset < sent.size()) {
      const std::array<std::span<const std::byte>, 2> pieces{
          std::span(from).subspan(offset, std::min<std::size_t>(700, sent.size() - offset)),
          std::span(from).subspan(std::min(offset + 700, sent.size()))};
      const IoResult result = near_->write(pieces);
      if (result.status == IoStatus::would_block) {
        blocked = true;
        break;
      }
      ASSERT_EQ(result.status, IoStatus::done) << result.error;
      offset += result.bytes;
    }
    for (;;) {
      const IoResult result = far_->read(space);
      if (result.status != IoStatus::done) break;
      got.insert(got.end(), space.begin(),
                 space.begin() + static_cast<std::ptrdiff_t>(result.bytes));
    }
  }
  EXPECT_TRUE(blocked);
  EXPECT_EQ(got, sent);
}

TEST_F(TlsPair, OneThreadReadsWhileTheOtherWrites) {
  const Bytes down = noise(8'000'000);
  const Bytes up = noise(500'000);
  std::atomic<bool> failed{false};
  const auto send_all = [&](TlsSession& session, const Bytes& bytes) {
    for (std::size_t offset = 0; offset < bytes.size() && !failed;) {
      const IoResult result = write(session, std::span(bytes).subspan(offset));
      if (result.status == IoStatus::done) {
        offset += result.bytes;
      } else if (result.status == IoStatus::failed || result.status == IoStatus::closed) {
        failed = true;
      } else {
        std::this_thread::yield();
      }
    }
  };
  const auto read_all = [&](TlsSession& session, const Bytes& expected) {
    Bytes got;
    std::array<std::byte, 5000> space;
    while (got.size() < expected.size() && !failed) {
      const IoResult result = session.read(space);
      if (result.status == IoStatus::done) {
        got.insert(got.end(), space.begin(),
                   space.begin() + static_cast<std::ptrdiff_t>(result.bytes));
      } else if (result.status == IoStatus::failed || result.status == IoStatus::closed) {
        failed = true;
      } else {
        std::this_thread::yield();
      }
    }
    if (got != expected) failed = true;
  };
  // Sender and receiver of the daemon share one session, and so do both threads of the client.
  std::thread sender([&] { send_all(*near_, down); });
  std::thread receiver([&] { read_all(*near_, up); });
  std::thread client_sender([&] { send_all(*far_, up); });
  read_all(*far_, down);
  sender.join();
  receiver.join();
  client_sender.join();
  EXPECT_FALSE(failed);
}

// Plain connections take no memory. The memory that OpenSSL takes is bounded and documented.
TEST_F(TlsPair, ReadingAndWritingTakeAtMostTwoBlocksOfMemoryARecord) {
  const Bytes frame = noise(4 * 16'384);
  std::array<std::byte, 65536> space;
  const auto pass = [&] {
    std::size_t got = 0;
    std::size_t offset = 0;
    while (got < frame.size()) {
      if (offset < frame.size()) offset += write(*near_, std::span(frame).subspan(offset)).bytes;
      got += far_->read(space).bytes;
    }
  };
  pass();
  constexpr std::uint64_t kPasses = 50;
  constexpr std::uint64_t kRecordsAPass = 4;
  const std::uint64_t before = test::heap_request_count();
  for (std::uint64_t i = 0; i < kPasses; ++i) pass();
  EXPECT_LE(test::heap_request_count() - before, 2 * 2 * kPasses * kRecordsAPass);
}

TEST_F(TlsPair, TheEndIsToldFromACut) {
  std::array<std::byte, 10> space;
  near_.reset();
  EXPECT_EQ(far_->read(space).status, IoStatus::closed);
}

TEST_F(TlsPair, ACutIsAFailure) {
  std::array<std::byte, 10> space;
  ::shutdown(near_fd_.get(), SHUT_RDWR);
  EXPECT_EQ(far_->read(space).status, IoStatus::failed);
}

}  // namespace
}  // namespace emit::server
