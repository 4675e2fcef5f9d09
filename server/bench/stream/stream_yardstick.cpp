// SPDX-License-Identifier: Apache-2.0
#include "bench/stream/stream_yardstick.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <fstream>
#include <optional>
#include <span>
#include <sstream>
#include <thread>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#include "rt/fd.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using server::Fd;
using Clock = std::chrono::steady_clock;

#ifndef UDP_SEGMENT
constexpr int UDP_SEGMENT = 103;
#endif
#ifndef UDP_GRO
constexpr int UDP_GRO = 104;
#endif

/// Number of images: the canned source shows as many in turn, so that the same amount of memory is
/// read.
constexpr std::size_t kImages = 16;

double thread_cpu_s() {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

tl::unexpected<physics::Error> io_error(const char* what) {
  return make_error(ErrorCode::io, fmt::format("yardstick: {}: {}", what, std::strerror(errno)));
}

std::vector<std::vector<std::byte>> make_images(std::size_t bytes) {
  std::vector<std::vector<std::byte>> images(kImages);
  for (std::size_t i = 0; i < images.size(); ++i) {
    images[i].assign(bytes, static_cast<std::byte>(i + 1));
  }
  return images;
}

const sockaddr* as_sockaddr(const sockaddr_in& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

/// Opens a socket on a free port of 127.0.0.1; invalid when there is none.
Fd bound_socket(int type, sockaddr_in& address) {
  Fd fd(::socket(AF_INET, type | SOCK_CLOEXEC, 0));
  address = {};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  if (!fd || ::bind(fd.get(), as_sockaddr(address), length) != 0 ||
      ::getsockname(fd.get(), reinterpret_cast<sockaddr*>(&address), &length) != 0) {
    return {};
  }
  return fd;
}

struct TcpPair {
  Fd sender;
  Fd receiver;
};

physics::Result<TcpPair> tcp_pair() {
  sockaddr_in address{};
  const Fd listener = bound_socket(SOCK_STREAM, address);
  TcpPair out;
  out.receiver = Fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (!listener || ::listen(listener.get(), 1) != 0 || !out.receiver ||
      ::connect(out.receiver.get(), as_sockaddr(address), sizeof(address)) != 0) {
    return io_error("loopback TCP");
  }
  out.sender = Fd(::accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC));
  if (!out.sender) return io_error("accept");
  const int on = 1;
  ::setsockopt(out.sender.get(), IPPROTO_TCP, 1 /* TCP_NODELAY */, &on, sizeof(on));
  return out;
}

bool send_all(int fd, std::span<const std::byte> bytes, int flags = 0) {
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t sent = ::send(fd, bytes.data() + at, bytes.size() - at, MSG_NOSIGNAL | flags);
    if (sent <= 0) return false;
    at += static_cast<std::size_t>(sent);
  }
  return true;
}

/// Receives bytes. `crc32c`, unless null, gets their sum, computed while they are in the cache.
bool receive_all(int fd, std::span<std::byte> bytes, std::uint32_t* crc32c = nullptr) {
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t got = ::recv(fd, bytes.data() + at, bytes.size() - at, 0);
    if (got <= 0) return false;
    const auto count = static_cast<std::size_t>(got);
    if (crc32c != nullptr) *crc32c = protocol::crc32c(bytes.subspan(at, count), *crc32c);
    at += count;
  }
  return true;
}

}  // namespace

physics::Result<YardstickResult> measure_bare_tcp(const YardstickOptions& options, bool sum) {
  auto pair = tcp_pair();
  if (!pair) return tl::unexpected(pair.error());
  const auto images = make_images(options.frame_bytes);
  std::vector<std::byte> frame(options.frame_bytes);
  YardstickResult result;
  double sender_cpu_s = 0.0;
  const auto start = Clock::now();
  const double cpu_before_s = thread_cpu_s();
  std::thread sender([&] {
    for (std::uint64_t i = 0; i < options.frames; ++i) {
      const std::vector<std::byte>& image = images[i % kImages];
      const std::uint32_t crc32c = sum ? protocol::crc32c(image) : 0;
      const auto head = std::as_bytes(std::span(&crc32c, 1));
      if (sum && !send_all(pair->sender.get(), head, MSG_MORE)) break;
      if (!send_all(pair->sender.get(), image)) break;
    }
    sender_cpu_s = thread_cpu_s();
  });
  while (result.frames < options.frames) {
    std::uint32_t sent_crc32c = 0;
    std::uint32_t crc32c = 0;
    const int fd = pair->receiver.get();
    if (sum && !receive_all(fd, std::as_writable_bytes(std::span(&sent_crc32c, 1)))) break;
    if (!receive_all(fd, frame, sum ? &crc32c : nullptr)) break;
    if (crc32c != sent_crc32c) ++result.lost;
    ++result.frames;
  }
  result.seconds = seconds_since(start);
  sender.join();
  result.cpu_s = thread_cpu_s() - cpu_before_s + sender_cpu_s;
  if (result.frames < options.frames) return io_error("TCP ended early");
  return result;
}

namespace {

/// Sends one frame's datagrams, as many per call as segmentation takes. It returns false when the
/// kernel refuses.
bool send_segmented(int fd, const std::vector<std::byte>& bytes, std::uint32_t datagram_bytes) {
  constexpr std::size_t kMaxCallBytes = 65507;
  const std::size_t per_call =
      std::min<std::size_t>(kMaxCallBytes / datagram_bytes, 64) * datagram_bytes;
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof(std::uint16_t))> control{};
  for (std::size_t at = 0; at < bytes.size(); at += per_call) {
    // The kernel only reads the memory of iov_base in sendmsg().
    iovec iov{const_cast<std::byte*>(bytes.data()) + at, std::min(per_call, bytes.size() - at)};
    msghdr message{};
    message.msg_iov = &iov;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    cmsghdr* header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_UDP;
    header->cmsg_type = UDP_SEGMENT;
    header->cmsg_len = CMSG_LEN(sizeof(std::uint16_t));
    const auto segment = static_cast<std::uint16_t>(datagram_bytes);
    std::memcpy(CMSG_DATA(header), &segment, sizeof(segment));
    if (::sendmsg(fd, &message, MSG_NOSIGNAL) < 0) return false;
  }
  return true;
}

/// Receives datagrams and counts their bytes.
class BareReceiver {
 public:
  explicit BareReceiver(int fd) : fd_(fd), data_(kBatch * kBytes) {}

  /// Returns the bytes of one call; 0 when nothing came within the socket's timeout.
  std::size_t take() {
    std::array<mmsghdr, kBatch> messages{};
    std::array<iovec, kBatch> iov{};
    for (std::size_t i = 0; i < kBatch; ++i) {
      iov[i] = {data_.data() + i * kBytes, kBytes};
      messages[i].msg_hdr.msg_iov = &iov[i];
      messages[i].msg_hdr.msg_iovlen = 1;
    }
    const int count = ::recvmmsg(fd_, messages.data(), kBatch, MSG_WAITFORONE, nullptr);
    std::size_t bytes = 0;
    for (int i = 0; i < count; ++i) bytes += messages[static_cast<std::size_t>(i)].msg_len;
    return bytes;
  }

 private:
  static constexpr std::size_t kBatch = 16;
  static constexpr std::size_t kBytes = 65536;
  int fd_;
  std::vector<std::byte> data_;
};

struct UdpPair {
  Fd sender;
  Fd receiver;
};

physics::Result<UdpPair> udp_pair(std::size_t buffer_bytes) {
  sockaddr_in address{};
  UdpPair out;
  out.receiver = bound_socket(SOCK_DGRAM, address);
  out.sender = Fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (!out.receiver || !out.sender ||
      ::connect(out.sender.get(), as_sockaddr(address), sizeof(address)) != 0) {
    return io_error("loopback UDP");
  }
  const int on = 1;
  const int bytes = static_cast<int>(buffer_bytes);
  const timeval timeout{0, 500'000};
  ::setsockopt(out.receiver.get(), SOL_UDP, UDP_GRO, &on, sizeof(on));
  ::setsockopt(out.receiver.get(), SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof(timeout));
  ::setsockopt(out.receiver.get(), SOL_SOCKET, SO_RCVBUF, &bytes, sizeof(bytes));
  ::setsockopt(out.receiver.get(), SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof(bytes));
  ::setsockopt(out.sender.get(), SOL_SOCKET, SO_SNDBUF, &bytes, sizeof(bytes));
  return out;
}

}  // namespace

physics::Result<YardstickResult> measure_bare_udp(const YardstickOptions& options) {
  auto pair = udp_pair(2 * options.window * options.frame_bytes);
  if (!pair) return tl::unexpected(pair.error());
  const std::size_t payload = options.datagram_bytes - 32;  // emitd's has a header in front
  const std::size_t datagrams = (options.frame_bytes + payload - 1) / payload;
  const std::size_t bytes = datagrams * options.datagram_bytes;
  const auto images = make_images(bytes);
  std::atomic<std::uint64_t> received{0};  // frames; as far behind as `window` the sender waits
  std::atomic<bool> over{false};
  YardstickResult result;
  double sender_cpu_s = 0.0;
  const auto start = Clock::now();
  const double cpu_before_s = thread_cpu_s();
  std::thread sender([&] {
    for (std::uint64_t i = 0; i < options.frames && !over.load(); ++i) {
      for (std::uint64_t done = received.load(); i - done >= options.window && !over.load();
           done = received.load()) {
        received.wait(done);
      }
      if (!send_segmented(pair->sender.get(), images[i % kImages], options.datagram_bytes)) break;
    }
    sender_cpu_s = thread_cpu_s();
  });
  BareReceiver receiver(pair->receiver.get());
  std::uint64_t got = 0;
  while (got < options.frames * bytes) {
    const std::size_t some = receiver.take();
    if (some == 0) break;
    got += some;
    if (const std::uint64_t whole = got / bytes; whole != received.load()) {
      received.store(whole);
      received.notify_one();
    }
  }
  result.seconds = seconds_since(start);
  over.store(true);
  received.fetch_add(1);
  received.notify_one();
  sender.join();
  result.cpu_s = thread_cpu_s() - cpu_before_s + sender_cpu_s;
  result.frames = got / bytes;
  result.lost = options.frames - result.frames;
  return result;
}

physics::Result<BareDelays> measure_bare_delays(const YardstickOptions& options,
                                                std::uint32_t clients, double rate_hz) {
  std::vector<TcpPair> pairs;
  for (std::uint32_t i = 0; i < clients; ++i) {
    auto pair = tcp_pair();
    if (!pair) return tl::unexpected(pair.error());
    pairs.push_back(std::move(*pair));
  }
  const auto images = make_images(options.frame_bytes);
  const auto frames = static_cast<std::size_t>(options.frames);
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / rate_hz));
  const auto us = [](Clock::duration time) {
    return std::chrono::duration<double, std::micro>(time).count();
  };
  BareDelays out;
  std::vector<Clock::time_point> ready(frames);
  std::vector<std::vector<Clock::time_point>> arrived(clients);
  std::vector<std::thread> receivers;
  for (std::uint32_t i = 0; i < clients; ++i) {
    arrived[i].reserve(frames);
    receivers.emplace_back([&, i] {
      std::vector<std::byte> frame(options.frame_bytes);
      while (arrived[i].size() < frames && receive_all(pairs[i].receiver.get(), frame)) {
        arrived[i].push_back(Clock::now());
        // The clients of emitd sum the bytes too, so the cores are equally busy.
        static_cast<void>(protocol::crc32c(frame));
      }
    });
  }
  std::atomic<std::size_t> published{0};
  std::thread sender([&] {
    for (std::size_t k = 0; k < frames; ++k) {
      for (std::size_t seen = published.load(); seen <= k; seen = published.load()) {
        published.wait(seen);
      }
      // Every client gets its first piece before the rest follows.
      const std::span<const std::byte> image(images[k % kImages]);
      const auto first = image.first(std::min<std::size_t>(image.size(), 64u << 10));
      for (const TcpPair& pair : pairs) {
        out.own_us.add(us(Clock::now() - ready[k]));
        static_cast<void>(send_all(pair.sender.get(), first));
      }
      for (const TcpPair& pair : pairs) {
        static_cast<void>(send_all(pair.sender.get(), image.subspan(first.size())));
      }
    }
  });
  const auto start = Clock::now() + period;
  for (std::size_t k = 0; k < frames; ++k) {
    std::this_thread::sleep_until(start + static_cast<Clock::rep>(k) * period);
    ready[k] = Clock::now();
    published.store(k + 1);
    published.notify_one();
  }
  sender.join();
  for (std::thread& receiver : receivers) receiver.join();
  for (const auto& times : arrived) {
    for (std::size_t k = 0; k < times.size(); ++k) out.delay_us.add(us(times[k] - ready[k]));
  }
  return out;
}

double process_cpu_s() noexcept {
  timespec t{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

namespace {

/// Returns the number behind "bits_per_second" in the object of that name.
std::optional<double> bits_per_second(const std::string& json, const std::string& object) {
  const std::size_t at = json.find('"' + object + '"');
  const std::string key = "\"bits_per_second\":";
  const std::size_t value = at == std::string::npos ? at : json.find(key, at);
  if (value == std::string::npos) return std::nullopt;
  return std::strtod(json.c_str() + value + key.size(), nullptr);
}

}  // namespace

physics::Result<double> measure_iperf3_gbit_s(const std::filesystem::path& directory, int seconds) {
  sockaddr_in address{};
  if (!bound_socket(SOCK_STREAM, address)) return io_error("a free port");
  const std::string port = fmt::format("{}", ntohs(address.sin_port));
  auto server =
      Subprocess::start({"/usr/bin/env", "iperf3", "-s", "-1", "-B", "127.0.0.1", "-p", port},
                        directory / "iperf3-server.log");
  if (!server) return tl::unexpected(server.error());
  constexpr int kNotFound = 127;  // of env
  if (server->wait(std::chrono::milliseconds(300)) == kNotFound) {
    return make_error(ErrorCode::not_found, "iperf3 is not installed");
  }
  const auto log = directory / "iperf3.json";
  auto client = Subprocess::start({"/usr/bin/env", "iperf3", "-c", "127.0.0.1", "-p", port, "-t",
                                   fmt::format("{}", seconds), "-J"},
                                  log);
  if (!client) return tl::unexpected(client.error());
  const auto status = client->wait(std::chrono::seconds(seconds + 20));
  std::ifstream file(log);
  std::ostringstream text;
  text << file.rdbuf();
  const auto bits = bits_per_second(text.str(), "sum_received");
  if (status != 0 || !bits) return make_error(ErrorCode::io, "iperf3 did not end with a result");
  return 1e-9 * *bits;
}

}  // namespace emit::tool
