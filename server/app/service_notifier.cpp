// SPDX-License-Identifier: Apache-2.0
#include "app/service_notifier.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>
#include <utility>

namespace emit::server {
namespace {

std::string_view variable(const char* name) noexcept {
  const char* const value = std::getenv(name);
  return value != nullptr ? value : "";
}

std::int64_t number(std::string_view text) noexcept {
  std::int64_t value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  return read.ec == std::errc() && read.ptr == text.data() + text.size() ? value : 0;
}

/// Turns a text that peers and files may have worded into one line.
std::string one_line(std::string_view text) {
  constexpr std::size_t kLongest = 300;
  std::string out(text.substr(0, kLongest));
  std::ranges::replace_if(
      out, [](char c) { return static_cast<unsigned char>(c) < 0x20; }, ' ');
  return out;
}

}  // namespace

ServiceNotifier ServiceNotifier::from_environment() {
  const std::string_view pid = variable("WATCHDOG_PID");
  const bool ours = pid.empty() || number(pid) == ::getpid();
  constexpr std::int64_t kMaxUs = 1'000'000'000'000;
  const std::int64_t watchdog_us =
      ours ? std::clamp<std::int64_t>(number(variable("WATCHDOG_USEC")), 0, kMaxUs) : 0;
  return {variable("NOTIFY_SOCKET"), watchdog_us * 1000};
}

ServiceNotifier::ServiceNotifier(std::string_view address, std::int64_t watchdog_ns) {
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  const bool abstract = address.starts_with('@');
  if (address.size() < 2 || address.size() >= sizeof(to.sun_path) ||
      (!abstract && address.front() != '/')) {
    return;
  }
  std::memcpy(to.sun_path, address.data(), address.size());
  if (abstract) to.sun_path[0] = '\0';
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address.size());
  Fd socket(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket || ::connect(socket.get(), reinterpret_cast<const sockaddr*>(&to), length) != 0) {
    return;
  }
  socket_ = std::move(socket);
  watchdog_ns_ = watchdog_ns;
}

void ServiceNotifier::ready(std::string_view status) const noexcept {
  this->status(status);
  send("READY=1");
}

void ServiceNotifier::status(std::string_view text, std::int64_t extend_s) const noexcept {
  if (!active()) return;
  try {
    std::string message = "STATUS=" + one_line(text);
    if (extend_s > 0) message += fmt::format("\nEXTEND_TIMEOUT_USEC={}", extend_s * 1'000'000);
    send(message);
  } catch (const std::bad_alloc&) {
    return;  // it is only said less
  }
}

void ServiceNotifier::send(std::string_view text) const noexcept {
  if (active()) {
    static_cast<void>(::send(socket_.get(), text.data(), text.size(), MSG_NOSIGNAL));
  }
}

}  // namespace emit::server
