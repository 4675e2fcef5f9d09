// SPDX-License-Identifier: Apache-2.0
#include "bench/stream/stream_yardstick.hpp"

#if defined(EMIT_HAVE_ICEORYX)
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <iceoryx_hoofs/log/logmanager.hpp>
#include <iceoryx_posh/popo/untyped_publisher.hpp>
#include <iceoryx_posh/popo/untyped_subscriber.hpp>
#include <iceoryx_posh/popo/wait_set.hpp>
#include <iceoryx_posh/runtime/posh_runtime.hpp>
#include <optional>
#include <span>
#include <sstream>
#include <thread>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#include "tool/support/subprocess.hpp"
#endif

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

#if defined(EMIT_HAVE_ICEORYX)

namespace {

/// Header before the pixels of a frame.
struct Header {
  std::uint32_t crc32c = 0;
};
constexpr std::uint32_t kPixelsAt = 64;  // bytes: a cache line

std::string text_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// The library's daemon, with this process as its client. It lives until the process ends: the
/// library has one runtime, which leaves its daemon when static objects are destroyed.
class Runtime {
 public:
  static Result<void> start(const std::filesystem::path& directory) {
    static std::optional<Runtime> runtime;  // goes after the library's own, which it starts
    if (runtime) return {};
    const auto log = directory / "roudi.log";
    auto daemon = Subprocess::start({"/usr/bin/env", "iox-roudi", "-m", "off"}, log);
    if (!daemon) return tl::unexpected(daemon.error());
    constexpr auto kPatience = std::chrono::seconds(10);
    const auto end = std::chrono::steady_clock::now() + kPatience;
    // The library's clients wait without end, or abort, when the daemon is not ready.
    while (text_of(log).find("ready for clients") == std::string::npos) {
      constexpr int kNotFound = 127;  // of env
      const auto status = daemon->wait(std::chrono::milliseconds(20));
      if (status == kNotFound) {
        return make_error(ErrorCode::not_found, "iox-roudi is not installed");
      }
      if (status || std::chrono::steady_clock::now() > end) {
        return make_error(ErrorCode::unsupported,
                          "iox-roudi does not start (is one running already?)");
      }
    }
    runtime.emplace(std::move(*daemon));
    iox::log::LogManager::GetLogManager().SetDefaultLogLevel(
        iox::log::LogLevel::kError, iox::log::LogLevelOutput::kHideLogLevel);
    const std::string name = fmt::format("emit-bench-{}", ::getpid());
    iox::runtime::PoshRuntime::initRuntime(
        iox::RuntimeName_t(iox::cxx::TruncateToCapacity, name.c_str()));
    return {};
  }

  explicit Runtime(Subprocess daemon) : daemon_(std::move(daemon)) {}
  Runtime(const Runtime&) = delete;
  Runtime& operator=(const Runtime&) = delete;
  ~Runtime() {
    daemon_.send_signal(SIGTERM);
    static_cast<void>(daemon_.wait(std::chrono::seconds(2)));
  }

 private:
  Subprocess daemon_;
};

/// Sends a frame. It returns false when no chunk is left.
bool send_frame(iox::popo::UntypedPublisher& publisher, std::span<const std::byte> image,
                bool sum) {
  bool sent = false;
  publisher.loan(kPixelsAt + static_cast<std::uint32_t>(image.size()), kPixelsAt)
      .and_then([&](void* chunk) {
        auto* bytes = static_cast<std::byte*>(chunk);
        std::memcpy(bytes + kPixelsAt, image.data(), image.size());
        const Header header{sum ? protocol::crc32c(image) : 0U};
        std::memcpy(bytes, &header, sizeof(header));
        publisher.publish(chunk);
        sent = true;
      })
      .or_else([](auto&) {});
  return sent;
}

}  // namespace

Result<YardstickResult> measure_iceoryx(const YardstickOptions& options,
                                        const std::filesystem::path& directory, bool sum) {
  // The library ends the process when a frame is too large for any chunk, so the size is checked
  // here.
  constexpr std::size_t kLargestChunk = 4U << 20;
  constexpr std::size_t kChunkHeader = 256;  // at most
  if (options.frame_bytes + kPixelsAt + kChunkHeader > kLargestChunk) {
    return make_error(ErrorCode::unsupported,
                      "iox-roudi has no chunks as large as a frame in its default configuration");
  }
  if (auto started = Runtime::start(directory); !started) return tl::unexpected(started.error());
  iox::popo::PublisherOptions of_publisher;
  of_publisher.subscriberTooSlowPolicy = iox::popo::ConsumerTooSlowPolicy::WAIT_FOR_CONSUMER;
  iox::popo::SubscriberOptions of_subscriber;
  of_subscriber.queueCapacity = options.window;
  of_subscriber.queueFullPolicy = iox::popo::QueueFullPolicy::BLOCK_PRODUCER;
  const iox::capro::ServiceDescription service{"emit", "bench", "frames"};
  iox::popo::UntypedPublisher publisher(service, of_publisher);
  iox::popo::UntypedSubscriber subscriber(service, of_subscriber);
  iox::popo::WaitSet<> waiting;
  bool attached = true;
  waiting.attachState(subscriber, iox::popo::SubscriberState::HAS_DATA).or_else([&](auto&) {
    attached = false;
  });
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (subscriber.getSubscriptionState() != iox::SubscribeState::SUBSCRIBED ||
         !publisher.hasSubscribers()) {
    if (!attached || std::chrono::steady_clock::now() > end) {
      return make_error(ErrorCode::io, "yardstick: iceoryx: no subscription");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  std::vector<std::vector<std::byte>> images(16, std::vector<std::byte>(options.frame_bytes));
  YardstickResult result;
  bool complete = true;
  const auto start = std::chrono::steady_clock::now();
  const double cpu_before_s = process_cpu_s();
  std::thread sending([&] {
    for (std::uint64_t i = 0; complete && i < options.frames; ++i) {
      complete = send_frame(publisher, images[i % images.size()], sum);
    }
  });
  std::uint64_t wrong = 0;
  constexpr auto kPatience = std::chrono::seconds(10);
  auto last = start;
  while (result.frames < options.frames) {
    // The wait may end without a frame, or in vain after the sender has given up.
    if (waiting.timedWait(iox::units::Duration::fromSeconds(1)).empty() &&
        std::chrono::steady_clock::now() - last > kPatience) {
      break;
    }
    for (bool more = true; more;) {
      more = false;
      subscriber.take()
          .and_then([&](const void* chunk) {
            const auto* bytes = static_cast<const std::byte*>(chunk);
            Header header;
            std::memcpy(&header, bytes, sizeof(header));
            const std::span pixels(bytes + kPixelsAt, options.frame_bytes);
            if (sum && protocol::crc32c(pixels) != header.crc32c) ++wrong;
            subscriber.release(chunk);
            ++result.frames;
            last = std::chrono::steady_clock::now();
            more = true;
          })
          .or_else([](auto&) {});
    }
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (result.frames < options.frames) subscriber.unsubscribe();  // a sender that waits goes on
  sending.join();
  result.cpu_s = process_cpu_s() - cpu_before_s;
  if (!complete) return make_error(ErrorCode::io, "yardstick: iceoryx: no chunk is left");
  result.lost = options.frames - result.frames + wrong;
  return result;
}

#else

Result<YardstickResult> measure_iceoryx(const YardstickOptions& /*options*/,
                                        const std::filesystem::path& /*directory*/, bool /*sum*/) {
  return make_error(ErrorCode::unsupported, "built without libiceoryx-posh-dev");
}

#endif

}  // namespace emit::tool
