// SPDX-License-Identifier: Apache-2.0
#include "agents/recorder/recorder.hpp"

#include <sched.h>
#include <sys/epoll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <exception>
#include <system_error>

#include "agents/journal_ring.hpp"
#include "agents/recorder/journal_encode.hpp"
#include "agents/recorder/older_journal.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/v1/control.pb.h"
#include "net/socket.hpp"

namespace emit::server {
namespace {

/// Returns true where the disk, the quota or the limit on the size of files leaves no room, or the
/// disk takes no writes. Such a state comes and goes while nobody is there; any other reason is a
/// mistake in the configuration.
bool is_state_of_disk(const std::error_code& cause) noexcept {
  const int error = cause.value();
  return error == ENOSPC || error == EDQUOT || error == EFBIG || error == EROFS || error == EIO;
}

}  // namespace

Recorder::Recorder(Context& context, config::JournalConfig config, std::size_t max_peers)
    : Agent(context.bells.recorder),
      context_(context),
      config_(std::move(config)),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)) {
  peers_.reserve(max_peers);
}

physics::Result<Recorder::Opened> Recorder::open() {
  Opened opened;
  if (config_.file.empty()) {
    return opened;
  }
  std::error_code cause;
  const auto no_journal = [&](physics::Error error) -> physics::Result<Opened> {
    if (!is_state_of_disk(cause)) {
      return tl::unexpected<physics::Error>(std::move(error));
    }
    if (config_.required) {
      return physics::make_error(physics::ErrorCode::config,
                                 "journal.required is set: " + error.text);
    }
    opened.off = std::move(error.text);
    return opened;
  };
  auto kept = keep_older_journal(config_.file, &cause);
  if (!kept) {
    return no_journal(std::move(kept.error()));
  }
  opened.older = std::move(*kept);
  protocol::LogWriterOptions options;
  options.software = identity_.software;
  auto writer = protocol::LogWriter::create(config_.file, options, &cause);
  if (!writer) {
    return no_journal(std::move(writer.error()));
  }
  file_ = std::move(*writer);
  return opened;
}

bool Recorder::on_start() noexcept {
  return static_cast<bool>(epoll_);
}

int Recorder::do_work(std::int64_t now_ns) noexcept {
  wake_at_ns_ = kNeverNs;
  // Memory may run out while lines are kept or encoded: the journal ends then, the frames do not.
  try {
    int work = take_commands();
    work += take_lines();
    flush_when_due(now_ns);
    work += take_writable();
    work += send_all();
    discard_old();
    answer_tap();
    const std::uint64_t end = kept_first_ + kept_.size();
    if (std::all_of(peers_.begin(), peers_.end(),
                    [end](const Peer& peer) { return peer.next == end; })) {
      finished_.store(taken_, std::memory_order_release);
    }
    return work;
  } catch (const std::exception& error) {
    file_failed({physics::ErrorCode::internal, error.what()});
    return 0;
  }
}

void Recorder::on_stop() noexcept {
  try {
    while (take_lines() > 0) {
    }
    while (send_all() > 0) {
    }
  } catch (const std::exception& error) {
    file_failed({physics::ErrorCode::internal, error.what()});
  }
  while (!peers_.empty()) {
    end_stream(peers_.back());
    remove(peers_.size() - 1);
  }
  if (file_) {
    const auto closed = file_->close();
    count_written();
    if (!closed) {
      file_failed(closed.error());
    }
    file_.reset();
  }
}

int Recorder::take_commands() {
  int work = 0;
  while (const RecorderCommand* command = context_.to_recorder.front()) {
    if (command->kind == ClientCommand::Kind::add) {
      add_peer(*command);
    } else {
      const auto found = std::find_if(peers_.begin(), peers_.end(), [&](const Peer& peer) {
        return peer.connection == command->connection;
      });
      if (found != peers_.end()) {
        remove(static_cast<std::size_t>(found - peers_.begin()));
      }
    }
    context_.to_recorder.pop();
    ++work;
  }
  return work;
}

void Recorder::add_peer(const RecorderCommand& command) {
  Peer peer;
  peer.connection = command.connection;
  peer.fd = command.fd;
  peer.socket = command.socket;
  peer.next = std::max(run_first_, kept_first_);
  if (kept_first_ > run_first_) {
    v1::ControlRecord record;
    v1::JournalGap& gap = *record.mutable_journal_gap();
    gap.set_first_sequence(run_first_sequence_);
    gap.set_last_sequence(kept_.empty() ? last_sequence_ : kept_.front().sequence - 1);
    protocol::append_control_record(record, peer.first);
  }
  peers_.push_back(std::move(peer));
}

int Recorder::take_lines() {
  int work = 0;
  constexpr int kMaxPerTurn = 256;
  for (auto line = context_.journal.front(); !line.empty() && work < kMaxPerTurn;
       line = context_.journal.front()) {
    add_record(line);
    context_.journal.pop();
    ++taken_;
    ++work;
  }
  return work;
}

void Recorder::add_record(std::span<const std::byte> line) {
  v1::ControlRecord record;
  v1::JournalEntry& entry = *record.mutable_journal();
  if (!to_journal_entry(line, identity_, entry)) {
    context_.counters.add(Counter::journal_errors);
    context_.counters.add(Counter::journal_dropped);
    return;
  }
  if (config_.file.empty()) {
    context_.counters.add(Counter::journal_entries);
  }
  last_sequence_ = entry.sequence();
  if (entry.has_run_start()) {
    run_first_ = kept_first_ + kept_.size();
    run_first_sequence_ = last_sequence_;
  }
  if (file_) {
    const auto written = file_->write_journal(entry);
    ++handed_to_file_;
    count_written();
    if (!written) {
      file_failed(written.error());
    } else if (unflushed_since_ns_ == 0) {
      unflushed_since_ns_ = context_.clock.monotonic_ns();
    }
  } else if (!config_.file.empty()) {
    context_.counters.add(Counter::journal_dropped);
  }
  Kept kept;
  kept.sequence = last_sequence_;
  protocol::append_control_record(record, kept.bytes);
  const std::size_t bytes = kept.bytes.capacity() + kOverheadBytes;
  kept_.push_back(std::move(kept));
  kept_bytes_ += bytes;
}

void Recorder::flush_when_due(std::int64_t now_ns) {
  if (!file_ || unflushed_since_ns_ == 0) {
    return;
  }
  // The monotonic clock is used, so that steps of the wall clock do not stretch the age.
  const std::int64_t age_ns = context_.clock.monotonic_ns() - unflushed_since_ns_;
  if (age_ns < kFlushAfterNs) {
    wake_at_ns_ = now_ns + kFlushAfterNs - age_ns;
    return;
  }
  unflushed_since_ns_ = 0;
  const auto flushed = file_->flush();
  count_written();
  if (!flushed) {
    file_failed(flushed.error());
  }
}

void Recorder::count_written() noexcept {
  const std::uint64_t in_file = file_->messages_in_file();
  context_.counters.add(Counter::journal_entries, in_file - in_file_);
  in_file_ = in_file;
}

void Recorder::file_failed(const physics::Error& error) noexcept {
  context_.counters.add(Counter::journal_errors);
  context_.recorder_events.push(EventKind::journal_failed, 0, 0, error.text);
  if (file_) {
    // The entries of the chunk that did not get into the file are lost. What is in the file stays
    // readable; nothing is appended, because a journal with a hole does not replay.
    context_.counters.add(Counter::journal_dropped, handed_to_file_ - in_file_);
    handed_to_file_ = in_file_;
    file_.reset();
  }
}

void Recorder::discard_old() {
  // Records of earlier runs stay only while a peer is still being sent them.
  std::uint64_t needed = run_first_;
  for (const Peer& peer : peers_) {
    needed = std::min(needed, peer.next);
  }
  const auto drop_front = [this] {
    kept_bytes_ -= kept_.front().bytes.capacity() + kOverheadBytes;
    kept_.pop_front();
    ++kept_first_;
  };
  while (kept_first_ < needed) {
    drop_front();
  }
  const std::size_t limit_bytes = std::size_t{config_.memory_mib} << 20;
  while (kept_bytes_ > limit_bytes) {
    if (kept_first_ >= run_first_) {
      context_.counters.add(Counter::journal_forgotten);
    }
    drop_front();
    for (std::size_t i = peers_.size(); i-- > 0;) {
      if (peers_[i].next < kept_first_) {
        context_.counters.add(Counter::recorders_disconnected_slow);
        context_.recorder_events.push(EventKind::disconnected_slow, peers_[i].connection);
        remove(i);
      }
    }
  }
  context_.journal_memory_bytes.store(kept_bytes_, std::memory_order_relaxed);
}

void Recorder::answer_tap() {
  if (tap_ == nullptr || !tap_->is_asked()) return;
  tap_->begin(kept_bytes_);
  for (const Kept& kept : kept_) {
    if (kept.sequence >= run_first_sequence_) tap_->add(kept.bytes);
  }
  tap_->finish();
}

int Recorder::take_writable() noexcept {
  std::array<epoll_event, 8> events{};
  if (std::none_of(peers_.begin(), peers_.end(), [](const Peer& peer) { return peer.blocked; })) {
    return 0;
  }
  const int count = ::epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), 0);
  for (int i = 0; i < count; ++i) {
    for (Peer& peer : peers_) {
      if (peer.connection == events[static_cast<std::size_t>(i)].data.u32) {
        peer.blocked = false;
      }
    }
  }
  return std::max(count, 0);
}

int Recorder::send_all() noexcept {
  int work = 0;
  for (std::size_t i = peers_.size(); i-- > 0;) {
    bool failed = false;
    if (!peers_[i].blocked && send_some(peers_[i], failed)) {
      ++work;
    }
    if (failed) {
      remove(i);
    }
  }
  return work;
}

bool Recorder::send_some(Peer& peer, bool& failed) noexcept {
  std::array<std::span<const std::byte>, kMaxLentPieces> pieces;
  std::size_t count = 0;
  if (peer.first_sent < peer.first.size()) {
    pieces[count++] = std::span<const std::byte>(peer.first).subspan(peer.first_sent);
  }
  const std::uint64_t end = kept_first_ + kept_.size();
  for (std::uint64_t index = peer.next; index < end && count < pieces.size(); ++index) {
    const std::span<const std::byte> bytes(
        kept_[static_cast<std::size_t>(index - kept_first_)].bytes);
    pieces[count++] = bytes.subspan(index == peer.next ? peer.offset : 0);
  }
  if (count == 0) {
    return false;
  }
  const IoResult sent = write_lent(*peer.socket, std::span(pieces).first(count));
  if (sent.status == IoStatus::failed || sent.status == IoStatus::closed) {
    failed = true;
    return false;
  }
  if (sent.status == IoStatus::busy) {
    return true;  // the receiver is inside for microseconds
  }
  if (sent.status == IoStatus::would_block) {
    peer.blocked = true;
    epoll_event event{};
    event.events = EPOLLOUT | EPOLLONESHOT;
    event.data.u32 = peer.connection;
    ::epoll_ctl(epoll_.get(), peer.registered ? EPOLL_CTL_MOD : EPOLL_CTL_ADD, peer.fd, &event);
    peer.registered = true;
    return false;
  }
  std::size_t left = sent.bytes;
  const std::size_t of_first = std::min(left, peer.first.size() - peer.first_sent);
  const std::size_t first_record = peer.first_sent < peer.first.size() ? 1 : 0;
  peer.first_sent += of_first;
  left -= of_first;
  for (std::size_t i = first_record; i < count && left > 0; ++i) {
    if (left < pieces[i].size()) {
      peer.offset += left;
      return true;
    }
    left -= pieces[i].size();
    ++peer.next;
    peer.offset = 0;
  }
  return true;
}

/// Sends the end of the journal to a peer that has everything. A peer that does not get it knows
/// that its log may lack entries.
void Recorder::end_stream(Peer& peer) noexcept {
  if (peer.next != kept_first_ + kept_.size() || peer.first_sent < peer.first.size()) {
    return;
  }
  try {
    v1::ControlRecord record;
    record.mutable_journal_end()->set_last_sequence(last_sequence_);
    std::vector<std::byte> bytes;
    protocol::append_control_record(record, bytes);
    // The receiver may hold the socket for microseconds; it is empty enough for these few bytes.
    constexpr int kMaxTries = 1000;
    const std::array<std::span<const std::byte>, 1> piece{bytes};
    for (int i = 0; i < kMaxTries; ++i) {
      if (write_lent(*peer.socket, piece).status != IoStatus::busy) {
        return;
      }
      ::sched_yield();
    }
  } catch (const std::exception&) {
    return;  // without memory: the peer takes it for a broken connection
  }
}

void Recorder::remove(std::size_t index) noexcept {
  const std::uint32_t connection = peers_[index].connection;
  if (peers_[index].registered) {
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, peers_[index].fd, nullptr);
  }
  peers_.erase(peers_.begin() + static_cast<std::ptrdiff_t>(index));
  static_cast<void>(context_.from_recorder.push({connection}));
  context_.bells.receiver.ring();
}

}  // namespace emit::server
