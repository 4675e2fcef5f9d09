// SPDX-License-Identifier: Apache-2.0
#include "telemetry/ptp_monitor.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "net/socket_address.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;

constexpr std::int64_t kAskEveryNs = 1'000'000'000;
constexpr std::int64_t kDownAfterNs = 3'000'000'000;

}  // namespace

physics::Result<std::unique_ptr<PtpMonitor>> PtpMonitor::open(const std::filesystem::path& path,
                                                              std::uint8_t domain) {
  if (path.string().size() >= sizeof(sockaddr_un::sun_path)) {
    return make_error(ErrorCode::config, fmt::format("{}: too long for a socket", path.string()));
  }
  Fd socket(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  sockaddr_un own{};
  own.sun_family = AF_UNIX;
  // The family alone: the kernel gives it an abstract name, which ptp4l can answer to and which
  // leaves no file behind.
  if (!socket ||
      ::bind(socket.get(), reinterpret_cast<const sockaddr*>(&own), sizeof(own.sun_family)) != 0) {
    return make_error(ErrorCode::io, fmt::format("socket: {}", error_text(errno)));
  }
  return std::unique_ptr<PtpMonitor>(new PtpMonitor(std::move(socket), path, domain));
}

void PtpMonitor::ask() {
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  const std::string path = path_.string();
  std::memcpy(to.sun_path, path.data(), path.size());
  ++sequence_;
  asked_for_ = {};
  for (const PtpManagementId id :
       {PtpManagementId::port_data_set, PtpManagementId::time_status_np}) {
    const auto message = encode_ptp_get(id, domain_, sequence_);
    // Fails while ptp4l does not run: then no answer comes, which is what counts.
    static_cast<void>(::sendto(socket_.get(), message.data(), message.size(), MSG_NOSIGNAL,
                               reinterpret_cast<const sockaddr*>(&to), sizeof to));
  }
}

void PtpMonitor::take_answers(std::int64_t monotonic_ns) {
  constexpr int kMaxPerTurn = 64;
  std::array<std::byte, 1500> bytes;
  for (int i = 0; i < kMaxPerTurn; ++i) {
    const ssize_t size = ::recv(socket_.get(), bytes.data(), bytes.size(), 0);
    if (size < 0) return;
    const std::span<const std::byte> message(bytes.data(), static_cast<std::size_t>(size));
    // ptp4l answers in order, ports first: with this the round is complete.
    if (take_ptp_answer(message, domain_, sequence_, asked_for_) == PtpAnswer::time_status) {
      answered_ns_ = monotonic_ns;
      const std::lock_guard lock(mutex_);
      shown_ = asked_for_;
      shown_.up = true;
    }
  }
}

PtpMonitor::Change PtpMonitor::turn(std::int64_t monotonic_ns) {
  const PtpStatus before = status();
  take_answers(monotonic_ns);
  if (!asked_ns_ || monotonic_ns - *asked_ns_ >= kAskEveryNs) {
    asked_ns_ = monotonic_ns;
    ask();
  }
  if (!answered_ns_ || monotonic_ns - *answered_ns_ > kDownAfterNs) {
    const std::lock_guard lock(mutex_);
    shown_ = {};
  }
  const PtpStatus now = status();
  if (now.up != before.up) return now.up ? Change::went_up : Change::went_down;
  return now.up && now.state != before.state ? Change::state : Change::none;
}

}  // namespace emit::server
