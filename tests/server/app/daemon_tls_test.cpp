// SPDX-License-Identifier: Apache-2.0
// Mutual TLS on the control port and keys agreed over it, against a real emitd.
#include <gtest/gtest.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <optional>

#include "client/client_connection.hpp"
#include "client/http_get.hpp"
#include "emit/client/client.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/host_session.hpp"
#include "emit/v1/control.pb.h"
#include "rt/fd.hpp"
#include "support/certificates.hpp"
#include "support/daemon_process.hpp"
#include "support/exposition.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;

using emit::test::kLongNs;
using emit::test::kSecondNs;

protocol::HostFrameData host_frame(std::uint64_t number) {
  protocol::HostFrameData frame;
  frame.frame_number = number;
  frame.sim_time_ns = static_cast<std::int64_t>(number) * 5'000'000;
  frame.run_id = 1;
  return frame;
}

class DaemonTls : public ::testing::Test {
 protected:
  DaemonTls() {
    rig_.write(folder_.file("ca.pem"));
    other_.write(folder_.file("other_ca.pem"));
    rig_.issue("emitd", "IP:127.0.0.1,DNS:emitd.rig", folder_.file("d.pem"), folder_.file("d.key"));
    rig_.issue("viewer", "DNS:viewer.rig", folder_.file("c.pem"), folder_.file("c.key"));
    other_.issue("viewer", "DNS:viewer.rig", folder_.file("x.pem"), folder_.file("x.key"));
  }

  void start(const std::string& tls = {}, const std::string& more = {},
             std::uint32_t width_px = 64) {
    const std::string text =
        canned_config(width_px, 48, "mode = \"host-step\"",
                      "[metrics]\nlisten = \"127.0.0.1:0\"\n[tls]\ncertificate = \"d.pem\"\n"
                      "key = \"d.key\"\nclient_ca = \"ca.pem\"\n" +
                          tls + more);
    daemon_.emplace(folder_,
                    std::vector<std::string>{"--config", folder_.write("emitd.toml", text)});
    ASSERT_TRUE(daemon_->wait_ready()) << folder_.read("stderr");
  }
  client::Security client(const std::string& name = "c", const std::string& ca = "ca.pem") {
    client::Security out;
    out.tls_ca = folder_.file(ca);
    out.tls_certificate = folder_.file(name + ".pem");
    out.tls_key = folder_.file(name + ".key");
    return out;
  }
  std::string url() { return "tcp://" + daemon_->control(); }
  double metric(const std::string& name) {
    const auto page = client::http_get("http://" + daemon_->metrics() + "/metrics", kLongNs);
    return page ? test::Exposition(page->body).value("emitd_" + name + "_total") : -1.0;
  }
  /// The daemon counts after the client has seen the end.
  bool wait_metric(const std::string& name, double at_least) {
    for (int i = 0; i < 500 && metric(name) < at_least; ++i) ::usleep(10'000);
    return metric(name) >= at_least;
  }
  /// Sends poses and receives their frames, one after the other.
  void expect_frames(client::FrameClient& client, client::HostClient& host, std::uint64_t first,
                     std::uint64_t count) {
    for (std::uint64_t k = first; k < first + count; ++k) {
      ASSERT_TRUE(host.send(host_frame(k)).has_value());
      const auto frame = client.receive(kLongNs);
      ASSERT_TRUE(frame.has_value()) << frame.error().text;
      ASSERT_NE(*frame, nullptr) << folder_.read("stderr");
      EXPECT_EQ((*frame)->header.host_frame_number, k);
      EXPECT_EQ(protocol::crc32c(std::as_bytes((*frame)->pixels)), (*frame)->header.payload_crc32c);
    }
  }

  test::ScratchFolder folder_;
  test::Authority rig_{"rig authority"};
  test::Authority other_{"somebody else"};
  std::optional<DaemonProcess> daemon_;
};

TEST_F(DaemonTls, ClientHostAndRecorderWorkThroughIt) {
  // The image is wide enough that a frame takes many TLS records and does not fit into the socket.
  start({}, {}, 16384);
  auto client = client::FrameClient::connect(url(), kLongNs, this->client());
  ASSERT_TRUE(client.has_value()) << client.error().text;
  ASSERT_TRUE((*client)->subscribe({}).has_value());
  auto recorder = client::RecorderClient::connect(url(), kLongNs, this->client());
  ASSERT_TRUE(recorder.has_value()) << recorder.error().text;
  auto host = client::HostClient::connect(url(), kLongNs, this->client());
  ASSERT_TRUE(host.has_value()) << host.error().text;
  expect_frames(**client, **host, 1, 20);
  int frames = 0;
  v1::JournalEntry entry;
  while (frames < 20) {
    const auto received = (*recorder)->receive(entry, kLongNs);
    ASSERT_TRUE(received.has_value() && *received);
    frames += entry.has_frame() ? 1 : 0;
  }
  EXPECT_EQ((*client)->counters().crc_errors, 0U);
  EXPECT_EQ(metric("handshakes_done"), 3.0);
  daemon_->signal(SIGTERM);
  for (;;) {
    const auto received = (*recorder)->receive(entry, kLongNs);
    if (!received) break;
    ASSERT_TRUE(*received) << "no end within the time";
  }
  EXPECT_TRUE((*recorder)->closed()) << "not told that the journal is complete";
  EXPECT_EQ(daemon_->wait(), 0) << folder_.read("stderr");
}

TEST_F(DaemonTls, WhoeverCannotProveWhoItIsGetsNothing) {
  start();
  {
    SCOPED_TRACE("plain text");
    const auto plain = client::FrameClient::connect(url(), kLongNs);
    EXPECT_FALSE(plain.has_value());
    EXPECT_TRUE(wait_metric("handshakes_failed", 1));
  }
  {
    SCOPED_TRACE("certificate of another authority");
    const auto wrong = client::FrameClient::connect(url(), kLongNs, client("x"));
    ASSERT_FALSE(wrong.has_value());
    EXPECT_TRUE(wait_metric("handshakes_failed", 2));
  }
  {
    SCOPED_TRACE("the daemon is not who the client expects");
    const auto wrong = client::FrameClient::connect(url(), kLongNs, client("c", "other_ca.pem"));
    ASSERT_FALSE(wrong.has_value());
    EXPECT_NE(wrong.error().text.find("TLS"), std::string::npos) << wrong.error().text;
    EXPECT_TRUE(wait_metric("handshakes_failed", 3));
    client::Security named = client();
    named.tls_name = "other.rig";
    EXPECT_FALSE(client::FrameClient::connect(url(), kLongNs, named).has_value());
    named.tls_name = "emitd.rig";
    EXPECT_TRUE(client::FrameClient::connect(url(), kLongNs, named).has_value());
  }
  EXPECT_EQ(metric("handshakes_done"), 1.0);
  EXPECT_EQ(metric("frames_sent"), 0.0);
}

/// A TLS client apart from the product's: of any version, with or without a certificate.
class ForeignTls {
 public:
  ForeignTls(int version, const std::string& certificate, const std::string& key)
      : context_(SSL_CTX_new(TLS_client_method())) {
    SSL_CTX_set_min_proto_version(context_, version);
    SSL_CTX_set_max_proto_version(context_, version);
    if (!certificate.empty()) {
      SSL_CTX_use_certificate_file(context_, certificate.c_str(), SSL_FILETYPE_PEM);
      SSL_CTX_use_PrivateKey_file(context_, key.c_str(), SSL_FILETYPE_PEM);
    }
  }
  ~ForeignTls() {
    SSL_free(ssl_);
    SSL_CTX_free(context_);
    if (fd_ >= 0) ::close(fd_);
  }
  ForeignTls(const ForeignTls&) = delete;
  ForeignTls& operator=(const ForeignTls&) = delete;

  /// Returns the bytes that the daemon answers to a hello; none unless it accepted this client.
  int answer_to_hello(const std::string& where) {
    const auto address = resolve(*parse_host_port(where), Transport::tcp, false);
    fd_ = ::socket(address->storage.ss_family, SOCK_STREAM, 0);
    const timeval limit{30, 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    if (::connect(fd_, address->get(), address->length) != 0) return -1;
    ssl_ = SSL_new(context_);
    SSL_set_fd(ssl_, fd_);
    if (SSL_connect(ssl_) != 1) return 0;
    v1::ControlRecord hello;
    hello.mutable_hello()->set_protocol_version(1);
    hello.mutable_hello()->set_role(v1::Hello::ROLE_CLIENT);
    std::vector<std::byte> bytes;
    protocol::append_control_record(hello, bytes);
    SSL_write(ssl_, bytes.data(), static_cast<int>(bytes.size()));
    char space[4096];
    return std::max(SSL_read(ssl_, space, sizeof space), 0);
  }

 private:
  SSL_CTX* context_;
  SSL* ssl_ = nullptr;
  int fd_ = -1;
};

TEST_F(DaemonTls, NoOtherVersionAndNobodyWithoutACertificate) {
  start();
  const std::string certificate = folder_.file("c.pem");
  const std::string key = folder_.file("c.key");
  std::signal(SIGPIPE, SIG_IGN);
  EXPECT_GT(ForeignTls(TLS1_3_VERSION, certificate, key).answer_to_hello(daemon_->control()), 0);
  EXPECT_EQ(ForeignTls(TLS1_2_VERSION, certificate, key).answer_to_hello(daemon_->control()), 0);
  EXPECT_EQ(ForeignTls(TLS1_3_VERSION, "", "").answer_to_hello(daemon_->control()), 0);
  EXPECT_TRUE(wait_metric("handshakes_failed", 2));
  EXPECT_EQ(metric("handshakes_done"), 1.0);
}

TEST_F(DaemonTls, OnlyNamesOfTheListConnect) {
  rig_.issue("intruder", "DNS:intruder.rig", folder_.file("i.pem"), folder_.file("i.key"));
  start("allow_names = [\"viewer.rig\"]\n");
  EXPECT_TRUE(client::FrameClient::connect(url(), kLongNs, client()).has_value());
  EXPECT_FALSE(client::FrameClient::connect(url(), kLongNs, client("i")).has_value());
  EXPECT_TRUE(wait_metric("handshakes_failed", 1));
  daemon_->signal(SIGTERM);
  EXPECT_EQ(daemon_->wait(), 0);
  EXPECT_NE(folder_.read("stderr").find("not in tls.allow_names: intruder, intruder.rig"),
            std::string::npos)
      << folder_.read("stderr");
}

TEST_F(DaemonTls, StalledHandshakesAreLimitedAndDoNotKeepOthersOut) {
  start("max_handshakes = 2\n");
  const auto address = resolve(*parse_host_port(daemon_->control()), Transport::tcp, false);
  std::vector<Fd> stalled;
  for (int i = 0; i < 3; ++i) {
    stalled.emplace_back(::socket(address->storage.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    ASSERT_EQ(::connect(stalled.back().get(), address->get(), address->length), 0);
  }
  EXPECT_TRUE(wait_metric("handshakes_refused", 1));
  stalled.clear();
  EXPECT_TRUE(wait_metric("handshakes_failed", 2));
  EXPECT_TRUE(client::FrameClient::connect(url(), kLongNs, client()).has_value());
}

TEST_F(DaemonTls, HostDatagramsTakeAKeyAgreedOverIt) {
  start();
  auto client = client::FrameClient::connect(url(), kLongNs, this->client());
  ASSERT_TRUE(client.has_value()) << client.error().text;
  ASSERT_TRUE((*client)->subscribe({}).has_value());
  client::Security security = this->client();
  security.control = url();
  const std::string udp = "udp://" + daemon_->host_udp();
  auto host = client::HostClient::connect(udp, kLongNs, security);
  ASSERT_TRUE(host.has_value()) << host.error().text;
  expect_frames(**client, **host, 1, 10);
  EXPECT_EQ(metric("host_sessions"), 1.0);

  // Refusals come back with a MAC.
  ASSERT_TRUE((*host)->send(host_frame(3)).has_value());
  const auto status = (*host)->receive_status(kLongNs);
  ASSERT_TRUE(status.has_value() && status->has_value());
  EXPECT_EQ((*status)->code, 7U) << (*status)->text;

  // Bare datagrams are dropped without an answer.
  auto bare = client::HostClient::connect(udp, kLongNs);
  ASSERT_TRUE(bare.has_value());
  ASSERT_TRUE((*bare)->send(host_frame(11)).has_value());
  EXPECT_TRUE(wait_metric("host_unauthenticated", 1));
  const auto nothing = (*bare)->receive_status(0);
  EXPECT_TRUE(nothing.has_value() && !nothing->has_value());
  expect_frames(**client, **host, 11, 2);

  // The key ends with the connection over which it was agreed.
  host->reset();
  EXPECT_TRUE(wait_metric("connections_closed", 1));
  EXPECT_EQ(metric("host_frames_accepted"), 12.0);
}

TEST(DaemonSecrets, FilesThatOthersMayReadAndHalfConfigurationsExit78) {
  test::ScratchFolder folder;
  const test::Authority rig("rig authority");
  rig.write(folder.file("ca.pem"));
  rig.issue("emitd", "DNS:emitd", folder.file("d.pem"), folder.file("d.key"));
  rig.issue("other", "DNS:other", folder.file("o.pem"), folder.file("o.key"));
  folder.write("k", std::string(64, 'a'));
  const std::string base = canned_config(64, 48, "mode = \"host-step\"");
  const std::string tls =
      "[tls]\nclient_ca = \"ca.pem\"\nkey = \"d.key\"\ncertificate = \"d.pem\"\n";
  const auto expect_78 = [&](const std::string& text, const std::string& reason) {
    DaemonProcess daemon(folder, {"--config", folder.write("emitd.toml", text)});
    EXPECT_EQ(daemon.wait(), 78) << text;
    EXPECT_NE(folder.read("stderr").find(reason), std::string::npos) << folder.read("stderr");
  };
  ::chmod(folder.file("d.key").c_str(), 0604);
  expect_78(base + tls, "open to others (mode 0604)");
  ::chmod(folder.file("d.key").c_str(), 0640);
  ::chmod(folder.file("k").c_str(), 0644);
  const std::string keyed =
      "[host]\nudp = \"127.0.0.1:0\"\nkey_file = \"k\"\n"
      "[source]\nkind = \"canned\"\n[control]\ntcp = \"127.0.0.1:0\"\n";
  expect_78(keyed, "host.key_file");
  ::chmod(folder.file("k").c_str(), 0600);
  folder.write("k", "secret");
  expect_78(keyed, "line 1: a key has 64 hexadecimal digits");
  expect_78(base + "[tls]\nclient_ca = \"ca.pem\"\nkey = \"o.key\"\ncertificate = \"d.pem\"\n",
            "o.key: key values mismatch");
  expect_78(base + "[tls]\nclient_ca = \"no.pem\"\nkey = \"d.key\"\ncertificate = \"d.pem\"\n",
            "no.pem");
}

}  // namespace
}  // namespace emit::server
