// SPDX-License-Identifier: Apache-2.0
#include "agents/sender/sender.hpp"

#include <sys/epoll.h>

#include <algorithm>
#include <cstring>
#include <utility>

namespace emit::server {

Sender::Sender(Context& context, std::uint32_t queue_frames, std::size_t max_clients,
               bool keep_last, std::vector<SenderClient*> residents)
    : Agent(context.bells.sender),
      context_(context),
      queue_frames_(std::max(queue_frames, 1U)),
      keep_last_(keep_last),
      residents_(std::move(residents)),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      window_(queue_frames_ + 1) {
  clients_.reserve(max_clients + residents_.size());
  for (SenderClient* resident : residents_) {
    resident->next = end_;
    clients_.push_back(resident);
  }
}

void Sender::allow_compression() {
  encoded_.reserve(window_.size() * context_.pictures.size());
  for (std::size_t place = 0; place < window_.size(); ++place) {
    for (const Picture& picture : context_.pictures) {
      encoded_.push_back({protocol::PixelEncoder(picture.pixels() * sizeof(float)), false});
    }
  }
}

bool Sender::on_start() noexcept {
  return static_cast<bool>(epoll_);
}

int Sender::do_work(std::int64_t now_ns) noexcept {
  static_cast<void>(now_ns);
  wake_at_ns_ = kNeverNs;
  int work = take_commands();
  work += take_resends();
  work += take_published();
  work += take_writable();
  work += send_all();
  trim();
  const bool nothing_left = std::all_of(
      clients_.begin(), clients_.end(),
      [this](const SenderClient* client) { return !client->busy() && client->next >= end_; });
  if (nothing_left) {
    finished_.store(taken_, std::memory_order_release);
  }
  return work;
}

void Sender::on_stop() noexcept {
  while (take_published() > 0) {
    trim();
  }
  while (!clients_.empty()) {
    remove(clients_.size() - 1, false);
  }
  trim();
  if (have_last_) {
    have_last_ = false;
    let_go(last_);
  }
}

int Sender::take_commands() noexcept {
  int work = 0;
  while (ClientCommand* command = context_.to_sender.front()) {
    if (command->kind == ClientCommand::Kind::add) {
      SenderClient* client = command->client;
      client->next = end_;
      clients_.push_back(client);
    } else {
      const auto found = std::find_if(
          clients_.begin(), clients_.end(),
          [&](const SenderClient* client) { return client->connection() == command->connection; });
      if (found != clients_.end()) {
        remove(static_cast<std::size_t>(found - clients_.begin()), false);
      }
    }
    context_.to_sender.pop();
    ++work;
  }
  return work;
}

int Sender::take_resends() noexcept {
  int work = 0;
  for (; const ResendCommand* command = context_.resends.front(); ++work) {
    context_.counters.add(Counter::resend_requests);
    const auto found = std::find_if(
        clients_.begin(), clients_.end(),
        [&](const SenderClient* client) { return client->connection() == command->connection; });
    if (found == clients_.end() || !(*found)->ask_again(command->request)) {
      context_.counters.add(Counter::resends_refused);
    }
    context_.resends.pop();
  }
  return work;
}

int Sender::take_published() noexcept {
  int work = 0;
  while (PublishFrame* published = context_.published.front()) {
    if (end_ - first_ >= queue_frames_) {
      evict_oldest();
    }
    Entry& added = entry(end_);
    added.header = published->header;
    // Frames are repeated only after one was published, and only where the last one is kept.
    added.image = published->repeat ? last_ : published->image;
    if (published->repeat) {
      added.image.channels &= published->image.channels;
      added.image.ahead = published->image.ahead;
    }
    hold(added.image);
    if (keep_last_ && !published->repeat) {
      hold(added.image);
      if (have_last_) {
        let_go(last_);
      }
      last_ = added.image;
      have_last_ = true;
    }
    for (std::size_t i = 0; i < context_.pictures.size() && !encoded_.empty(); ++i) {
      encoded_[end_ % window_.size() * context_.pictures.size() + i].begun = false;
    }
    ++end_;
    ++taken_;
    for (SenderClient* client : clients_) {
      client->see(added.header);
      pass_over_unwanted(*client);
    }
    context_.published.pop();
    ++work;
    // Clients get a chance between two frames, so that a burst does not skip frames.
    if (work < 4) {
      static_cast<void>(send_all());
    } else {
      break;
    }
  }
  if (work > 0 && context_.of_room.end()) {
    context_.bells.conductor.ring();
  }
  return work;
}

void Sender::evict_oldest() noexcept {
  for (std::size_t i = clients_.size(); i-- > 0;) {
    SenderClient& client = *clients_[i];
    if (client.busy() && !client.spilled() && client.in_transit == first_) {
      client.spill();
      if (client.is_stream()) context_.counters.add(Counter::frames_spilled);
    }
    if (client.next == first_) {
      if (client.every_frame()) {
        context_.counters.add(Counter::clients_disconnected_slow);
        context_.sender_events.push(EventKind::disconnected_slow, client.connection());
        remove(i, true);
        continue;
      }
      ++client.next;  // what it does not want is passed over when the new frame is in
      client.gap = true;
      count_skipped(client);
    }
  }
  drop_oldest();
}

void Sender::count_skipped(const SenderClient& client) noexcept {
  if (!client.is_stream()) return;
  context_.counters.add(Counter::frames_skipped);
  if (ClientCounts* counts = counts_of(client)) {
    counts->skipped.fetch_add(1, std::memory_order_relaxed);
  }
}

bool Sender::has_several_streams() const noexcept {
  return std::ranges::count_if(clients_,
                               [](const SenderClient* client) { return client->is_stream(); }) > 1;
}

void Sender::drop_oldest() noexcept {
  for (SenderClient* client : clients_) {
    client->forget(first_);
  }
  let_go(entry(first_).image);
  ++first_;
}

void Sender::pass_over_unwanted(SenderClient& client) noexcept {
  for (; client.next < end_; ++client.next) {
    const Entry& next = entry(client.next);
    if (client.wants(next.header, next.image.channels)) {
      return;
    }
    if (client.misses(next.header, next.image.channels)) {
      client.gap = true;
      count_skipped(client);
    } else if (client.is_stream()) {
      context_.counters.add(client.counter_of_unwanted());
    }
  }
}

void Sender::trim() noexcept {
  while (first_ < end_) {
    const bool needed =
        std::any_of(clients_.begin(), clients_.end(), [this](const SenderClient* client) {
          return client->next <= first_ || client->may_ask_again() ||
                 (client->busy() && !client->spilled() && client->in_transit <= first_);
        });
    if (needed) {
      return;
    }
    drop_oldest();
  }
}

void Sender::hold(const Image& image) noexcept {
  ++holds_[image.slot];
}

void Sender::let_go(const Image& image) noexcept {
  if (--holds_[image.slot] == 0) {
    image.release();
    if (context_.of_slots.end()) {
      context_.bells.render.ring();
    }
  }
}

int Sender::take_writable() noexcept {
  std::array<epoll_event, 16> events{};
  const bool any_blocked = std::any_of(clients_.begin(), clients_.end(),
                                       [](const SenderClient* client) { return client->blocked; });
  if (!any_blocked) {
    return 0;
  }
  const int count = ::epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), 0);
  for (int i = 0; i < count; ++i) {
    static_cast<SenderClient*>(events[static_cast<std::size_t>(i)].data.ptr)->blocked = false;
  }
  return std::max(count, 0);
}

Sender::EncodedPicture& Sender::encoded_for(const SenderClient& client) noexcept {
  const std::size_t picture = *client.waits_for_encoding();
  const std::size_t place = client.in_transit % window_.size();
  EncodedPicture& encoded = encoded_[place * context_.pictures.size() + picture];
  if (!encoded.begun) {
    encoded.begun = true;
    encoded.encoder.begin(std::as_bytes(entry(client.in_transit).image.pictures[picture]));
  }
  return encoded;
}

bool Sender::take_encoded(SenderClient& client) noexcept {
  const EncodedPicture& encoded = encoded_for(client);
  if (!encoded.encoder.done()) {
    return false;
  }
  client.take_encoded(encoded.encoder.bytes());
  return true;
}

int Sender::send_all() noexcept {
  int work = 0;
  SenderClient* waiting = nullptr;
  for (std::size_t i = clients_.size(); i-- > 0;) {
    SenderClient& client = *clients_[i];
    if (client.closing) {
      remove(i, true);
      ++work;
      continue;
    }
    if (client.waits_for_encoding() && !take_encoded(client)) {
      waiting = &client;
      continue;
    }
    if (!client.blocked && advance(client)) {
      ++work;
    }
  }
  if (work == 0 && waiting != nullptr) {
    encoded_for(*waiting).encoder.encode_block();
    ++work;
  }
  return work;
}

bool Sender::advance(SenderClient& client) noexcept {
  auto turn = SenderClient::Turn::full;
  if (!client.busy() && client.next < end_) {
    // The other clients begin at about this time. A brief turn keeps their first bytes from
    // waiting.
    turn = has_several_streams() ? SenderClient::Turn::brief : turn;
    client.next = std::max(client.next, first_);
    const Entry& next = entry(client.next);
    client.in_transit = client.next++;
    client.begin(next.header, next.image, context_.clock.tai_ns());
    // Pass over frames that the client does not want only now: the next frame reports a gap among
    // them.
    pass_over_unwanted(client);
    if (client.waits_for_encoding()) {
      return true;
    }
  }
  switch (client.send(batch_, context_, turn)) {
    case SenderClient::Progress::idle:
      return false;
    case SenderClient::Progress::more:
      return true;
    case SenderClient::Progress::finished:
      account(client);
      return true;
    case SenderClient::Progress::blocked:
      block(client);
      return false;
    case SenderClient::Progress::retry_soon:
      // A full device queue does not turn the socket unwritable; it drains within this time.
      wake_at_ns_ = context_.clock.tai_ns() + 100'000;
      return false;
    case SenderClient::Progress::failed:
      client.closing = true;
      return true;
  }
  return false;
}

ClientCounts* Sender::counts_of(const SenderClient& client) const noexcept {
  // The ring in shared memory belongs to no connection.
  return client.fd() >= 0 ? context_.counts_of(client.connection()) : nullptr;
}

void Sender::account(SenderClient& client) noexcept {
  const std::int64_t now_ns = context_.clock.tai_ns();
  client.complete(now_ns);
  if (!client.is_stream()) return;
  context_.counters.add(Counter::frames_sent);
  context_.times.send.record(now_ns - client.header().send_start_ns);
  ClientCounts* counts = counts_of(client);
  if (counts != nullptr) {
    counts->frames.fetch_add(1, std::memory_order_relaxed);
  }
  context_.trace.add(client.header(),
                     client.fd() >= 0 ? client.connection() : FrameTrace::kSharedMemory, now_ns);
  if (client.header().host_received_ns == 0) {
    return;
  }
  context_.times.pose_to_last_byte.record(client.delay_ns());
  context_.times.sim_age.record(client.age_ns());
  if (const auto change_ns = client.delay_change_ns()) {
    context_.times.jitter.record(*change_ns);
  }
  if (counts != nullptr) {
    counts->delay_ns.store(client.delay_ns(), std::memory_order_relaxed);
    counts->jitter_ns.store(client.jitter_ns(), std::memory_order_relaxed);
  }
}

void Sender::block(SenderClient& client) noexcept {
  client.blocked = true;
  epoll_event event{};
  event.events = EPOLLOUT | EPOLLONESHOT;
  event.data.ptr = &client;
  // The socket is registered only at the first block, because epoll reports errors and hang-ups
  // even of sockets nobody asks about.
  ::epoll_ctl(epoll_.get(), client.registered ? EPOLL_CTL_MOD : EPOLL_CTL_ADD, client.fd(), &event);
  client.registered = true;
}

void Sender::remove(std::size_t index, bool failed) noexcept {
  SenderClient* client = clients_[index];
  if (client->registered) {
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, client->fd(), nullptr);
  }
  clients_.erase(clients_.begin() + static_cast<std::ptrdiff_t>(index));
  if (std::ranges::find(residents_, client) != residents_.end()) {
    return;
  }
  if (failed && client->error() != 0) {
    context_.sender_events.push(EventKind::client_failed, client->connection(),
                                static_cast<std::uint64_t>(client->error()));
  }
  // Room is certain: the receiver has at most max_clients clients lent, the ring holds four times
  // that.
  static_cast<void>(context_.from_sender.push({client->connection(), client}));
  context_.bells.receiver.ring();
}

}  // namespace emit::server
