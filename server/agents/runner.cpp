// SPDX-License-Identifier: Apache-2.0
#include "agents/runner.hpp"

#include <poll.h>
#include <pthread.h>
#include <sys/prctl.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <ctime>
#include <system_error>

namespace emit::server {

bool AgentRunner::start_thread() {
  state_.store(static_cast<int>(State::starting));
  try {
    thread_ = std::thread([this] { run(); });
  } catch (const std::system_error&) {
    state_.store(static_cast<int>(State::idle));
    return false;
  }
  state_.wait(static_cast<int>(State::starting));
  if (state_.load() == static_cast<int>(State::failed)) {
    thread_.join();
    return false;
  }
  return true;
}

bool AgentRunner::start_stepped() {
  stepped_ = agent_.on_start();
  return stepped_;
}

int AgentRunner::step() noexcept {
  return turn();
}

void AgentRunner::stop() noexcept {
  if (stepped_) {
    agent_.on_stop();
    stepped_ = false;
  }
  if (thread_.joinable()) {
    stop_.store(true, std::memory_order_release);
    agent_.doorbell().ring();
    thread_.join();
  }
}

int AgentRunner::turn() noexcept {
  const std::int64_t begin_ns = clock_.monotonic_ns();
  duty_.beat(begin_ns);
  const int work = agent_.do_work(clock_.tai_ns());
  if (work != 0) {
    duty_.record(clock_.monotonic_ns() - begin_ns);
  }
  return work;
}

void AgentRunner::run() noexcept {
  // Signals belong to the main thread. A name helps in ps, perf and gdb.
  sigset_t all{};
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  std::array<char, 16> thread_name{};
  const auto name = agent_.name();
  std::memcpy(thread_name.data(), name.data(), std::min(name.size(), thread_name.size() - 1));
  pthread_setname_np(pthread_self(), thread_name.data());
  prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);

  timer_ = Fd(::timerfd_create(CLOCK_REALTIME, TFD_NONBLOCK | TFD_CLOEXEC));
  static_cast<void>(apply_before_start(realtime_));
  const bool started = agent_.on_start();
  if (started) {
    static_cast<void>(apply_after_start(realtime_));
  }
  state_.store(static_cast<int>(started ? State::running : State::failed));
  state_.notify_all();
  if (!started) {
    return;
  }
  bool worked = false;
  while (!stop_.load(std::memory_order_acquire)) {
    if (turn() != 0) {
      worked = true;
      continue;
    }
    if (worked) {
      rest();
      worked = false;
    }
    sleep();
  }
  agent_.on_stop();
}

void AgentRunner::rest() noexcept {
  // The doorbell is not armed: a producer that rings it goes on at once, and the next look sees the
  // work.
  if (const std::int64_t rest_ns = agent_.rest_ns(); rest_ns > 0) {
    const timespec time{0, static_cast<long>(rest_ns)};
    ::nanosleep(&time, nullptr);
  }
}

void AgentRunner::sleep() noexcept {
  agent_.doorbell().arm();
  if (turn() != 0 || stop_.load(std::memory_order_acquire)) {
    agent_.doorbell().disarm();
    return;
  }
  // The rest is bounded, whatever happens to the clock.
  constexpr std::int64_t kLongestNs = 100'000'000;
  const std::int64_t wake_ns = agent_.wake_at_ns();
  std::int64_t wait_ns = kLongestNs;
  std::array<pollfd, 3> fds{{{agent_.doorbell().fd(), POLLIN, 0}}};
  nfds_t count = 1;
  if (agent_.wait_fd() >= 0) {
    fds[count++] = {agent_.wait_fd(), POLLIN, 0};
  }
  const bool timed = wake_ns != kNeverNs && arm_timer(wake_ns);
  const nfds_t timer_at = count;
  if (timed) {
    fds[count++] = {timer_.get(), POLLIN, 0};
  } else if (wake_ns != kNeverNs) {
    wait_ns = std::clamp(wake_ns - clock_.tai_ns(), std::int64_t{0}, kLongestNs);
  }
  const timespec timeout{static_cast<time_t>(wait_ns / 1'000'000'000),
                         static_cast<long>(wait_ns % 1'000'000'000)};
  ::ppoll(fds.data(), count, &timeout, nullptr);
  if (timed && fds[timer_at].revents != 0) {
    // The timer has expired, or was cancelled because the clock was set. The next instant is set
    // anew.
    std::uint64_t expirations = 0;
    [[maybe_unused]] const auto read = ::read(timer_.get(), &expirations, sizeof expirations);
    armed_utc_ns_ = 0;
  }
  agent_.doorbell().disarm();
}

bool AgentRunner::arm_timer(std::int64_t wake_ns) noexcept {
  // CLOCK_TAI has no timer descriptors; CLOCK_REALTIME is the same clock less whole seconds.
  const std::int64_t utc_ns = wake_ns - clock_.tai_from_utc_offset_ns();
  if (utc_ns == armed_utc_ns_) {
    return true;
  }
  if (!timer_ || utc_ns <= 0) {
    return false;
  }
  itimerspec at{};
  at.it_value.tv_sec = static_cast<time_t>(utc_ns / 1'000'000'000);
  at.it_value.tv_nsec = static_cast<long>(utc_ns % 1'000'000'000);
  if (::timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME | TFD_TIMER_CANCEL_ON_SET, &at, nullptr) !=
      0) {
    // The timer was cancelled by a clock that was set meanwhile. Setting it again has acknowledged
    // that.
    armed_utc_ns_ = 0;
    return false;
  }
  armed_utc_ns_ = utc_ns;
  return true;
}

}  // namespace emit::server
