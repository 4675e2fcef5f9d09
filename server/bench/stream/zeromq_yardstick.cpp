// SPDX-License-Identifier: Apache-2.0
#include "bench/stream/stream_yardstick.hpp"

#if defined(EMIT_HAVE_ZEROMQ)
#include <zmq.h>

#include <array>
#include <chrono>
#include <cstring>
#include <memory>
#include <span>
#include <thread>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#endif

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;

#if defined(EMIT_HAVE_ZEROMQ)

namespace {

struct EndContext {
  void operator()(void* context) const noexcept { zmq_ctx_term(context); }
};
struct CloseSocket {
  void operator()(void* socket) const noexcept { zmq_close(socket); }
};
using Context = std::unique_ptr<void, EndContext>;
using Socket = std::unique_ptr<void, CloseSocket>;

tl::unexpected<physics::Error> zeromq_error(const char* what) {
  return make_error(ErrorCode::io,
                    std::string("yardstick: ZeroMQ: ") + what + ": " + zmq_strerror(zmq_errno()));
}

/// The memory lives longer than any message.
void keep(void* /*data*/, void* /*hint*/) {}

/// Sends one frame, with its CRC-32C in a part before it if `sum` is set. It returns false when it
/// is refused.
bool send_frame(void* socket, std::vector<std::byte>& image, bool sum) {
  if (sum) {
    const std::uint32_t crc32c = protocol::crc32c(image);
    if (zmq_send(socket, &crc32c, sizeof(crc32c), ZMQ_SNDMORE) < 0) return false;
  }
  zmq_msg_t message;
  zmq_msg_init_data(&message, image.data(), image.size(), keep, nullptr);
  if (zmq_msg_send(&message, socket, 0) >= 0) return true;
  zmq_msg_close(&message);
  return false;
}

/// Receives one frame. It returns false when nothing came, or when `sum` does not match.
bool receive_frame(void* socket, zmq_msg_t& message, bool sum) {
  std::uint32_t crc32c = 0;
  if (sum && zmq_recv(socket, &crc32c, sizeof(crc32c), 0) < 0) return false;
  if (zmq_msg_recv(&message, socket, 0) < 0) return false;
  const std::span bytes(static_cast<const std::byte*>(zmq_msg_data(&message)),
                        zmq_msg_size(&message));
  return !sum || protocol::crc32c(bytes) == crc32c;
}

}  // namespace

physics::Result<YardstickResult> measure_zeromq(const YardstickOptions& options, bool sum) {
  // Each end has a context of its own, as separate programs have. One thread of the library that
  // serves both ends would find everything it reads in its cache, and never wait for itself.
  const Context sending_context(zmq_ctx_new());
  const Context context(zmq_ctx_new());
  const Socket sender(zmq_socket(sending_context.get(), ZMQ_XPUB));
  const Socket receiver(zmq_socket(context.get(), ZMQ_SUB));
  const int window = static_cast<int>(options.window) * (sum ? 2 : 1);  // parts
  const int on = 1;
  const int timeout_ms = 10'000;
  zmq_setsockopt(sender.get(), ZMQ_SNDHWM, &window, sizeof(window));
  zmq_setsockopt(sender.get(), ZMQ_XPUB_NODROP, &on, sizeof(on));
  zmq_setsockopt(sender.get(), ZMQ_SNDTIMEO, &timeout_ms, sizeof(timeout_ms));
  zmq_setsockopt(receiver.get(), ZMQ_RCVHWM, &window, sizeof(window));
  zmq_setsockopt(receiver.get(), ZMQ_RCVTIMEO, &timeout_ms, sizeof(timeout_ms));
  zmq_setsockopt(receiver.get(), ZMQ_SUBSCRIBE, "", 0);
  std::array<char, 256> endpoint{};
  std::size_t length = endpoint.size();
  if (zmq_bind(sender.get(), "tcp://127.0.0.1:*") != 0 ||
      zmq_getsockopt(sender.get(), ZMQ_LAST_ENDPOINT, endpoint.data(), &length) != 0 ||
      zmq_connect(receiver.get(), endpoint.data()) != 0) {
    return zeromq_error("loopback TCP");
  }
  // The subscription arrives as a message. Frames sent before it would reach nobody.
  std::array<char, 16> subscription{};
  if (zmq_recv(sender.get(), subscription.data(), subscription.size(), 0) < 0) {
    return zeromq_error("no subscription");
  }
  std::vector<std::vector<std::byte>> images(16, std::vector<std::byte>(options.frame_bytes));
  YardstickResult result;
  const auto start = std::chrono::steady_clock::now();
  const double cpu_before_s = process_cpu_s();
  std::thread sending([&] {
    for (std::uint64_t i = 0; i < options.frames; ++i) {
      if (!send_frame(sender.get(), images[i % images.size()], sum)) return;
    }
  });
  zmq_msg_t message;
  zmq_msg_init(&message);
  while (result.frames < options.frames && receive_frame(receiver.get(), message, sum)) {
    ++result.frames;
  }
  zmq_msg_close(&message);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  sending.join();
  result.cpu_s = process_cpu_s() - cpu_before_s;
  result.lost = options.frames - result.frames;
  return result;
}

#else

physics::Result<YardstickResult> measure_zeromq(const YardstickOptions& /*options*/, bool /*sum*/) {
  return make_error(ErrorCode::unsupported, "built without libzmq3-dev");
}

#endif

}  // namespace emit::tool
