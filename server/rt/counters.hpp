// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace emit::server {

/// One list gives enum and label, so that neither can go without the other.
#define EMIT_COUNTERS(X)                                                                    \
  X(host_datagrams, "UDP datagrams received on the host port")                              \
  X(host_frames_accepted, "host frames accepted")                                           \
  X(host_frames_missing, "host frame numbers that never arrived")                           \
  X(host_frames_unused, "host frames accepted while stopped")                               \
  X(host_os_drops, "host datagrams dropped by the kernel for want of buffer space")         \
  X(host_frames_old_run, "host frames refused: of a run that was replaced")                 \
  X(host_epochs, "restarts of the host seen by a new run id")                               \
  X(weather_coalesced, "weather changes replaced by a newer one before any frame")          \
  X(weather_lost, "weather changes the source had no room for")                             \
  X(device_failures, "frames during which the driver reported an error")                    \
  X(clock_steps, "steps of the wall clock of more than 1 ms")                               \
  X(frames_coarse, "frames that may be coarser than asked, for the reasons that follow")    \
  X(frames_coarse_camera, "of them: the camera is where the surface was not prepared")      \
  X(frames_coarse_fov, "of them: a field of view that the sensor may not have")             \
  X(frames_coarse_samples, "of them: thermal.max_samples ran out in view")                  \
  X(frames_coarse_meshes, "of them: meshes were simplified visibly")                        \
  X(frames_coarse_shade, "of them: entities' shade found no room, or moved too fast")       \
  X(frames_coarse_shadows, "of them: more entities turned than get shadow maps at once")    \
  X(frames_coarse_weather, "of them: surfaces lack a change of the weather by the host")    \
  X(frames_coarse_edges, "of them: heat near edges not settled to 0.05 K yet")              \
  X(targets_plain, "small targets drawn plainly: too many in a frame for windows")          \
  X(frames_wet_unknown, "frames after rain on materials that state no store of water")      \
  X(frames_rain_shelter, "frames after rain whose entities left the places of its shelter") \
  X(frames_snowfall, "frames after rain at below 1 C, which is snow")                       \
  X(frames_freezing, "frames with moist ground below 0 C in the last six hours")            \
  X(frames_melting, "frames with snow or ice above 0 C in the last six hours")              \
  X(frames_humidity_unknown, "frames of moist ground whose weather states no humidity")     \
  X(frames_strong_wind, "frames after wind above 20 m/s, beyond the air film")              \
  X(frames_longwave_low, "frames after long-wave irradiance below that of any sky")         \
  X(frames_layers_invalid, "frames of materials that are more than dry layers")             \
  X(frames_warmed_up, "frames in which the surface warmed up again: sim time jumped")       \
  X(frames_entities_behind, "frames with entities of an older one: more than 128 moved")    \
  X(frames_shed, "frames of less than full quality, to be ready in time")                   \
  X(poses_dropped, "poses the histories forgot for want of room")                           \
  X(commands, "control commands taken")                                                     \
  X(refused_wrong_version, "messages refused: wrong version")                               \
  X(refused_oversize, "messages refused: too large")                                        \
  X(refused_malformed, "messages refused: malformed")                                       \
  X(refused_unknown_entity, "entity updates refused: unknown entity")                       \
  X(refused_invalid_pose, "host frames refused: invalid pose")                              \
  X(refused_time_backwards, "host frames refused: time going backwards")                    \
  X(refused_duplicate_frame, "host frames refused: number already seen")                    \
  X(refused_unknown_channel, "subscriptions refused: unknown channel")                      \
  X(refused_not_allowed, "messages refused: not allowed in this role or state")             \
  X(refused_overloaded, "connections or updates refused: limit reached")                    \
  X(refused_internal, "messages refused: failure inside emitd")                             \
  X(refused_invalid_environment, "host frames refused: invalid environment")                \
  X(refused_invalid_view, "fields of view refused: outside the sensor's range")             \
  X(refused_invalid_part, "host frames refused: drive of a part out of range")              \
  X(refused_unknown_part, "commands to parts refused: unknown part, or no throttle")        \
  X(statuses_suppressed, "answers not sent: rate limit, no room, or to an answer")          \
  X(connections_accepted, "TCP connections accepted")                                       \
  X(connections_closed, "TCP connections closed")                                           \
  X(peers_refused, "connections closed at once: peer not in access.allow")                  \
  X(peer_limit_refused, "connections refused: access.max_connections_per_peer")             \
  X(handshakes_refused, "connections closed: tls.max_handshakes under way")                 \
  X(handshakes_done, "TLS handshakes completed")                                            \
  X(handshakes_failed, "TLS handshakes failed: no or wrong certificate, no TLS 1.3")        \
  X(host_peers_refused, "host datagrams dropped: sender not in access.allow")               \
  X(host_unauthenticated, "host datagrams dropped: bare, where a MAC is required")          \
  X(host_unknown_key, "host datagrams dropped: MAC by a key that is not known")             \
  X(host_bad_mac, "host datagrams dropped: wrong MAC")                                      \
  X(host_replayed, "host datagrams dropped: counter seen before, or too old")               \
  X(host_sessions, "authenticated sessions that hosts began")                               \
  X(host_frames_over_rate, "host frames refused: access.max_host_frames_hz")                \
  X(control_over_rate, "control records refused: access.max_control_records_hz")            \
  X(reads_paused, "times a connection was not read on: it sent more than its pace")         \
  X(clients_disconnected_slow, "clients disconnected: fell behind with every_frame")        \
  X(recorders_disconnected_slow, "recorders disconnected: fell behind")                     \
  X(frames_submitted, "frames issued to the source")                                        \
  X(frames_rendered, "frames finished by the source")                                       \
  X(frames_published, "frames handed to the sender, repeated ones included")                \
  X(frames_late, "frames flagged late")                                                     \
  X(frames_repeated, "frames flagged repeated")                                             \
  X(frames_stale, "frames flagged stale")                                                   \
  X(frames_extrapolated, "frames flagged extrapolated")                                     \
  X(slots_without_image, "clock slots before the first image")                              \
  X(slots_missed, "clock slots skipped because the conductor was not running")              \
  X(triggers, "trigger datagrams received on the trigger port")                             \
  X(triggers_used, "triggers that began a slot")                                            \
  X(triggers_refused, "trigger datagrams refused: malformed or of another sender")          \
  X(triggers_unauthenticated, "trigger datagrams refused: no MAC by host.key_file")         \
  X(triggers_stale, "trigger datagrams refused: of another time than their arrival")        \
  X(triggers_missing, "trigger numbers that never arrived")                                 \
  X(triggers_duplicate, "triggers refused: number already seen")                            \
  X(triggers_too_fast, "triggers refused: half a period or less after the last")            \
  X(triggers_late, "triggers that came more than half a period late")                       \
  X(trigger_silences, "times no trigger came for ten periods or more")                      \
  X(trigger_os_drops, "triggers dropped by the kernel for want of buffer space")            \
  X(axes_commands, "commands sent to the motion simulator")                                 \
  X(axes_commands_missed, "commands left out because the motion agent did not run")         \
  X(axes_commands_limited, "commands with an axis at a limit")                              \
  X(axes_send_errors, "commands the kernel refused to send")                                \
  X(axes_rounds_left_out, "commands left out: its last answers had not come")               \
  X(axes_connections_lost, "connections to it lost: closed, silent, no order")              \
  X(axes_inputs_dropped, "poses and targets the motion agent did not take in time")         \
  X(axes_reports, "measurements of the motion simulator taken")                             \
  X(axes_reports_refused, "its datagrams refused: malformed, old, wrong number of axes")    \
  X(axes_torn_reads, "looks at its memory while it wrote: read again later")                \
  X(axes_reports_dropped, "measurements the conductor did not take in time")                \
  X(shift_feedback_dropped, "measurements the render agent did not take in time")           \
  X(output_px_clamped, "pixels outside the range of a channel's drive, counts or kelvin")   \
  X(output_shifts_unknown, "frames not shifted: no measurement of the axes was near")       \
  X(output_shifts_cut, "pictures shifted further than there is room around them")           \
  X(axes_feedback_losses, "times its measurements stopped: motion.feedback_timeout_ms")     \
  X(axes_host_silences, "times no pose came for pacing.horizon_ms: its axes rest or park")  \
  X(axes_interlocks, "times its interlock was open")                                        \
  X(axes_commands_ignored, "times it did not take or follow commands for 0.5 s")            \
  X(axes_clock_jumps, "jumps of simulation time against time, seen by the axes")            \
  X(gateway_datagrams, "datagrams of a host that speaks CIGI, DIS or net_fdm")              \
  X(gateway_peers_refused, "such datagrams dropped: their sender is not allowed")           \
  X(gateway_messages_refused, "its messages refused: malformed, or without a time")         \
  X(gateway_messages_old, "its messages left out: repeated, or overtaken by a newer one")   \
  X(gateway_packets_refused, "its packets refused: malformed, or out of range")             \
  X(gateway_packets_skipped, "its packets of unknown kinds")                                \
  X(gateway_packets_unused, "its packets without effect")                                   \
  X(gateway_unknown_entities, "its entities that the scenario does not have")               \
  X(gateway_questions_dropped, "its questions without an answer: too many at a time")       \
  X(gateway_answers, "answers to its questions")                                            \
  X(gateway_texts_dropped, "texts that it was not told: too many at a time")                \
  X(gateway_messages_sent, "messages sent to it")                                           \
  X(gateway_send_errors, "messages to it that the kernel refused to send")                  \
  X(gateway_os_drops, "its datagrams dropped by the kernel for want of buffer space")       \
  X(gateway_reports_dropped, "reports of frames that it was not told of in time")           \
  X(frames_motion_fault, "frames flagged motion_fault")                                     \
  X(no_free_slot, "attempts to render while every slot was in use")                         \
  X(frames_sent, "frames sent completely, all clients")                                     \
  X(frames_shared, "frames put into shared memory, counted as sent too")                    \
  X(frames_unread, "frames not put into shared memory because nobody reads it")             \
  X(frames_skipped, "frames skipped: the client was slow, or an image missed its number")   \
  X(frames_left_out, "frames not sent by the clients' own wish (every_nth)")                \
  X(frames_spilled, "partly sent frames moved to a client's own buffer")                    \
  X(bytes_sent, "bytes handed to the kernel, all clients")                                  \
  X(send_errors, "datagrams the kernel refused")                                            \
  X(parity_sent, "parity fragments sent, beside the frames' own")                           \
  X(resend_requests, "requests for missing fragments")                                      \
  X(resends_refused, "such requests refused: frame gone, over the limit, no room")          \
  X(fragments_resent, "fragments sent again on request")                                    \
  X(journal_entries, "journal entries written to journal.file, or recorded without it")     \
  X(journal_dropped, "journal entries that the journal lacks: disk full, or too slow")      \
  X(journal_forgotten, "journal entries that a later recorder lacks: journal.memory_mib")   \
  X(journal_errors, "failures writing the journal file")                                    \
  X(events_dropped, "log events lost: log queue full")

enum class Counter : std::uint8_t {
#define EMIT_COUNTER_ENUM(name, label) name,
  EMIT_COUNTERS(EMIT_COUNTER_ENUM)
#undef EMIT_COUNTER_ENUM
      count_
};
inline constexpr std::size_t kCounterCount = static_cast<std::size_t>(Counter::count_);

struct CounterLabel {
  std::string_view name;
  std::string_view label;
};
inline constexpr std::array kCounterLabels{
#define EMIT_COUNTER_LABEL(name, label) CounterLabel{#name, label},
    EMIT_COUNTERS(EMIT_COUNTER_LABEL)
#undef EMIT_COUNTER_LABEL
};
static_assert(kCounterLabels.size() == kCounterCount);

/// Counts since the start of the daemon. Thread: any. Real time: RT-safe.
class Counters {
 public:
  std::uint64_t add(Counter id, std::uint64_t amount = 1) noexcept {
    return values_[static_cast<std::size_t>(id)].fetch_add(amount, std::memory_order_relaxed) +
           amount;
  }
  [[nodiscard]] std::uint64_t get(Counter id) const noexcept {
    return values_[static_cast<std::size_t>(id)].load(std::memory_order_relaxed);
  }

 private:
  std::array<std::atomic<std::uint64_t>, kCounterCount> values_{};
};

}  // namespace emit::server
