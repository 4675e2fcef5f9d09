// SPDX-License-Identifier: Apache-2.0
// The loop by the wall clock: EngageSession::fly_in_real_time() and its parts.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "tool/engage/engage_session.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Result<void> EngageSession::take_frames(RealTimeRun& run, const FlightHost* host,
                                        LoopRecord* record) {
  constexpr std::size_t kMostSeen = 64;
  while (true) {
    const auto frame = frames_->receive(0);
    if (!frame) return tl::unexpected(frame.error());
    if (*frame == nullptr) return {};
    const protocol::FrameHeader& header = (*frame)->header;
    run.motion = header.motion_state;
    if (host == nullptr || header.host_frame_number < first_number_) continue;
    run.seen.push_back(header);
    if (run.seen.size() > kMostSeen) run.seen.pop_front();
    if (auto done = keep_film(**frame, *host, *record); !done) return done;
  }
}

void EngageSession::match(const SeekerAnswer& answer, RealTimeRun& run, FlightHost& host,
                          LoopRecord& record) {
  const auto seen = std::ranges::find_if(run.seen, [&answer](const protocol::FrameHeader& each) {
    return each.frame_number == answer.frame_number;
  });
  if (answer.host_frame_number < first_number_) return;  // from before the flight
  const std::uint64_t index = answer.host_frame_number - first_number_;
  if (seen == run.seen.end() || index >= record.frames.size()) {
    ++record.unmatched_answers;
    return;
  }
  ++record.answers;
  LoopFrame& frame = record.frames[index];
  frame.loop_delay_ms =
      std::chrono::duration<double, std::milli>(Clock::now() - run.sent[index]).count();
  take_answer(*seen, answer, frame, host);
  for (FilmPicture& picture : record.film) {
    if (picture.frame_number == answer.frame_number) picture.answer = answer;
  }
}

Result<void> EngageSession::listen_until(Clock::time_point end, RealTimeRun& run, FlightHost* host,
                                         LoopRecord* record) {
  constexpr std::chrono::milliseconds kSlice(4);
  while (true) {
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
    if (auto done = take_frames(run, host, record); !done) return done;
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
    if (left.count() <= 0) {
      std::this_thread::sleep_until(end);
      return {};
    }
    const auto answer = seeker_->next(std::min(left, kSlice));
    if (!answer) return tl::unexpected(answer.error());
    if (!*answer || host == nullptr) continue;
    // The frame of an answer was published before the answer came.
    if (auto done = take_frames(run, host, record); !done) return done;
    match(**answer, run, *host, *record);
  }
}

/// Sends the pose at the launch until the flight begins, so that the axes come to their places.
Result<void> EngageSession::hold_for_axes(const FlightHost& host, RealTimeRun& run) {
  const auto poses = static_cast<std::uint64_t>(
      std::llround(1e-9 * static_cast<double>(kHoldNs) * options_.rate_hz));
  Progress progress("axes on their way", poses);
  for (std::uint64_t k = 0; k < poses; ++k) {
    const auto before_ns = static_cast<std::int64_t>(
        std::llround(static_cast<double>(poses - k) * 1e9 / options_.rate_hz));
    const auto due = run.begin - std::chrono::nanoseconds(before_ns);
    if (auto done = listen_until(due, run, nullptr, nullptr); !done) return done;
    fill_host_frame(host, first_number_++, start_ns_ - before_ns);
    sent_->seeker_rates = protocol::PoseRates{};  // it rests
    if (auto done = send_host_frame(nullptr); !done) return done;
    progress.advance_to(k + 1);
  }
  progress.finish();
  if (run.motion != protocol::MotionState::following) {
    return make_error(ErrorCode::io, "the axes of the motion simulator do not follow after 8 s");
  }
  return {};
}

Result<LoopRecord> EngageSession::fly_in_real_time(FlightHost& host) {
  auto log = protocol::LogWriter::create(flight_log());
  if (!log) return tl::unexpected(log.error());
  LoopRecord record;
  first_range_m_ = host.truth().range_m;
  RealTimeRun run;
  run.begin = Clock::now() + std::chrono::nanoseconds(kHoldNs) + std::chrono::milliseconds(100);
  if (auto done = hold_for_axes(host, run); !done) return tl::unexpected(done.error());

  const auto most =
      static_cast<std::uint64_t>(std::floor(options_.duration_s * options_.rate_hz)) + 1;
  Progress progress("frames", most);
  for (std::uint64_t k = 0; k < most; ++k) {
    const auto since_ns =
        static_cast<std::int64_t>(std::llround(static_cast<double>(k) * 1e9 / options_.rate_hz));
    if (auto done =
            listen_until(run.begin + std::chrono::nanoseconds(since_ns), run, &host, &record);
        !done) {
      return tl::unexpected(done.error());
    }
    if (k > 0) {
      const auto flies = host.advance(1.0 / options_.rate_hz);
      if (!flies) return tl::unexpected(flies.error());
      if (!*flies) {
        record.ended = true;
        break;
      }
    }
    record.frames.push_back(frame_at(host));
    run.sent.push_back(Clock::now());
    fill_host_frame(host, first_number_ + k, start_ns_ + since_ns);
    if (auto done = send_host_frame(&*log); !done) return tl::unexpected(done.error());
    ++record.poses;
    progress.advance_to(k + 1);
  }
  progress.finish();
  record.wall_s = std::chrono::duration<double>(Clock::now() - run.begin).count();
  if (auto done = log->close(); !done) return tl::unexpected(done.error());
  return record;
}

}  // namespace emit::tool
